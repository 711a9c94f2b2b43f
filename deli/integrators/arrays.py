"""The working arrays of the steps of a system, made once and kept while they have the right size."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from deli.kernels.machine import Mail
from deli.kernels.native import LARGEST
from deli.kernels.program import Program
from deli.kernels.system import System
from deli.kernels.work import Islands, Work

_APART = 128  # bytes around a stepper's arrays, so that no other thread writes to the same cache line


def work_arrays(
    system: System, numerical: bool, memory: int, known: tuple[Work, Islands, Program] | None = None
) -> tuple[Work, Islands, Program]:
    """Return the working arrays of a system's steps; arrays of `known` that have the right size are kept.

    `memory` is the number of arrays that the method carries from step to step besides q and p.
    """
    dof, bodies, dimension = system.mass.size, system.component.size, system.dimension
    rows, held = system.unilateral.kind.size, system.bilateral.kind.size
    values = ("gaps", "gaps_moved", "level", "base", "approach", "still")
    pressures = ("pressed", "scaled", "best_pressed", "best_scaled")
    flags = _each(("touching", "active", "landing", "resting"), rows)
    lists = _each(("marked", "chosen", "smooth", "pressing"), rows) | {"ticks": (2,), "meeting": (3,), "struck": (1,)}
    shapes: dict[str, tuple[int, ...]] = {
        **_each(Work._fields, dof),
        **_each((*values, *pressures), rows),
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
    independent = min(every, dof, LARGEST)
    shapes |= _each(("begins", "right"), independent) | {"gram": (independent * (independent + 1) // 2,)}
    shapes |= {"factored": (1,), "pull": (dof,)}
    kinds = dict.fromkeys(("start", "column", "white_start", "white_column", "begins", "factored"), np.int64)
    program = Program(**_arrays(shapes, kinds, known and known[2]))

    shapes = _each(("body_start", "row_start", "held_start", "joint_start"), bodies + 2)
    shapes |= _each(("parent", "label", "place", "bodies"), bodies) | {"touched": (bodies + 1,)}
    shapes |= {"rows": (rows,), "held": (held,), "joints": (2 * rows,)}
    islands = Islands(**_arrays(shapes, dict.fromkeys(Islands._fields, np.int64), known and known[1]))
    if known is None:
        islands.label[:] = -1
    return work, islands, program


def mail_arrays(system: System, numerical: bool) -> Mail:
    """Return the arrays that functions outside compiled code read and write."""
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


def _metric_size(system: System, numerical: bool) -> int:
    """Return the order of the dense metrics that a step needs."""
    return system.mass.size if system.newton or (numerical and system.curved) else 0


def _each(names: Iterable[str], *shape: int) -> dict[str, tuple[int, ...]]:
    return dict.fromkeys(names, shape)


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
