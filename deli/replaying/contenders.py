"""A backend on recorded subproblems, which are handed to it as in a run."""

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
"""Verdicts on residuals; the last stands for a problem that the backend refused."""


class Outcome(NamedTuple):
    """The result of a backend on one subproblem.

    Attributes
    ----------
    status : str
        One of `STATUSES`.
    claimed : bool
        Whether the backend said that it solved the problem.
    time, solver_time : float
        Median seconds of a solve from data to checked answer, and of its part in the backend; inf without an answer.
    iterations : int
        Number of iterations, as the backend counts them.
    residuals : tuple of float
        Primal, dual and complementarity residual, recomputed; nan without an answer.
    z : array
        The answer; nan without one.
    multipliers : float
        Sum of the absolute values of the multipliers.
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
    """A backend that solves recorded subproblems through their cvxpy models, compiled by shape, as in runs.

    Equality rows that depend on others are left out. Backends that take sparse matrices get many rows as one.

    Parameters
    ----------
    choice : SolverChoice
    """

    def __init__(self, choice: SolverChoice) -> None:
        self._solvers: dict[int, ProgramSolver] = {}
        self._choice = choice

    def solve(self, posed: PosedSubproblem, repeat: int = 1, limit: float = math.inf) -> Outcome:
        """Solve once to judge the answer; if it took less than `limit` seconds, solve `repeat` times to measure it."""
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
    """Solve by the native method over sparse factors, as runs do where a subproblem has many rows."""
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
    """Return the arrays that represent the problem in kernels."""
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
    """Reference solutions, exact to rounding: polished answers whose residuals are verified.

    Residuals may be as large as `TOLERANCE`, or as the rounding error of large multipliers whose forces cancel; nearly
    dependent rows have such multipliers. The metrics are well conditioned, and z is as exact as the residuals. The
    multipliers of dependent rows are not unique.
    """

    BACKENDS = ("native", "daqp", "piqp")
    TOLERANCE = 1e-13

    def __init__(self) -> None:
        self._contenders = [Contender(SolverChoice(name, self.TOLERANCE, polish=True)) for name in self.BACKENDS]

    def solve(self, posed: PosedSubproblem) -> tuple[np.ndarray, float]:
        """Return the solution and its largest residual; nan where no backend finds one exact to rounding."""
        for contender in self._contenders:
            outcome = contender.solve(posed)
            residual = max(outcome.residuals)
            if residual <= max(self.TOLERANCE, EPSILON * outcome.multipliers):
                return outcome.z, residual
        return np.full(posed.variables, np.nan), math.nan
