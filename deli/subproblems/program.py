"""A subproblem's cvxpy models, compiled by shape, which solve the programs that kernels hand over."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

import solvers
from deli.errors import InputError, StepError
from deli.kernels.program import EXPORT, PROGRAM, Export, Program
from deli.kernels.record import Record
from deli.kernels.solve import export
from deli.numerals import numeral
from deli.subproblems.choices import NATIVE, SUBPROBLEMS, SolverChoice
from deli.subproblems.rows import DENSE, LARGEST_DENSE, Patterns, find_patterns
from deli.subproblems.stats import StepStats
from solvers import native
from solvers.native_sparse import SparseProjection
from solvers.threads import CVXPY

if TYPE_CHECKING:
    import cvxpy as cp

    Model = Callable[[np.ndarray, int, int, Patterns], cp.Problem]

MOST_ENTRIES = 4_000_000
PATTERNS = 4  # sparse problems that are kept compiled
_ACCEPTED = 1e3  # an answer whose residual exceeds this many tolerances stops the run
_SIZES = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)


class ProgramSolver:
    """The metric projection of theory section 3, through one subproblem's cvxpy models.

    ``minimize ½ zᵀA z − wishᵀz  subject to  N z ≥ b (λ ≥ 0),  F z = c (ν)``, so that ``A z − wish = Nᵀλ + Fᵀν``.

    Kernels pose it in z = √M v / s, where s is a speed of the problem at hand, and with rows of unit length, so that a
    tolerance means the same in any units and for any masses: with A = M the model's masses are all one. Solvers get an
    independent set of the equality rows. Problems are compiled once for each number of variables, each number of
    equalities and each padded number of inequality rows.

    Large programs are handed over as sparse matrices to backends that take them. They have all equality rows: solvers
    that factorize sparse matrices shift or perturb singular ones, and residuals show whether that succeeded. These
    problems are compiled for a pattern of entries, and the last few are kept.

    Parameters
    ----------
    subproblem : int
        Index into `SUBPROBLEMS`.
    model, newton_model : callable
        ``model(mass, rows, bilateral_rows, patterns)`` returns the `cvxpy.Problem`; the patterns
        (`deli.subproblems.rows.Patterns`) are optional. The second model has the metric as a parameter.
    program : Program
        The arrays in which kernels leave the data and find the answer.
    choice : SolverChoice
    stats : StepStats
    measured : bool
        Whether the residuals of each solve are those of the subproblem, and are recorded.
    skip : bool
        Whether equality rows alone are answered by a linear solve.
    """

    def __init__(
        self,
        subproblem: int,
        model: "Model",
        newton_model: "Model",
        program: Program,
        choice: SolverChoice,
        stats: StepStats,
        measured: bool = True,
        skip: bool = True,
    ) -> None:
        self._subproblem = subproblem
        self._models = (model, newton_model)
        self.bind(program)
        self._choice = choice
        self._stats = stats
        self._measured = measured
        self._skip = skip
        self._large = SparseProjection(choice.warm_start)
        self._takes_sparse = solvers.can(choice.backend, "sparse")
        self._patterns: dict[tuple[int, int, bytes, bytes], tuple[solvers.CompiledProblem, np.ndarray]] = {}
        self._compiled: dict[tuple[bool, int, int, int], solvers.CompiledProblem] = {}
        self._exports: dict[tuple[int, int], Record] = {}
        self.backends: set[str] = set()
        if choice.options or choice.backend.startswith("cvxpy:"):
            self._try()

    def bind(self, program: Program) -> None:
        """Solve the programs in these arrays from now on."""
        self.program = program
        self._record = Record(PROGRAM, program)

    def solve(self, size: int, equalities: int, rows: int, newton: bool) -> None:
        """Solve the program at hand, its first rows `equalities`; write z and y.

        Raises
        ------
        StepError
            If no answer within a thousand tolerances is found, or if the backend raises an exception.
        """
        program, free = self.program, rows - equalities
        if rows > LARGEST_DENSE and not newton and self._natively(size, equalities, rows):
            return
        try:
            compiled, kept = self.pose(size, equalities, rows, newton)
            solution = compiled.solve()
        except solvers.ParameterError as error:
            name = SUBPROBLEMS[self._subproblem]
            raise StepError(f"{name}: its program holds nan or infinity; use a smaller step_size.") from error
        except solvers.SolverError as error:
            self._stats.add_failure(self._subproblem, rows)
            raise StepError(f"{SUBPROBLEMS[self._subproblem]}: {error}; try another backend.") from error
        self._account(solution, rows)
        program.z[:size] = solution.primal["velocity"]
        duals = iter(solution.dual)
        if free:
            program.y[equalities:rows] = next(duals)[:free]
        program.y[:equalities] = 0.0
        if kept.size:
            # cvxpy's multipliers of equalities have the opposite sign.
            program.y[kept] = -next(duals)

    def pose(self, size: int, equalities: int, rows: int, newton: bool) -> "tuple[solvers.CompiledProblem, np.ndarray]":
        """Return the compiled problem with the data of the program at hand, and the numbers of its equality rows.

        Raises
        ------
        StepError
            If the matrix is dense and too large.
        """
        if rows > LARGEST_DENSE and not newton and self._takes_sparse:
            compiled, kept = self._hand_over_sparse(size, equalities, rows), np.arange(equalities)
        else:
            compiled, kept = self._hand_over(size, equalities, rows, newton)
        np.negative(self.program.wish[:size], out=compiled.parameters["linear"])
        return compiled, kept

    def _hand_over(
        self, size: int, equalities: int, rows: int, newton: bool
    ) -> "tuple[solvers.CompiledProblem, np.ndarray]":
        """Return the dense model with its data, without `linear`, and the numbers of its equality rows."""
        program = self.program
        if rows * size > MOST_ENTRIES:
            raise StepError(
                f"{SUBPROBLEMS[self._subproblem]}: {rows} constraints on {size} degrees of freedom press at once, too "
                f"many for {self._choice.backend!r} (at most {MOST_ENTRIES:,} entries of the dense matrix); use a "
                f"smaller step_size, or, unless an implicit potential is in the metric, a backend for sparse matrices: "
                f"{', '.join(solvers.able('sparse'))}."
            )
        exported = self._exported(rows, size)
        dense, places = exported.fields
        independent = export.call(self._record.address, exported.address, equalities, rows, size)
        free = rows - equalities
        compiled = self._compile(newton, size, free, independent)
        data = compiled.parameters
        kept = places[:independent]
        if free:
            data["gradients"][:free] = dense[independent : independent + free]
            data["gradients"][free:] = 0.0
            data["bounds"][:free] = program.bounds[equalities:rows]
            data["bounds"][free:] = -1.0
        if independent:
            data["bilateral"][:] = dense[:independent]
            if "targets" in data:
                data["targets"][:] = program.bounds[kept]
        if newton:
            data["metric"][:] = program.metric[:size, :size]
        return compiled, kept

    def _hand_over_sparse(self, size: int, equalities: int, rows: int) -> "solvers.CompiledProblem":
        """Return the sparse model with its data, without `linear`."""
        program = self.program
        entries, split = program.start[rows], program.start[equalities]
        start, column = program.start[: rows + 1], program.column[:entries]
        key = (size, equalities, start.tobytes(), column.tobytes())
        known = self._patterns.pop(key, None)
        if known is None:
            order, patterns = find_patterns(start, column, equalities)
            known = self._compile_model(False, size, rows - equalities, equalities, patterns), order
        self._patterns[key] = known  # now the last in order
        if len(self._patterns) > PATTERNS:
            del self._patterns[next(iter(self._patterns))]
        compiled, order = known
        data, values = compiled.parameters, program.value[order]
        if rows > equalities:
            data["gradients"][:] = values[split:]
            data["bounds"][:] = program.bounds[equalities:rows]
        if equalities:
            data["bilateral"][:] = values[:split]
            if "targets" in data:
                data["targets"][:] = program.bounds[:equalities]
        return compiled

    def _natively(self, size: int, equalities: int, rows: int) -> bool:
        """Solve a large program with sparse factors if it is a linear solve or the native backend's; return success."""
        linear = self._skip and equalities == rows
        if not (linear or self._choice.backend in NATIVE):
            return False
        began = time.perf_counter()
        iterations, residuals, solve_time = self.project_sparse(size, equalities, rows)
        if not max(residuals) <= self._choice.tolerance:
            return False
        if not linear:
            overhead = time.perf_counter() - began - solve_time
            self._stats.add_native(self._subproblem, iterations, rows, solve_time, overhead)
            if self._measured:
                self._stats.measure(self._subproblem, *residuals)
            self.backends.add("native")
        return True

    def project_sparse(self, size: int, equalities: int, rows: int) -> tuple[int, tuple[float, float, float], float]:
        """Solve the program at hand with sparse factors by the native active-set method, and write z and y.

        Returns the iterations, the residuals, and the seconds of the solve without the residuals. The metric is the
        identity.
        """
        program, began = self.program, time.perf_counter()
        entries = program.start[rows]
        matrix = sparse.csr_array(
            (program.value[:entries], program.column[:entries], program.start[: rows + 1]), shape=(rows, size)
        )
        bounds, wish = program.bounds[:rows], program.wish[:size]
        z, y, iterations, _ = self._large.project(matrix, bounds, equalities, wish)
        solved = time.perf_counter()
        residuals = native.residuals(
            program.start[: rows + 1], program.column[:entries], program.value[:entries], bounds, equalities, wish, z, y
        )
        program.z[:size], program.y[:rows] = z, y
        return iterations, residuals, solved - began

    def _try(self) -> None:
        """Solve a trivial problem, so that options which a backend does not accept are refused before a run starts."""
        try:
            compiled = self._compile(False, 1, 1, 0)
            for view in compiled.parameters.values():
                view[...] = 0.0
            compiled.solve()
        except Exception as error:
            with_options = f" with options {dict(self._choice.options)!r}" if self._choice.options else ""
            raise InputError(
                f"solvers.{SUBPROBLEMS[self._subproblem]}: backend {self._choice.backend!r}{with_options}: "
                f"{(str(error) or type(error).__name__).splitlines()[0]}"
            ) from error

    def _exported(self, rows: int, size: int) -> Record:
        exported = self._exports.get((rows, size))
        if exported is None:
            fields = Export(np.zeros((rows, size)), np.zeros(rows, dtype=np.int64))
            exported = self._exports[rows, size] = Record(EXPORT, fields)
        return exported

    def _compile(self, newton: bool, size: int, rows: int, bilateral_rows: int) -> "solvers.CompiledProblem":
        padded = next((size for size in _SIZES if size >= rows), rows)
        key = (newton, size, padded, bilateral_rows)
        compiled = self._compiled.get(key)
        if compiled is None:
            compiled = self._compiled[key] = self._compile_model(newton, size, padded, bilateral_rows)
        return compiled

    def _compile_model(
        self, newton: bool, size: int, rows: int, bilateral_rows: int, patterns: Patterns = DENSE
    ) -> "solvers.CompiledProblem":
        choice = self._choice
        with CVXPY:
            return solvers.compile(
                self._models[newton](np.ones(size), rows, bilateral_rows, patterns),
                choice.backend,
                tolerance=choice.tolerance,
                polish=choice.polish,
                check_parameters=False,  # kernels have factorized what is declared positive definite
                warm_start=choice.warm_start and choice.backend not in NATIVE,
                **choice.options,
            )

    def _account(self, solution: "solvers.Solution", rows: int) -> None:
        self._stats.add(self._subproblem, solution, rows)
        residuals = (solution.primal_residual, solution.dual_residual, solution.complementarity)
        if self._measured:
            self._stats.measure(self._subproblem, *residuals)
        self.backends.add(solution.backend)
        residual = max(residuals)
        if not (solution.ok or residual <= _ACCEPTED * self._choice.tolerance):
            raise StepError(
                f"{SUBPROBLEMS[self._subproblem]}: backend {solution.backend!r} reports {solution.claimed} and leaves "
                f"a residual of {residual:.1e} where {numeral(self._choice.tolerance)} was asked ({solution.status}"
                f"{': ' + solution.message if solution.message else ''}); "
                f"try another backend, polish = true, or a smaller step_size."
            )
