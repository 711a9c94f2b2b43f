"""A scene and a method in the numbers and arrays that kernels read."""

import numpy as np

from deli.errors import InputError
from deli.integrators.recipe import Recipe
from deli.kernels.system import Method, System
from deli.mechanics.constraints import ConstraintStack
from deli.mechanics.scene import Scene
from deli.mechanics.shadow import shadow_weights
from deli.mechanics.tables import OTHER, PLANE, Rows
from deli.subproblems.choices import NATIVE, SUBPROBLEMS, SolverChoice
from deli.subproblems.reflection import SELECTIONS

_FARTHEST = 0.5  # largest reach, in units of a pair's distance: a longer list costs more than another search
_STEPS = 12  # steps that the fastest bodies take before neighbours are searched again
_LARGEST_NEWTON = 300  # degrees of freedom beyond which a dense factor costs more than the iterations it saves


def bind_system(scene: Scene, implicit: bool) -> System:
    """Return the scene's arrays, without the rows that are found by search.

    `implicit` says whether the force of the position update depends on x.
    """
    potential, unilateral, bilateral = scene.potential, scene.unilateral, scene.bilateral
    free, held = unilateral.table, bilateral.table
    other_unilateral = sum(family.rows for family in unilateral.others)
    other_bilateral = sum(family.rows for family in bilateral.others)
    curved, known = _curvature(scene)
    constant = not (implicit and curved)
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
        newton=not constant and known and scene.dof <= _LARGEST_NEWTON,
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
    """Return the system with the neighbours that bodies at `position` can meet in the next steps.

    The reach of the search is `factor` times the usual one.
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
    recipe: Recipe, step_size: float, choices: dict[str, SolverChoice], skip: bool, contact_tolerance: float
) -> Method:
    """Return a method with the choices for its subproblems.

    Raises
    ------
    InputError
        For a contact tolerance out of range.
    """
    if not 0 < contact_tolerance < 1:
        raise InputError(f"contact_tolerance is {contact_tolerance!r}; allowed: 0 < contact_tolerance < 1.")
    chosen = [choices[name] for name in SUBPROBLEMS]
    native = np.array([choice.backend in NATIVE and skip for choice in chosen])
    start, middle, end = recipe.weights
    later_start, later_middle, later_end = recipe.later
    scheme = recipe.numerical
    return Method(
        start=start,
        middle=middle,
        end=end,
        later_start=later_start,
        later_middle=later_middle,
        later_end=later_end,
        gain=recipe.gain,
        share=recipe.share,
        place=recipe.place,
        rows=recipe.rows,
        recurrence=np.array(recipe.recurrence, dtype=float).reshape(-1, 3),
        restitution=recipe.restitution,
        stiffness=recipe.share * (0.5 * middle + end),
        implicit=middle != 0.0 or end != 0.0,
        reflects=recipe.reflects,
        operator=SELECTIONS.index((recipe.operator, recipe.order)),
        numerical=scheme is not None,
        curvature=2.0 * scheme.numerical_curvature * step_size**2 if scheme else 0.0,
        pull=scheme.numerical_force * step_size**2 if scheme else 0.0,
        shadow=shadow_weights(recipe.shadow),
        order=recipe.event_order,
        discrete=recipe.discrete,
        closed_loop=recipe.closed_loop,
        skip=skip,
        contact_tolerance=float(contact_tolerance),
        tolerance=np.array([choice.tolerance for choice in chosen]),
        exact=np.array([choice.polish for choice in chosen]) | native,
        native=native,
    )


def components(bodies: int, held: Rows) -> np.ndarray:
    """Return, for each body, the lowest of the bodies that bilateral rows join to it."""
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


def _curvature(scene: Scene) -> tuple[bool, bool]:
    """Return whether the potential has a hessian other than zero, and whether that hessian is known."""
    potential = scene.potential
    terms = potential.table
    if not potential.others:
        return bool(terms.kind.size or terms.body.size), True
    hessian = potential.hessian(scene.position)
    if hessian is None:
        return True, False
    return not potential.constant_hessian or bool(hessian.any()), True


def _sizes(scene: Scene, stack: ConstraintStack, rows: Rows) -> np.ndarray:
    """Return the norms of the gradients at the start, with 1 in place of 0."""
    sizes = np.ones(rows.kind.size)
    planes = rows.kind == PLANE
    sizes[planes] = np.linalg.norm(rows.vector[planes], axis=1)
    number = 0
    for family in stack.others:
        norms = np.linalg.norm(family.jacobian(scene.position), axis=1)
        places = np.flatnonzero(rows.kind == OTHER)[number : number + family.rows]
        sizes[places] = norms
        number += family.rows
    sizes[sizes == 0.0] = 1.0
    return sizes


def _plain(array: np.ndarray) -> np.ndarray:
    return np.array(array, dtype=float)
