"""The records that stay the same from step to step: the scene and the method."""

from typing import NamedTuple

from deli.kernels.arrays import Flags, Matrix, Numbers, Vector
from deli.mechanics.tables import Rows, Terms


class System(NamedTuple):
    """A scene bound to a scheme.

    Attributes
    ----------
    dimension : int
    mass, inverse, root : (dof,) arrays
        M, M⁻¹ and √M.
    unilateral, bilateral : Rows
    gap_scale, bilateral_scale : (rows,) arrays
        The size of a gap or equality that counts as one.
    terms : Terms
    component : (bodies,) int64 array
        Lowest of the bodies that bilateral constraints join to each body.
    length : float
        The scene's length scale.
    constant : bool
        Whether the force of the first slot does not depend on x.
    newton : bool
        Whether that force has a known derivative, so that Newton's metric is used.
    curved : bool
        Whether the potential has a hessian other than zero.
    coupled : bool
        Whether the bodies of a step cannot be separated into islands.
    other_forces : bool
        Whether users' functions contribute to the potential.
    other_unilateral, other_bilateral : int
        Number of rows that are users' functions.
    reference : (dof,) array
        Configuration at which the neighbours in `unilateral` were searched; empty without a search.
    reach : float
        Gap up to which pairs were searched.
    """

    dimension: int
    mass: Vector
    inverse: Vector
    root: Vector
    unilateral: Rows
    bilateral: Rows
    gap_scale: Vector
    bilateral_scale: Vector
    terms: Terms
    component: Numbers
    length: float
    constant: bool
    newton: bool
    curved: bool
    coupled: bool
    other_forces: bool
    other_unilateral: int
    other_bilateral: int
    reference: Vector
    reach: float


class Method(NamedTuple):
    """A method with the choices for its subproblems.

    Attributes
    ----------
    start, middle, end : float
        Weights of the force in the position update, φ = −h (start ∇V(q) + middle ∇V((q + x)/2) + end ∇V(x)).
    later_start, later_middle, later_end : float
        Weights of the force in the momentum at x, of methods without reflections.
    gain : float
        Factor of the impulse of the constraints in that momentum.
    share : float
        x = q + h (share u + (1 − share) M⁻¹p), where u is the unknown of the position update.
    place : float
        Constraints of a position update are taken at q + place (x − q).
    rows : int
        Kind of the rows of a position update, see `deli.kernels.codes`.
    recurrence : (3, 3) array
        Weights of the two rows of memory and of the acceleration at x in x̃, ṽ and the new memory, see
        `deli.kernels.nonsmooth_alpha`; empty for other methods.
    restitution : float
        Coefficient of restitution of normal velocities, in methods without reflections.
    stiffness : float
        K = stiffness h² V″ is minus the derivative of φ with respect to u.
    implicit : bool
        Whether φ depends on x.
    reflects : bool
        Whether a step follows Algorithm 1, or only its smooth part.
    operator : int
    numerical : bool
        Whether reflections conserve the numerical Hamiltonian.
    curvature : float
        c h² of the scheme, W = M⁻¹ + c h² M⁻¹V″M⁻¹.
    pull : float
        Coefficient of ∇VᵀM⁻¹∇V in the numerical Hamiltonian.
    shadow : (2m + 1, 2m + 1) array
        Weights of the shadow energy that reflections conserve, see `deli.kernels.shadow`; empty for other methods.
    order : int
        Order of the steps to and from the events of a collision integrator; 0 for other methods.
    discrete : bool
        Whether a collision integrator conserves the discrete energy at events.
    closed_loop, skip : bool
    contact_tolerance : float
    tolerance : (3,) array
    exact, native : (3,) bool arrays
        By subproblem, whether its answers are polished or exact, and whether the compiled solver gives them.
    """

    start: float
    middle: float
    end: float
    later_start: float
    later_middle: float
    later_end: float
    gain: float
    share: float
    place: float
    rows: int
    recurrence: Matrix
    restitution: float
    stiffness: float
    implicit: bool
    reflects: bool
    operator: int
    numerical: bool
    curvature: float
    pull: float
    shadow: Matrix
    order: int
    discrete: bool
    closed_loop: bool
    skip: bool
    contact_tolerance: float
    tolerance: Vector
    exact: Flags
    native: Flags
