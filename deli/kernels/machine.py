"""The records that the kernels of one scene and method share, and their calls back to Python."""

from typing import NamedTuple

from deli.kernels.arrays import Matrix, Vector
from deli.kernels.program import Program
from deli.kernels.record import RecordType
from deli.kernels.system import Method, System
from deli.kernels.work import Islands, Tally, Work


class Hooks(NamedTuple):
    """Addresses of functions that kernels call, 0 for none.

    Attributes
    ----------
    evaluate : int
        ``evaluate(what, 0, 0, 0)`` answers in `Mail`; its result is nonzero if the user's function raised.
    solve : int
        ``solve(subproblem, size, equalities, rows)`` solves the program in `Program`.
    clock : int
        ``clock_gettime`` of the C library.
    numerical : int
        The unit that turns momenta where another energy than H is conserved, which few runs need:
        `deli.kernels.turning.turn_numerical` or `deli.kernels.shadow.turn_shadow`.
    land, balance : int
        `deli.kernels.landing.land` where the loop is closed, and the unit of `deli.kernels.balance` that gives landed
        contacts their momentum where another energy than H is conserved.
    step : int
        The unit that takes a step of the method.
    root : int
        ``brentq`` of SciPy, for methods that find roots.
    posed, solved : int
        Observers of the solves: ``posed(subproblem, size, equalities, rows)`` is called before a solver gets the
        program in `Program`, and ``solved(code, size, equalities, rows)`` after it, with or without an answer.
    """

    evaluate: int
    solve: int
    clock: int
    numerical: int
    land: int
    balance: int
    step: int
    root: int
    posed: int
    solved: int


class Mail(NamedTuple):
    """The arrays that users' functions read and write.

    Attributes
    ----------
    at : (dof,) array
    energy : (1,) array
    gradient : (dof,) array
    hessian : (dof, dof) array
    unilateral, bilateral : (other rows,) arrays
    unilateral_gradients, bilateral_gradients : (other rows, dof) arrays
    """

    at: Vector
    energy: Vector
    gradient: Vector
    hessian: Matrix
    unilateral: Vector
    bilateral: Vector
    unilateral_gradients: Matrix
    bilateral_gradients: Matrix


class Machine(NamedTuple):
    """The records that the kernels of one scene and method share; `kept` is the tally before a step."""

    system: System
    method: Method
    work: Work
    islands: Islands
    program: Program
    mail: Mail
    hooks: Hooks
    tally: Tally
    kept: Tally


MACHINE = RecordType(Machine)
