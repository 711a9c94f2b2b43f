"""Content of a scene: the arrays that decide its motion, by family, and one digest of all of them."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import zip_longest
from typing import Any

import numpy as np

from deli.mechanics.arrays import Array
from deli.mechanics.family import ArrayFamily, Family
from deli.mechanics.parameters import number_array
from deli.mechanics.potentials import PotentialFamily
from deli.mechanics.scene import Scene

READABLE = 64
"""Largest number of entries of an array that is written out; a larger array is replaced by its shape and a digest."""
DISTANCES = (0.0, 1e-6, 1e-3, 1e-1)
"""Distances from the initial state at which functions are sampled, in units of the scene's length scale."""
SAMPLES = "samples"
BITS = 30
"""Leading bits of a sample that count in a digest, because the last bits may differ between processors."""
AGREEMENT = 1e-9
"""Allowed difference of two samples relative to their size, and a thousandth of it relative to the largest sample."""
LONGEST_SHOWN = 60
_NONE: dict[str, Any] = {}
PARAMETERS = "parameters"
SIDES = ("potential", "unilateral", "bilateral")


@functools.lru_cache(maxsize=8)  # a run needs it more than once
def scene_content(scene: Scene) -> dict[str, Any]:
    """Return a scene's parameters and all numbers that determine its motion, in types of TOML and JSON.

    Parameters
    ----------
    scene : deli.Scene

    Returns
    -------
    dict
        ``parameters``, ``dimension``, ``mass``, ``position``, ``momentum``, and by side (``potential``, ``unilateral``,
        ``bilateral``) a list with a table for each family: its ``kind`` and its arrays as they were passed. Arrays of
        more than `READABLE` entries are tables of their ``shape`` and ``sha256``. A family that is not one of deli's
        array families is made of Python functions, which cannot be written down: its table has ``samples`` at
        len(`DISTANCES`) states, which are the same for equal scenes. With directions v and w, the samples of a
        potential are V, v.V' and v.V''v, and those of constraints are w.c and w.Cv; a sample is nan where its function
        is not defined.
    """
    table: dict[str, Any] = {PARAMETERS: written(scene.parameters), "dimension": scene.dimension}
    table |= {name: written(getattr(scene, name)) for name in ("mass", "position", "momentum")}
    return table | {side: [_family(family, scene) for family in getattr(scene, side).families] for side in SIDES}


def scene_digest(scene: Scene) -> str:
    """Return the SHA-256 of a scene's content, 64 hexadecimal digits.

    Scenes of equal masses, initial states and families have the same digest; names and parameters do not count.
    Python functions count by the first `BITS` bits of their samples.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.point_mass()
    >>> run = deli.simulate(scene, deli.GVI(), step_size=0.1, steps=1)
    >>> run.attrs["scene_digest"] == scene_digest(scene)
    True
    """
    table = {key: value for key, value in scene_content(scene).items() if key != PARAMETERS}
    for side in SIDES:
        table[side] = [
            {**family, SAMPLES: {key: _rounded(values) for key, values in family.get(SAMPLES, {}).items()}}
            for family in table[side]
        ]
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()


def sampled(table: Mapping[str, Any]) -> list[str]:
    """Return the names of the families of a content that are made of Python functions."""
    return [
        f"{family['kind']} ({side} {number})"
        for side in SIDES
        for number, family in enumerate(table[side])
        if SAMPLES in family
    ]


def differences(recorded: Mapping[str, Any], content: Mapping[str, Any]) -> list[str]:
    """Return the entries in which two contents differ; samples are compared to `AGREEMENT`, other entries exactly."""
    found = _differing("{}", recorded, content, {*SIDES, PARAMETERS})
    found += _differing("parameter {}", recorded.get(PARAMETERS, {}), content[PARAMETERS])
    for side in SIDES:
        pairs = zip_longest(recorded.get(side, ()), content[side], fillvalue=_NONE)
        for number, (before, now) in enumerate(pairs):
            if before.get("kind") != now.get("kind"):
                found.append(f"{side} {number} {_shown(before.get('kind'), now.get('kind'))}")
                continue
            where = f"{{}} of {now['kind']} ({side} {number})"
            found += _differing(where, before, now, {SAMPLES})
            samples = [_arrays(one.get(SAMPLES, {})) for one in (before, now)]
            found += _differing(f"{where} at {len(DISTANCES)} states", *samples)
    return found


