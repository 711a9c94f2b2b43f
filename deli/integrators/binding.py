"""A scene bound to a method: the arrays that kernels read, and those they work in."""

import ctypes
from functools import cache

import numpy as np

from deli.errors import InputError
from deli.kernels.system import Islands, Mail, Method, Program, System, Work
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import Scheme
from deli.mechanics.tables import OTHER, PLANE, Rows
from deli.subproblems.choices import SUBPROBLEMS, SolverChoice
from deli.subproblems.reflection import OPERATORS

NATIVE = ("native", "auto")
_FARTHEST = 0.25  # of a pair's distance: gaps searched beyond it cost more than searching again
_STEPS = 12  # steps that the fastest bodies take before neighbours are searched again
_LARGEST_HESSIAN = 3000


def bind_system(scene: Scene, scheme: Scheme) -> System:
    """Return the scene's arrays; where rows are searched, none of those are there yet."""
    potential, unilateral, bilateral = scene.potential, scene.unilateral, scene.bilateral
    free, held = unilateral.table, bilateral.table
    other_unilateral = sum(family.rows for family in unilateral.others)
    other_bilateral = sum(family.rows for family in bilateral.others)
    curved, known = _curvature(scene)
    constant = not (scheme.implicit and curved)
    return System(
        dimension=scene.dimension,
        mass=_plain(scene.mass),
        inverse=1.0 / scene.mass,
        root=np.sqrt(scene.mass),
        unilateral=free,
        bilateral=held,
        gap_scale=scene.length_scale * _sizes(scene, unilateral, free),
        bilateral_scale=scene.length_scale * _sizes(scene, bilateral, held),
        terms=potential.table,
        component=components(scene.bodies, held),
        length=scene.length_scale,
        constant=constant,
        newton=not constant and known and scene.dof <= _LARGEST_HESSIAN,
        curved=curved,
        coupled=not constant or other_unilateral + other_bilateral > 0,
        other_forces=bool(potential.others),
        other_unilateral=other_unilateral,
        other_bilateral=other_bilateral,
        reference=np.zeros(0),
        reach=np.inf,
    )


def search(
    system: System, scene: Scene, position: np.ndarray, momentum: np.ndarray, step_size: float, factor: float
) -> System:
    """Return the system with the neighbours that bodies at `position` can meet in the steps to come.

    They are searched `factor` times as far as usual.
    """
    speed = float(np.sqrt(((momentum / scene.mass).reshape(scene.bodies, -1) ** 2).sum(axis=1).max()))
    size = min(float(np.min(family.distance)) for family in scene.unilateral.searched_families)
    stride = 2.0 * step_size * speed
    reach = factor * max(4.0 * stride, min(_STEPS * stride, _FARTHEST * size), 1e-3 * size)
    rows = scene.unilateral.neighbours(position, reach)
    fixed = scene.unilateral.table.kind.size
    sizes = np.ones(rows.kind.size)
    sizes[:fixed] = _sizes(scene, scene.unilateral, scene.unilateral.table)
    return system._replace(
        unilateral=rows, gap_scale=scene.length_scale * sizes, reference=_plain(position), reach=reach
    )


def bind_method(
    scheme: Scheme,
    step_size: float,
    choices: dict[str, SolverChoice],
    skip: bool,
    contact_tolerance: float,
    *,
    reflects: bool = False,
    operator: str = "generalized",
    numerical: bool = False,
    closed_loop: bool = False,
) -> Method:
    """Return a method in the form that kernels read."""
    if operator not in OPERATORS:
        raise InputError(f"reflection operator {operator!r} is unknown; allowed: {', '.join(OPERATORS)}.")
    if not 0 < contact_tolerance < 1:
        raise InputError(f"contact_tolerance is {contact_tolerance!r}; allowed: 0 < contact_tolerance < 1.")
    chosen = [choices[name] for name in SUBPROBLEMS]
    native = np.array([choice.backend in NATIVE and skip for choice in chosen])
    return Method(
        step_size=step_size,
        implicit=scheme.implicit,
        reflects=reflects,
        operator=OPERATORS.index(operator),
        numerical=numerical,
        curvature=2.0 * scheme.numerical_curvature * step_size**2,
        closed_loop=closed_loop,
        skip=skip,
        contact_tolerance=float(contact_tolerance),
        tolerance=np.array([choice.tolerance for choice in chosen]),
        exact=np.array([choice.polish for choice in chosen]) | native,
        native=native,
    )


