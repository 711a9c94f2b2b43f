"""What kernels read and write: the scene, the method, and the arrays a step works in."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deli.kernels.record import RecordType
from deli.mechanics.tables import Rows, Terms

Vector = NDArray[np.float64]
Matrix = Annotated[NDArray[np.float64], 2]
Numbers = NDArray[np.int64]
Flags = NDArray[np.bool_]

GENERALIZED, MOREAU, SEQUENTIAL, FASTEST = 0, 1, 2, 3  # what a pass reflects off, see `reflect`
REFLECTION, POSITION, PROJECTION = 0, 1, 2
# The rows of a position update: their gradients are those at q, or follow the constraints; or they are affine.
FROZEN, MOVING, AFFINE = 0, 1, 2

# What a kernel returns. After REFRESH, neighbours must be searched and the step tried again; above it, it failed.
DONE, REFRESH = 0, 1
RAISED, UNCONVERGED, NO_DIRECTION, TOO_MANY_PASSES, NOT_FINITE, INDEFINITE = 10, 11, 12, 13, 14, 15
ACCUMULATED, UNBALANCED = 16, 17

# What a kernel asks the function at `Hooks.evaluate` for, of the configuration in `Mail.at`.
ENERGY, GRADIENT, HESSIAN, SOFTEN, LEAST_GAP = 0, 1, 2, 3, 4
UNILATERAL, UNILATERAL_GRADIENTS, BILATERAL, BILATERAL_GRADIENTS = 5, 6, 7, 8


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
        Lowest body of those that bilateral constraints join to each.
    length : float
        The scene's length scale.
    constant : bool
        Whether the force of the first slot does not depend on x.
    newton : bool
        Whether that force has a known derivative, so that Newton's metric pays.
    curved : bool
        Whether the potential has a hessian other than zero.
    coupled : bool
        Whether the bodies of a step cannot be told apart into islands.
    other_forces : bool
        Whether functions of the user's contribute to the potential.
    other_unilateral, other_bilateral : int
        Rows that are functions of the user's.
    reference : (dof,) array
        Where the neighbours in `unilateral` were searched; empty if they were not.
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
        The same for the momentum at x, of methods that do not reflect.
    gain : float
        Of the impulse of the constraints in that momentum.
    share : float
        x = q + h (share u + (1 − share) M⁻¹p), with u what the position update solves for.
    place : float
        Constraints of a position update are taken at q + place (x − q).
    rows : int
        What the rows of a position update are.
    recurrence : (3, 3) array
        What the two rows of memory and the acceleration at x add to x̃, ṽ and the new memory, in
        `deli.kernels.nonsmooth_alpha`; empty for other methods.
    restitution : float
        Of normal velocities, in methods that do not reflect.
    stiffness : float
        K = stiffness h² V″ is minus the derivative of φ with respect to u.
    implicit : bool
        Whether φ depends on x.
    reflects : bool
        Whether Algorithm 1 is followed, or only its smooth part.
    operator : int
    numerical : bool
        Whether reflections conserve the numerical Hamiltonian.
    curvature : float
        c h² of the scheme, W = M⁻¹ + c h² M⁻¹V″M⁻¹.
    order : int
        Of the steps to and from the events of a collision integrator; 0 for other methods.
    discrete : bool
        Whether such a method conserves the discrete energy at events.
    closed_loop, skip : bool
    contact_tolerance : float
    tolerance : (3,) array
    exact, native : (3,) bool arrays
        By subproblem: whether its answers are polished or exact, and whether the compiled solver gives them.
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
    order: int
    discrete: bool
    closed_loop: bool
    skip: bool
    contact_tolerance: float
    tolerance: Vector
    exact: Flags
    native: Flags


class Hooks(NamedTuple):
    """Addresses of functions that are not compiled, 0 where there is none.

    Attributes
    ----------
    evaluate : int
        ``evaluate(what, 0, 0, 0)`` answers in `Mail`; what it returns is nonzero if the user's function raised.
    solve : int
        ``solve(subproblem, size, equalities, rows)`` solves the program in `Program`.
    clock : int
        ``clock_gettime`` of the C library.
    numerical : int
        The unit `deli.kernels.turning.turn_numerical`, which few runs need.
    step : int
        The unit that takes a step of the method.
    root : int
        ``brentq`` of SciPy, for methods that find roots.
    """

    evaluate: int
    solve: int
    clock: int
    numerical: int
    step: int
    root: int


class Program(NamedTuple):
    """The metric projection at hand, in z = √M v over a speed, with rows of unit length; equalities first.

    ``minimize ½ zᵀA z − wishᵀz  subject to  R z = b (equalities), R z >= b``, so that ``A z − wish = Rᵀ y``.

    Attributes
    ----------
    start, column, value : arrays
        R by compressed rows.
    bounds, lengths : (rows,) arrays
        b, and the lengths that the rows had.
    wish, z : (dof,) arrays
    y : (rows,) array
    metric, factor : (dof, dof) arrays
        A where it is not the identity, and its Cholesky factor; empty where the scene needs none.
    white_start, white_column, white_value : arrays
        R in coordinates in which A is the identity; empty likewise.
    report : (4,) array
        What the last native solve took: iterations, primal, dual and complementarity residual.
    """

    start: Numbers
    column: Numbers
    value: Vector
    bounds: Vector
    lengths: Vector
    wish: Vector
    z: Vector
    y: Vector
    metric: Matrix
    factor: Matrix
    white_start: Numbers
    white_column: Numbers
    white_value: Vector
    report: Vector


class Export(NamedTuple):
    """The rows of a program by themselves.

    Attributes
    ----------
    dense : (rows, dof) array
    kept : (rows,) int64 array
        Their numbers in the program.
    """

    dense: Matrix
    kept: Numbers


class Mail(NamedTuple):
    """What user functions read and write.

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