def written(value: Any) -> Any:
    """Return a parameter or an array as numbers and lists, and a large array as a table of its shape and digest."""
    if isinstance(value, Mapping):
        return {key: written(entry) for key, entry in value.items() if entry is not None}
    array = number_array(value)
    if array is None:
        return [written(entry) for entry in value] if isinstance(value, list | tuple) else value
    if array.size <= READABLE:
        return array.tolist()
    plain = np.ascontiguousarray(array, "<f8" if array.dtype.kind == "f" else "<i8")
    return {"shape": list(array.shape), "sha256": hashlib.sha256(plain.data).hexdigest()}


def _family(family: Family, scene: Scene) -> dict[str, Any]:
    table: dict[str, Any] = {"kind": type(family).__name__}
    if dataclasses.is_dataclass(family):
        given = {field.name: getattr(family, field.name) for field in dataclasses.fields(family) if field.init}
        arrays = {name: number_array(value) for name, value in given.items()}
        table |= {name: written(array) for name, array in arrays.items() if array is not None}
    if not isinstance(family, ArrayFamily) or type(family).__module__.partition(".")[0] != "deli":
        compiled = family.terms_table() if isinstance(family, PotentialFamily) else family.rows_table()  # type: ignore[attr-defined]
        table |= {} if compiled is None else {f"table {name}": written(one) for name, one in compiled._asdict().items()}
        table[SAMPLES] = _samples(family, scene)
    return table


def _samples(family: Any, scene: Scene) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {}
    for number, distance in enumerate(DISTANCES):
        random = np.random.default_rng(number)
        x, v = random.uniform(-1.0, 1.0, (2, scene.dof))
        q = scene.position + distance * scene.length_scale * x
        for name, quantity in _quantities(family, q, v, random).items():
            found.setdefault(name, []).append(_number(quantity))
    return {name: values for name, values in found.items() if not np.isnan(values).all()}


def _quantities(family: Any, q: Array, v: Array, random: np.random.Generator) -> dict[str, Callable[[], Any]]:
    if isinstance(family, PotentialFamily):
        return {
            "energy": lambda: family.energy(q),
            "slope": lambda: v @ family.gradient(q),
            "curvature": lambda: family.curvature(q, v),
        }
    w = random.uniform(-1.0, 1.0, family.rows)
    return {"value": lambda: w @ family.value(q), "slope": lambda: w @ family.jacobian(q) @ v}


def _number(quantity: Callable[[], Any]) -> float:
    """Return a quantity, or nan where a user's function raises or there is no hessian."""
    with np.errstate(all="ignore"):
        try:
            value = quantity()
        except Exception:  # the run may never reach this state
            return math.nan
    return math.nan if value is None else float(value)


def _rounded(values: list[float]) -> list[int | str]:
    unit = math.ldexp(1.0, max(math.frexp(_scale(values))[1] - BITS, -1074))
    return [round(value / unit) if math.isfinite(value) else str(value) for value in values]


def _arrays(samples: Mapping[str, Any]) -> dict[str, Array]:
    return {name: np.array(values, dtype=float) for name, values in samples.items()}


def _scale(values: Iterable[float]) -> float:
    return max((abs(value) for value in values if math.isfinite(value)), default=0.0)


def _differing(where: str, before: Mapping[str, Any], now: Mapping[str, Any], leave: Collection[str] = ()) -> list[str]:
    return [
        f"{where.format(name)} {_shown(before.get(name), now.get(name))}"
        for name in [*now, *(name for name in before if name not in now)]
        if name not in leave and not _same(before.get(name), now.get(name))
    ]


def _same(before: Any, now: Any) -> bool:
    if isinstance(before, np.ndarray) and isinstance(now, np.ndarray):
        noise = 1e-3 * AGREEMENT * _scale([*before, *now])
        return before.shape == now.shape and np.allclose(before, now, rtol=AGREEMENT, atol=noise, equal_nan=True)
    return bool(before == now)


def _shown(before: Any, now: Any) -> str:
    large = isinstance(before, dict) and isinstance(now, dict)
    if large and before.get("shape") == now.get("shape"):
        return f"has other numbers, of shape {tuple(now['shape'])}"
    return f"is {_word(before)} there and {_word(now)} now"


def _word(value: Any) -> str:
    if value is None:
        return "absent"
    if isinstance(value, dict) and "shape" in value:
        return f"an array of shape {tuple(value['shape'])}"
    text = str(value.tolist() if isinstance(value, np.ndarray) else value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."
