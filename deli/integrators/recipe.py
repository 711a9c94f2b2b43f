"""The recipe of a method's step, from which a stepper is made."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deli.kernels.codes import FROZEN
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import Scheme

Weights = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A method as the numbers of its step, whose meaning is described in `deli.kernels.system.Method`.

    Attributes
    ----------
    unit : str
        Module and name of the unit that takes a step.
    weights, later : (start, middle, end)
        Weights of the force in the position update, and in the momentum at x of methods without reflections.
    gain, share, place, rows, restitution
        Numbers of methods without reflections.
    recurrence : rows of 3 numbers
        Weights of the nonsmooth generalized-alpha method.
    memory : int
        Number of arrays of dof numbers in a state besides q and p.
    begin : callable, optional
        ``begin(scene, position)`` returns the memory with which a run begins, of shape (memory, dof).
    reflects : bool
        Whether a step follows Algorithm 1, or only its smooth part.
    operator, order : str
        A pair of `deli.subproblems.reflection.SELECTIONS`.
    numerical : Scheme, optional
        The scheme whose numerical Hamiltonian reflections conserve; None if they conserve another energy.
    shadow : int
        Order of the shadow energy that reflections conserve: 2, 4, 6 or 8; 0 if they conserve another energy.
    closed_loop : bool
    event_order, discrete
        Settings of collision integrators.
    """

    unit: str = "deli.kernels.step.step"
    weights: Weights
    later: Weights = (0.0, 0.0, 0.0)
    gain: float = 0.0
    share: float = 1.0
    place: float = 1.0
    rows: int = FROZEN
    restitution: float = 0.0
    recurrence: tuple[Weights, ...] = ()
    memory: int = 0
    begin: Callable[[Scene, np.ndarray], np.ndarray] | None = None
    reflects: bool = False
    operator: str = "generalized"
    order: str = "index"
    numerical: Scheme | None = None
    shadow: int = 0
    closed_loop: bool = False
    event_order: int = 0
    discrete: bool = False