def work_arrays(system: System) -> tuple[Work, Islands, Program]:
    """Return what the steps of a system need to work in."""
    dof, bodies, dimension = system.mass.size, system.component.size, system.dimension
    rows, held = system.unilateral.kind.size, system.bilateral.kind.size
    shapes: dict[str, tuple[tuple[int, ...], type]] = {
        "normals": ((rows, dimension), float),
        "normals_moved": ((rows, dimension), float),
        "gradients": ((system.other_unilateral, dof), float),
        "gradients_moved": ((system.other_unilateral, dof), float),
        "held_normals": ((held, dimension), float),
        "held_normals_moved": ((held, dimension), float),
        "held_gradients": ((system.other_bilateral, dof), float),
        "held_gradients_moved": ((system.other_bilateral, dof), float),
        "mismatch": ((held,), float),
        "report": ((8,), float),
        "ticks": ((2,), np.int64),
    }
    for name in ("gaps", "gaps_moved", "approach", "still", "pressed", "scaled", "best_pressed", "best_scaled"):
        shapes[name] = ((rows,), float)
    for name in ("touching", "active", "landing", "resting"):
        shapes[name] = ((rows,), np.bool_)
    for name in ("marked", "chosen", "smooth", "pressing"):
        shapes[name] = ((rows,), np.int64)
    arrays: dict[str, np.ndarray] = {name: np.zeros(*shapes.get(name, ((dof,), float))) for name in Work._fields}
    all_rows = rows + held
    entries = 2 * dimension * all_rows + (system.other_unilateral + system.other_bilateral) * dof
    curved = dof if system.curved and dof <= _LARGEST_HESSIAN else 0
    if curved:
        entries = all_rows * dof
    program = Program(
        start=np.zeros(all_rows + 1, dtype=np.int64),
        column=np.zeros(entries, dtype=np.int64),
        value=np.zeros(entries),
        bounds=np.zeros(all_rows),
        lengths=np.ones(2 * all_rows),
        wish=np.zeros(dof),
        z=np.zeros(dof),
        y=np.zeros(all_rows),
        metric=np.zeros((curved, curved)),
        factor=np.zeros((curved, curved)),
        white_start=np.zeros(all_rows + 1 if curved else 0, dtype=np.int64),
        white_column=np.zeros(all_rows * curved, dtype=np.int64),
        white_value=np.zeros(all_rows * curved),
        report=np.zeros(4),
    )
    by_body = [np.zeros(bodies, dtype=np.int64) for _ in range(3)]
    islands = Islands(
        *by_body,
        np.zeros(bodies + 2, dtype=np.int64),
        np.zeros(bodies, dtype=np.int64),
        np.zeros(bodies + 2, dtype=np.int64),
        np.zeros(rows, dtype=np.int64),
        np.zeros(bodies + 2, dtype=np.int64),
        np.zeros(held, dtype=np.int64),
    )
    return Work(**arrays), islands, program


def mail_arrays(system: System) -> Mail:
    """Return what functions that are not compiled read and write."""
    dof = system.mass.size
    curved = dof if system.curved and dof <= _LARGEST_HESSIAN else 0
    return Mail(
        at=np.zeros(dof),
        energy=np.zeros(1),
        gradient=np.zeros(dof),
        hessian=np.zeros((curved, curved)),
        unilateral=np.zeros(system.other_unilateral),
        bilateral=np.zeros(system.other_bilateral),
        unilateral_gradients=np.zeros((system.other_unilateral, dof)),
        bilateral_gradients=np.zeros((system.other_bilateral, dof)),
    )


@cache
def clock_address() -> int:
    """Address of the C library's ``clock_gettime``; 0 where there is none, and then compiled solves go untimed."""
    try:
        function = ctypes.CDLL(None).clock_gettime
    except (AttributeError, OSError, TypeError):
        return 0
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def _plain(array: np.ndarray) -> np.ndarray:
    return np.array(array, dtype=float)


def _curvature(scene: Scene) -> tuple[bool, bool]:
    """Whether the potential has a hessian other than zero, and whether that hessian is known."""
    potential = scene.potential
    terms = potential.table
    if not potential.others:
        return bool(terms.kind.size or terms.body.size), True
    hessian = potential.hessian(scene.position)
    if hessian is None:
        return True, False
    return not potential.constant_hessian or bool(hessian.any()), True


def _sizes(scene: Scene, stack: object, rows: Rows) -> np.ndarray:
    """Norms of the gradients at the start, 1 where one is zero."""
    sizes = np.ones(rows.kind.size)
    planes = rows.kind == PLANE
    sizes[planes] = np.linalg.norm(rows.vector[planes], axis=1)
    number = 0
    for family in stack.others:  # type: ignore[attr-defined]
        norms = np.linalg.norm(family.jacobian(scene.position), axis=1)
        places = np.flatnonzero(rows.kind == OTHER)[number : number + family.rows]
        sizes[places] = norms
        number += family.rows
    sizes[sizes == 0.0] = 1.0
    return sizes


def components(bodies: int, held: Rows) -> np.ndarray:
    """Lowest body of each set of bodies that bilateral rows join."""
    joined = held.second >= 0
    if not joined.any():
        return np.arange(bodies, dtype=np.int64)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = held.first[joined], held.second[joined]
    graph = coo_array((np.ones(first.size), (first, second)), shape=(bodies, bodies))
    _, labels = connected_components(graph, directed=False)
    lowest = np.full(labels.max(initial=0) + 1, bodies, dtype=np.int64)
    np.minimum.at(lowest, labels, np.arange(bodies))
    return lowest[labels]
