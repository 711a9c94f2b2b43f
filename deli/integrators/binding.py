"""A scene bound to a method: the arrays that kernels read, and those they work in."""

import ctypes
import math
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import numpy as np

from deli.errors import InputError
from deli.kernels.codes import FROZEN
from deli.kernels.machine import Mail
from deli.kernels.program import Program
from deli.kernels.system import Method, System
from deli.kernels.work import Islands, Work
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import Scheme
from deli.mechanics.tables import OTHER, PLANE, Rows
from deli.subproblems.choices import SUBPROBLEMS, SolverChoice
from deli.subproblems.reflection import SELECTIONS

NATIVE = ("native", "auto")
_APART = 128  # bytes around what a stepper writes to, which processors keep from others that write nearby
_FARTHEST = 0.5  # of a pair's distance: gaps searched beyond it cost more than searching again
_STEPS = 12  # steps that the fastest bodies take before neighbours are searched again
_NONE = np.zeros((0, 0))
_LARGEST_NEWTON = 300  # degrees of freedom beyond which a dense factor costs more than the iterations it saves


def bind_system(scene: Scene, implicit: bool) -> System:
    """Return the scene's arrays; where rows are searched, none of those are there yet.

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
    step_size: float,
    choices: dict[str, SolverChoice],
    skip: bool,
    contact_tolerance: float,
    *,
    weights: tuple[float, float, float],
    later: tuple[float, float, float] = (0.0, 0.0, 0.0),
    gain: float = 0.0,
    share: float = 1.0,
    place: float = 1.0,
    rows: int = FROZEN,
    recurrence: np.ndarray = _NONE,
    restitution: float = 0.0,
    reflects: bool = False,
    operator: str = "generalized",
    order: str = "index",
    numerical: Scheme | None = None,
    closed_loop: bool = False,
    event_order: int = 0,
    discrete: bool = False,
) -> Method:
    """Return a method in the form that kernels read; see `deli.kernels.system.Method` for what its numbers mean.

    `weights` and `later` are start, middle and end of the force; `numerical` is the scheme whose numerical Hamiltonian
    reflections conserve, if it is one's.
    """
    if (operator, order) not in SELECTIONS:
        allowed = ", ".join(" in order ".join(map(repr, pair)) for pair in SELECTIONS)
        raise InputError(f"there is no reflection operator {operator!r} in order {order!r}; allowed: {allowed}.")
    if not 0 < contact_tolerance < 1:
        raise InputError(f"contact_tolerance is {contact_tolerance!r}; allowed: 0 < contact_tolerance < 1.")
    chosen = [choices[name] for name in SUBPROBLEMS]
    native = np.array([choice.backend in NATIVE and skip for choice in chosen])
    start, middle, end = weights
    return Method(
        start=start,
        middle=middle,
        end=end,
        later_start=later[0],
        later_middle=later[1],
        later_end=later[2],
        gain=gain,
        share=share,
        place=place,
        rows=rows,
        recurrence=recurrence,
        restitution=restitution,
        stiffness=share * (0.5 * middle + end),
        implicit=middle != 0.0 or end != 0.0,
        reflects=reflects,
        operator=SELECTIONS.index((operator, order)),
        numerical=numerical is not None,
        curvature=2.0 * numerical.numerical_curvature * step_size**2 if numerical else 0.0,
        order=event_order,
        discrete=discrete,
        closed_loop=closed_loop,
        skip=skip,
        contact_tolerance=float(contact_tolerance),
        tolerance=np.array([choice.tolerance for choice in chosen]),
        exact=np.array([choice.polish for choice in chosen]) | native,
        native=native,
    )


def work_arrays(
    system: System, numerical: bool, memory: int, known: tuple[Work, Islands, Program] | None = None
) -> tuple[Work, Islands, Program]:
    """Return what the steps of a system work in; arrays of `known` that have the right size are kept.

    `memory` counts what the method carries from step to step besides q and p.
    """
    dof, bodies, dimension = system.mass.size, system.component.size, system.dimension
    rows, held = system.unilateral.kind.size, system.bilateral.kind.size
    values = ("gaps", "gaps_moved", "base", "approach", "still", "pressed", "scaled", "best_pressed", "best_scaled")
    flags = _each(("touching", "active", "landing", "resting"), rows)
    lists = _each(("marked", "chosen", "smooth", "pressing"), rows) | {"ticks": (2,), "meeting": (3,)}
    shapes: dict[str, tuple[int, ...]] = {
        **_each(Work._fields, dof),
        **_each(values, rows),
        **flags,
        **lists,
        **_each(("normals", "normals_moved"), rows, dimension),
        **_each(("gradients", "gradients_moved"), system.other_unilateral, dof),
        **_each(("held_normals", "held_normals_moved"), held, dimension),
        **_each(("held_gradients", "held_gradients_moved"), system.other_bilateral, dof),
        **_each(("memory", "remembered"), memory, dof),
        "span": (1,),
        "balance": (3,),
        "mismatch": (held,),
        "held_base": (held,),
        "report": (8,),
    }
    kinds = dict.fromkeys(flags, np.bool_) | dict.fromkeys(lists, np.int64)
    work = Work(**_arrays(shapes, kinds, known and known[0]))

    every = rows + held
    metric = _metric_size(system, numerical)
    others = system.other_unilateral + system.other_bilateral
    entries = every * metric if metric else 2 * dimension * every + others * dof
    shapes = _each(("bounds", "y"), every) | _each(("wish", "z"), dof)
    shapes |= {
        "start": (every + 1,),
        "column": (entries,),
        "value": (entries,),
        "lengths": (2 * every,),
        "report": (4,),
    }
    shapes |= _each(("metric", "factor"), metric, metric)
    shapes |= {"white_start": (every + 1,)} | _each(("white_column", "white_value"), every * metric)
    kinds = dict.fromkeys(("start", "column", "white_start", "white_column"), np.int64)
    program = Program(**_arrays(shapes, kinds, known and known[2]))

    shapes = _each(("body_start", "row_start", "held_start", "joint_start"), bodies + 2)
    shapes |= _each(("parent", "label", "place", "bodies"), bodies) | {"touched": (bodies + 1,)}
    shapes |= {"rows": (rows,), "held": (held,), "joints": (2 * rows,)}
    islands = Islands(**_arrays(shapes, dict.fromkeys(Islands._fields, np.int64), known and known[1]))
    if known is None:
        islands.label[:] = -1
    return work, islands, program


def _each(names: Iterable[str], *shape: int) -> dict[str, tuple[int, ...]]:
    return dict.fromkeys(names, shape)


def _metric_size(system: System, numerical: bool) -> int:
    """Order of the dense metrics that a step needs."""
    return system.mass.size if system.newton or (numerical and system.curved) else 0


def _arrays(shapes: Mapping[str, tuple[int, ...]], kinds: Mapping[str, Any], known: Any) -> dict[str, np.ndarray]:
    arrays: dict[str, np.ndarray] = {}
    begin, new = _APART, []
    for name, shape in shapes.items():
        kept = getattr(known, name, None)
        if kept is not None and kept.shape == shape:
            arrays[name] = kept
            continue
        kind = np.dtype(kinds.get(name, float))
        size = math.prod(shape) * kind.itemsize
        new.append((name, begin, size, kind, shape))
        begin += size + -size % 8
    memory = np.zeros(begin + _APART, dtype=np.uint8)
    for name, begin, size, kind, shape in new:
        arrays[name] = memory[begin : begin + size].view(kind).reshape(shape)
    return arrays


def mail_arrays(system: System, numerical: bool) -> Mail:
    """Return what functions that are not compiled read and write."""
    dof = system.mass.size
    metric = _metric_size(system, numerical)
    return Mail(
        at=np.zeros(dof),
        energy=np.zeros(1),
        gradient=np.zeros(dof),
        hessian=np.zeros((metric, metric)),
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


@cache
def brentq_address() -> int:
    """Address of SciPy's Brent's method, of its interface for compiled code."""
    from numba.extending import get_cython_function_address

    return int(get_cython_function_address("scipy.optimize.cython_optimize._zeros", "brentq"))


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
