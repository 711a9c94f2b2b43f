"""Dimensions of a study: the config keys that vary along each, and the labels of its positions."""

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from deli.errors import InputError
from deli.recording.provenance import flatten
from deli.studies.model import AXIS_KEYS, MOST_CASES, StudyTable, ZipTable, check_axis

CASE = "case"
"""The dimension of ``[[cases]]``."""
SHORT_NAMES = {
    "solvers": "solver",
    "solvers.default": "solver",
    "solvers.default.backend": "solver",
    "scene.name": "scene",
    "method": "integrator",
    "method.name": "integrator",
    "solvers.default.tolerance": "solver_tolerance",
}
KEYWORDS = {"method", "tolerance", "drop"}
"""Names that `xarray.Dataset.sel` does not take for dimensions."""
RESERVED = {"state", "outcome", "note", "file", "label"}

Label = str | int | float | bool


@dataclass(frozen=True)
class Position:
    """One position along a dimension: its label, and its changes of the base config by dotted key."""

    label: Label
    changes: Mapping[str, Any]


@dataclass(frozen=True)
class Dimension:
    """A dimension of a study's dataset, with the config keys that vary along it."""

    name: str
    keys: tuple[str, ...]
    positions: tuple[Position, ...]

    def matching(self, key: str, wanted: Any) -> set[int]:
        """Return the positions whose label, or value of the config key, is `wanted` or in the list `wanted`."""
        alternatives = wanted if isinstance(wanted, list) else [wanted]
        by_label = [index for index, position in enumerate(self.positions) if position.label in alternatives]
        if key == self.name and by_label:
            return set(by_label)
        found = {
            index
            for index, position in enumerate(self.positions)
            if key in position.changes and (position.changes[key] in alternatives or position.changes[key] == wanted)
        }
        return found | (set(by_label) if key in self.keys else set())


def dimensions_of(table: StudyTable) -> tuple[Dimension, ...]:
    """Return the dimensions: axes in the order of the file, zips, cases.

    Raises
    ------
    InputError
        For an axis without values, lists of unequal length, or labels or names that occur twice.
    """
    dimensions = [_axis(key, value) for key, value in leaves(table.axes)]
    dimensions += [_zip(index, entry) for index, entry in enumerate(table.zip)]
    if table.cases:
        dimensions.append(_cases(table.cases))
    if not dimensions:
        raise InputError("the study varies nothing; give [axes], [[zip]] or [[cases]].")
    _refuse_too_many(dimensions)
    names = [dimension.name for dimension in dimensions]
    _refuse_twice("dimension", names, "name one of them: { name = ..., values = ... }")
    _refuse_twice("config key", [key for dimension in dimensions for key in dimension.keys], "vary it once")
    for dimension in dimensions:
        _refuse_reserved(dimension.name)
        labels = [position.label for position in dimension.positions]
        _refuse_twice(f"label of {dimension.name}", labels, 'tell them apart by { label = "...", ... }')
    return tuple(dimensions)


def leaves(table: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Yield the axes by dotted key, with or without quotes about the dots in the file."""
    for key, value in table.items():
        if isinstance(value, Mapping) and not AXIS_KEYS & set(value):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def derived_name(key: str) -> str:
    """Return the name of the dimension along which a config key varies."""
    parts = key.split(".")
    if key in SHORT_NAMES:
        return SHORT_NAMES[key]
    if parts[0] == "solvers" and len(parts) == 2:
        return f"{parts[1]}_solver"
    return "_".join(parts[-2:]) if parts[-1] in KEYWORDS else parts[-1]


def derived_label(value: Any) -> str:
    """Return words for a value: strings of a table as they are, its other entries with their keys."""
    if isinstance(value, Mapping):
        entries = flatten(value).items()
        return ", ".join(entry if isinstance(entry, str) else f"{key} = {_word(entry)}" for key, entry in entries)
    return _word(value)


def _word(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _axis(key: str, found: Any) -> Dimension:
    table = check_axis(key, found)
    named = [_named(entry) for entry in table.entries]
    labels = _labels([value for value, _ in named], [label for _, label in named])
    positions = tuple(Position(label, {key: value}) for (value, _), label in zip(named, labels, strict=True))
    return Dimension(table.name or derived_name(key), (key,), positions)


def _zip(index: int, table: ZipTable) -> Dimension:
    columns = dict(leaves(table.values))
    for key, values in columns.items():
        if not isinstance(values, list) or not values:
            raise InputError(f"zip.{index}.values.{key} is {values!r}; allowed: a list of values.")
    lengths = {f"values.{key}": len(values) for key, values in columns.items()}
    if table.labels is not None:
        lengths["labels"] = len(table.labels)
    if not columns or len(set(lengths.values())) != 1:
        found = ", ".join(f"{key} has {length}" for key, length in lengths.items()) or "values is empty"
        raise InputError(f"zip.{index} ({table.name}): {found}; allowed: lists of one length.")
    rows = list(zip(*columns.values(), strict=True))
    labels = table.labels or [", ".join(derived_label(value) for value in row) for row in rows]
    positions = [Position(label, dict(zip(columns, row, strict=True))) for label, row in zip(labels, rows, strict=True)]
    return Dimension(table.name, tuple(columns), tuple(positions))


def _cases(tables: Sequence[Mapping[str, Any]]) -> Dimension:
    positions: list[Position] = []
    for table in tables:
        changes = {key: value for key, value in table.items() if key != "label"}
        label = table.get("label", derived_label(changes) or "base")
        if not isinstance(label, str):
            raise InputError(f"cases.{len(positions)}.label is {label!r}; allowed: a string.")
        positions.append(Position(label, changes))
    return Dimension(CASE, (), tuple(positions))


def _named(entry: Any) -> tuple[Any, str | None]:
    """Split a value with a label, ``{label = "...", value = ...}`` or a table with a label among its keys."""
    if not isinstance(entry, Mapping) or "label" not in entry:
        return entry, None
    rest = {key: value for key, value in entry.items() if key != "label"}
    return (rest["value"] if set(rest) == {"value"} else rest), str(entry["label"])


def _labels(values: Sequence[Any], given: Sequence[str | None]) -> Sequence[Label]:
    """Return the labels of an axis: the values themselves if all are numbers or all truth values, else words."""
    plain = not any(label is not None for label in given)
    if plain and (all(isinstance(value, bool) for value in values) or all(map(_is_number, values))):
        return values
    return [derived_label(value) if label is None else label for value, label in zip(values, given, strict=True)]


def _is_number(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def _refuse_too_many(dimensions: Sequence[Dimension]) -> None:
    lengths = [len(dimension.positions) for dimension in dimensions]
    combinations = math.prod(lengths)
    if combinations > MOST_CASES:
        factors = ", ".join(
            f"{dimension.name} {length:,}" for dimension, length in zip(dimensions, lengths, strict=True)
        )
        raise InputError(
            f"the study has {combinations:,} combinations ({factors}); allowed: {MOST_CASES:,}; vary less at a time."
        )


def _refuse_twice(what: str, found: Sequence[Any], remedy: str) -> None:
    seen = set()
    for entry in found:
        if entry in seen:
            raise InputError(f"{what} {entry!r} occurs twice; {remedy}.")
        seen.add(entry)


def _refuse_reserved(name: str) -> None:
    from deli.metrics import METRICS

    if name in RESERVED or name in METRICS or name in KEYWORDS:
        owner = "an argument of xarray's sel" if name in KEYWORDS else "a variable of the study's dataset"
        raise InputError(
            f"dimension {name!r} has the name of {owner}; give it another: {{ name = ..., values = ... }}."
        )
