"""One backend on recorded subproblems, the way a run would hand them to it."""

import math
import time
from typing import NamedTuple

import numpy as np

import solvers
from deli.errors import StepError
from deli.kernels.program import Program
from deli.subproblems.choices import NATIVE, SolverChoice
from deli.subproblems.models import MODELS
from deli.subproblems.posed import PosedSubproblem
from deli.subproblems.program import ProgramSolver
from deli.subproblems.rows import LARGEST_DENSE
from deli.subproblems.stats import StepStats
from solvers import Solution, Status
from solvers.errors import SolverError

EPSILON = float(np.finfo(float).eps)
NO_ANSWER = "no_answer"
STATUSES = (*(str(status) for status in Status), NO_ANSWER)
"""The verdict on residuals; the last where a backend refused the problem."""


class Outcome(NamedTuple):
    """What a backend made of one subproblem.

    Attributes
    ----------
    status : str
        One of `STATUSES`.
    claimed : bool
        Whether the backend said that it solved the problem.
    time, solver_time : float
        Median seconds of a solve from data to checked answer, and of that inside the backend; inf without an answer.
    iterations : int
        As the backend counts them.
    residuals : tuple of float
        Primal, dual and complementarity residual, recomputed; nan where there is no answer.
    z : array
        The answer, nan where there is none.
    multipliers : float
        Sum of the sizes of its multipliers.
    polished : bool
        Whether the polish replaced the backend's answer.
    """

    status: str
    claimed: bool
    time: float
    solver_time: float
    iterations: int
    residuals: tuple[float, float, float]
    z: np.ndarray
    multipliers: float
    polished: bool


class Contender:
    """Solves recorded subproblems through their cvxpy models, compiled by shape, as runs do.

    Equality rows that depend on others are left out, and many rows handed over sparse to backends that take them so.

    Parameters
    ----------
    choice : SolverChoice
    """

    def __init__(self, choice: SolverChoice) -> None:
        self._solvers: dict[int, ProgramSolver] = {}
        self._choice = choice

    def solve(self, posed: PosedSubproblem, repeat: int = 1, limit: float = math.inf) -> Outcome:
        """Solve once to judge, and if that took less than `limit` seconds `repeat` times against the clock."""
        solver = self._solver(posed)
        if posed.rows > LARGEST_DENSE and not posed.newton and self._choice.backend in NATIVE:
            return _project(solver, posed, self._choice.tolerance, repeat, limit)
        try:
            compiled, _ = solver.pose(posed.variables, posed.equalities, posed.rows, posed.newton)
            began = time.perf_counter()
            solution = compiled.solve()
            took = time.perf_counter() - began
        except (SolverError, StepError):
            nothing = np.full(posed.variables, np.nan)
            return Outcome(NO_ANSWER, False, math.inf, math.inf, 0, (math.nan,) * 3, nothing, math.nan, False)
        rounds = [(took, solution.setup_time + solution.solve_time)]
        if took < limit:
            rounds = [_timed(compiled) for _ in range(repeat)]
        whole, inside = np.median(rounds, axis=0).tolist()
        residuals = (solution.primal_residual, solution.dual_residual, solution.complementarity)
        return Outcome(
            str(solution.status),
            solution.claimed is Status.SOLVED,
            whole,
            inside,
            solution.iterations,
            residuals,
            np.array(solution.primal["velocity"]),
            float(sum(np.abs(dual).sum() for dual in solution.dual)),
            solution.polished,
        )

    def _solver(self, posed: PosedSubproblem) -> ProgramSolver:
        program, solver = _program(posed), self._solvers.get(posed.subproblem)
        if solver is None:
            model, newton_model = MODELS[posed.subproblem]
            solver = ProgramSolver(posed.subproblem, model, newton_model, program, self._choice, StepStats())
            self._solvers[posed.subproblem] = solver
        solver.bind(program)
        return solver


def _timed(compiled: "solvers.CompiledProblem") -> tuple[float, float]:
    began = time.perf_counter()
    solution: Solution = compiled.solve()
    return time.perf_counter() - began, solution.setup_time + solution.solve_time


def _project(solver: ProgramSolver, posed: PosedSubproblem, tolerance: float, repeat: int, limit: float) -> Outcome:
    """Let the native method work over sparse factors, as it does in runs where many rows press."""
    rounds: list[tuple[float, float]] = []
    while len(rounds) <= repeat and (not rounds or rounds[0][0] < limit):
        began = time.perf_counter()
        iterations, residuals, inside = solver.project_sparse(posed.variables, posed.equalities, posed.rows)
        rounds.append((time.perf_counter() - began, inside))
    whole, inside = np.median(rounds[1:] or rounds, axis=0).tolist()
    status = Status.SOLVED if max(residuals) <= tolerance else Status.INACCURATE
    z, multipliers = solver.program.z.copy(), float(np.abs(solver.program.y).sum())
    return Outcome(str(status), True, whole, inside, iterations, residuals, z, multipliers, False)


def _program(posed: PosedSubproblem) -> Program:
    """The arrays that kernels know the problem by."""
    none, rows = np.zeros((0, 0)), posed.rows
    return Program(
        start=posed.start,
        column=posed.column,
        value=posed.value,
        bounds=posed.bounds,
        lengths=np.ones(2 * rows),
        wish=posed.wish,
        z=np.zeros(posed.variables),
        y=np.zeros(rows),
        metric=none if posed.metric is None else posed.metric,
        factor=none,
        white_start=np.zeros(0, dtype=np.int64),
        white_column=np.zeros(0, dtype=np.int64),
        white_value=np.zeros(0),
        gram=np.zeros(0),
        begins=np.zeros(0, dtype=np.int64),
        factored=np.zeros(1, dtype=np.int64),
        right=np.zeros(rows),
        pull=np.zeros(posed.variables),
        report=np.zeros(4),
    )


class Reference:
    """Solutions to rounding: an active-set method polished, its residuals verified.

    They may be `TOLERANCE`, or what rounding leaves of the forces of large multipliers that cancel, which nearly
    dependent rows have. The metrics are well conditioned, and z is as exact as the residuals; where rows depend on each
    other multipliers are not unique.
    """

    BACKENDS = ("native", "daqp", "piqp")
    TOLERANCE = 1e-13

    def __init__(self) -> None:
        self._contenders = [Contender(SolverChoice(name, self.TOLERANCE, polish=True)) for name in self.BACKENDS]

    def solve(self, posed: PosedSubproblem) -> tuple[np.ndarray, float]:
        """The point and its largest residual; nan where no backend finds one to rounding."""
        for contender in self._contenders:
            outcome = contender.solve(posed)
            residual = max(outcome.residuals)
            if residual <= max(self.TOLERANCE, EPSILON * outcome.multipliers):
                return outcome.z, residual
        return np.full(posed.variables, np.nan), math.nan
