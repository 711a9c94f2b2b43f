"""The way from kernels back to Python: to users' functions, and to solvers of other packages."""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from deli.errors import StepError
from deli.kernels import codes as asked
from deli.kernels.balance import balance_numerical, balance_shadow
from deli.kernels.landing import land
from deli.kernels.machine import Hooks, Mail
from deli.kernels.shadow import turn_shadow
from deli.kernels.solve import NEWTON
from deli.kernels.system import Method
from deli.kernels.turning import turn_numerical
from deli.mechanics.constraints import ConstraintStack
from deli.mechanics.energies import potential_hessian
from deli.mechanics.scene import Scene
from deli.subproblems.collector import Collector
from deli.subproblems.program import ProgramSolver

_SOFTEST = -0.5  # least eigenvalue, relative to the masses, that the metric takes from an indefinite hessian
_Function = ctypes.CFUNCTYPE(ctypes.c_int64, *(ctypes.c_int64,) * 4)


class Bridge:
    """Python functions of a scene and its solvers that kernels call.

    An exception cannot pass through compiled code: it is kept in `raised`, and the kernel returns.

    Parameters
    ----------
    scene : Scene
    mail : Mail
        The arrays in which users' functions find q and leave their values.
    solvers : list of ProgramSolver
        By subproblem.
    method : Method
    step : int
        Address of the unit that takes a step.
    collector : Collector, optional
        The collector of the subproblems that solvers get.
    """

    def __init__(
        self,
        scene: Scene,
        mail: Mail,
        solvers: list[ProgramSolver],
        method: Method,
        step: int,
        collector: Collector | None = None,
    ) -> None:
        self.raised: BaseException | None = None
        self._scene = scene
        self._mail = mail
        self._solvers = solvers
        self._answers: dict[int, Callable[[], None]] = {
            asked.ENERGY: self._energy,
            asked.GRADIENT: self._gradient,
            asked.HESSIAN: self._hessian,
            asked.SOFTEN: self._soften,
            asked.LEAST_GAP: self._least,
            asked.UNILATERAL: lambda: self._values(scene.unilateral, mail.unilateral),
            asked.BILATERAL: lambda: self._values(scene.bilateral, mail.bilateral),
            asked.UNILATERAL_GRADIENTS: lambda: self._jacobians(scene.unilateral, mail.unilateral_gradients),
            asked.BILATERAL_GRADIENTS: lambda: self._jacobians(scene.bilateral, mail.bilateral_gradients),
        }
        # Kernels know these functions by their addresses, so they must live as long as the bridge.
        self._evaluate = _Function(self._answer)
        self._solve = _Function(self._answer_program)
        self._watching = self._watch(collector) if collector else ()
        posed, solved = map(_address, self._watching) if collector else (0, 0)
        self.hooks = Hooks(
            evaluate=_address(self._evaluate),
            solve=_address(self._solve),
            clock=_clock(),
            numerical=_turning(method),
            land=land.address if method.closed_loop else 0,
            balance=_balancing(method),
            step=step,
            root=_brentq() if method.order else 0,
            posed=posed,
            solved=solved,
        )

    def forget(self) -> BaseException | None:
        """Return the exception that was raised since the last call, or None."""
        raised, self.raised = self.raised, None
        return raised

    def _answer(self, what: int, *_: int) -> int:
        return self._try(self._answers[what])

    def _answer_program(self, subproblem: int, size: int, equalities: int, rows: int) -> int:
        newton = subproblem >= NEWTON
        solver = self._solvers[subproblem - NEWTON if newton else subproblem]
        return self._try(solver.solve, size, equalities, rows, newton)

    def _watch(self, collector: Collector) -> tuple[Any, Any]:
        """Return the functions that hand subproblems and their answers to the collector."""

        def pose(subproblem: int, size: int, equalities: int, rows: int) -> int:
            newton = subproblem >= NEWTON
            number = subproblem - NEWTON if newton else subproblem
            return self._try(collector.pose, number, newton, self._solvers[0].program, size, equalities, rows)

        def take_answer(code: int, *_: int) -> int:
            return self._try(collector.take_answer, self._solvers[0].program, code == asked.DONE)

        return _Function(pose), _Function(take_answer)

    def _try(self, function: Callable[..., None], *arguments: Any) -> int:
        try:
            function(*arguments)
        except BaseException as error:  # handed on once the kernel has returned
            self.raised = error
            return asked.RAISED
        return asked.ANSWERED

    def _energy(self) -> None:
        self._mail.energy[0] = sum(float(family.energy(self._mail.at)) for family in self._scene.potential.others)

    def _gradient(self) -> None:
        self._mail.gradient[:] = 0.0
        for family in self._scene.potential.others:
            self._mail.gradient[:] += family.gradient(self._mail.at)

    def _hessian(self) -> None:
        self._mail.hessian[:] = potential_hessian(self._scene, self._mail.at)

    def _soften(self) -> None:
        try:
            values, vectors = np.linalg.eigh(self._mail.hessian)
        except np.linalg.LinAlgError as error:
            raise StepError(f"position: the potential's hessian is out of range ({error}); use other units.") from error
        self._mail.hessian[:] = (vectors * np.maximum(values, _SOFTEST)) @ vectors.T

    def _values(self, stack: ConstraintStack, out: np.ndarray) -> None:
        begin = 0
        for family in stack.others:
            out[begin : begin + family.rows] = family.value(self._mail.at)
            begin += family.rows

    def _jacobians(self, stack: ConstraintStack, out: np.ndarray) -> None:
        begin = 0
        for family in stack.others:
            out[begin : begin + family.rows] = family.jacobian(self._mail.at)
            begin += family.rows

    def _least(self) -> None:
        families = self._scene.unilateral.searched_families
        self._mail.energy[0] = min(family.least(self._mail.at) for family in families)


def _turning(method: Method) -> int:
    """Return the address of the unit that reflects momenta at another conserved energy than H; 0 for H."""
    if method.shadow.size:
        return turn_shadow.address
    return turn_numerical.address if method.numerical else 0


def _balancing(method: Method) -> int:
    """Return the address of the unit that conserves another energy than H where contacts land; 0 for H."""
    if not method.closed_loop:
        return 0
    if method.shadow.size:
        return balance_shadow.address
    return balance_numerical.address if method.numerical else 0


def _address(function: object) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0  # type: ignore[arg-type]


@cache
def _clock() -> int:
    """Return the address of the C library's ``clock_gettime``, or 0 without one: compiled solves are then not timed."""
    try:
        function = ctypes.CDLL(None).clock_gettime
    except (AttributeError, OSError, TypeError):
        return 0
    return ctypes.cast(function, ctypes.c_void_p).value or 0


@cache
def _brentq() -> int:
    """Return the address of Brent's method in SciPy's interface for compiled code."""
    from numba.extending import get_cython_function_address

    return int(get_cython_function_address("scipy.optimize.cython_optimize._zeros", "brentq"))