class Islands(NamedTuple):
    """Bodies and rows by connected component; see `deli.kernels.islands`.

    `touched` lists the bodies whose labels are not -1, and ends with their number.
    """

    parent: Numbers
    label: Numbers
    place: Numbers
    body_start: Numbers
    bodies: Numbers
    row_start: Numbers
    rows: Numbers
    held_start: Numbers
    held: Numbers
    touched: Numbers
    joint_start: Numbers
    joints: Numbers


class Work(NamedTuple):
    """Arrays of one step, by degree of freedom, by unilateral row, by bilateral row.

    `span` holds h, the size of the step at hand: words of a record never change, so no method could take a part of a
    step if it were one. `here` is ∇V(q), `spot` where the constraints of a position update are taken, `base` and
    `held_base` the values at u = 0 of rows that are affine. What collision integrators need is described in
    `deli.kernels.fractions`, from `start` to `balance`. What a method carries from step to step besides q and p is
    `memory`, of as many rows as it has names for, and becomes `remembered`.
    """

    span: Vector
    q: Vector
    p: Vector
    memory: Matrix
    moved: Vector
    carried: Vector
    remembered: Matrix
    momentum: Vector
    velocity: Vector
    force: Vector
    stress: Vector
    here: Vector
    spot: Vector
    before: Vector
    best: Vector
    best_force: Vector
    predicted: Vector
    predicted_velocity: Vector
    predicted_force: Vector
    free_momentum: Vector
    gaps: Vector
    gaps_moved: Vector
    base: Vector
    normals: Matrix
    normals_moved: Matrix
    gradients: Matrix
    gradients_moved: Matrix
    approach: Vector
    still: Vector
    touching: Flags
    active: Flags
    landing: Flags
    resting: Flags
    marked: Numbers
    chosen: Numbers
    smooth: Numbers
    pressing: Numbers
    pressed: Vector
    scaled: Vector
    best_pressed: Vector
    best_scaled: Vector
    mismatch: Vector
    held_base: Vector
    held_normals: Matrix
    held_normals_moved: Matrix
    held_gradients: Matrix
    held_gradients_moved: Matrix
    start: Vector
    start_momentum: Vector
    event: Vector
    event_momentum: Vector
    incoming: Vector
    impulse: Vector
    meeting: Numbers
    balance: Vector
    report: Vector
    ticks: Numbers


class Tally(NamedTuple):
    """Statistics as `deli.subproblems.stats.StepStats` shows them.

    Attributes
    ----------
    counts : (7, 3) int64 array
        Solves, skipped, iterations, rows, fallbacks, claimed and verified solves, by subproblem.
    times : (2, 3) array
    residuals : (3, 3) array
    status : (3,) int64 array
    contacts : (3,) int64 array
        Smooth contacts of the last step, reflected contacts since the last reset, programs solved natively ever.
    """

    counts: Annotated[NDArray[np.int64], 2]
    times: Matrix
    residuals: Matrix
    status: Numbers
    contacts: Numbers


class Machine(NamedTuple):
    """All that the kernels of one scene and method share; `kept` is the tally before a step that may be tried again."""

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
PROGRAM = RecordType(Program)
EXPORT = RecordType(Export)
