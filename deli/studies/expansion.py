"""Expansion of a study file to its cases: every admissible combination, with a complete config and its digest."""

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deli import config
from deli.config.models import unknown
from deli.config.overrides import assign, expand
from deli.config.reading import read_toml, refuse_unusable
from deli.errors import InputError
from deli.studies.axes import Dimension, Label, dimensions_of, leaves
from deli.studies.exact import require_exact
from deli.studies.model import LimitsTable, StudyTable, check_table

DIGITS = 16
QUICK = "quick"


@dataclass(frozen=True)
class Case:
    """One run of a study.

    Attributes
    ----------
    labels : dict
        Labels of the case by dimension; empty for a reference.
    config : dict
        The config of the run with every default spelled out.
    digest : str
        Name of the case, computed from its config.
    """

    labels: Mapping[str, Label]
    config: Mapping[str, Any]
    digest: str

    @property
    def steps(self) -> int:
        """Number of integration steps."""
        return int(self.config["steps"])

    @property
    def title(self) -> str:
        """Labels of the case in words."""
        return title_of(self.labels) if self.labels else f"reference {self.digest}"


@dataclass(frozen=True)
class Study:
    """A checked study.

    Attributes
    ----------
    title, text : str
        Title, and the text of the file.
    dimensions : tuple of Dimension
    cases : tuple of Case
        All cases except the excluded ones, in the order of the product.
    references : dict
        Reference of a case by the digest of the case.
    exact : bool
        Whether cases are compared with the scene's closed form.
    limits : LimitsTable
    workers : int or None
    timed : bool
        Whether the steps of its cases are timed.
    """

    title: str
    text: str
    dimensions: tuple[Dimension, ...]
    cases: tuple[Case, ...]
    references: Mapping[str, Case]
    exact: bool
    limits: LimitsTable
    workers: int | None
    timed: bool = False

    @property
    def runs(self) -> dict[str, Case]:
        """All runs by digest, references first because other cases are compared with them."""
        ordered = [*self.references.values(), *self.cases]
        named = {case.digest: case for case in self.cases}
        return {case.digest: named.get(case.digest, case) for case in ordered}


def title_of(labels: Mapping[str, Label]) -> str:
    """Return the labels of a case in words."""
    return ", ".join(f"{name} = {label}" for name, label in labels.items())


def load(path: Path, quick: bool = False) -> Study:
    """Read a study file; with `quick`, entries of its table ``[quick]`` replace those of the file.

    Raises
    ------
    InputError
        If the file cannot be read or is not TOML, if a key or a value is not allowed, or if `deli.config.parse` or
        `deli.simulate` refuses the config of a case. Nothing has been computed then.
    """
    text, found = read_toml(path)
    try:
        shorter = found.pop(QUICK, None)
        if quick and not isinstance(shorter, Mapping):
            raise InputError(f"it has no table [{QUICK}] and so no quick form.")
        return make_study(_merged(found, shorter) if quick else found, path.parent, text, path.stem)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def outline(path: Path) -> tuple[str, int]:
    """Return the title of a study file and the number of its cases, of which none is made.

    Raises
    ------
    InputError
        If it cannot be read or is not TOML, and for what a study file may not say.
    """
    _, found = read_toml(path)
    found.pop(QUICK, None)
    try:
        table = check_table(found)
        return table.title or path.stem, sum(1 for _ in _combinations(dimensions_of(table), table))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _merged(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table with changes: tables are merged, all other values are replaced."""
    merged = dict(table)
    for key, value in changes.items():
        known = merged.get(key)
        both = isinstance(known, Mapping) and isinstance(value, Mapping)
        merged[key] = _merged(known or {}, value) if both else value
    return merged


def make_study(found: Mapping[str, Any], folder: Path, text: str = "", name: str = "study") -> Study:
    """Check a study's table and make its cases; the path of `base` is relative to `folder`.

    Raises
    ------
    InputError
        See `load`.
    """
    table = check_table(found)
    base, dimensions = _base(table.base, folder), dimensions_of(table)
    change = dict(table.reference or {})
    exact = change.pop("exact", False)
    if not isinstance(exact, bool) or (exact and change):
        raise InputError(f"reference is {table.reference!r}; allowed: exact = true, or changes of the config.")
    cases, references = [], {}
    for labels, changes in _combinations(dimensions, table):
        settings = _changed(expand(base), changes, labels)
        case = _case(settings, labels)
        cases.append(case)
        if exact:
            require_exact(case.config["scene"]["name"])
        if change:
            references[case.digest] = _reference(settings, change, case)
    if not cases:
        raise InputError("exclude leaves no case.")
    return Study(
        title=table.title or name,
        text=text,
        dimensions=dimensions,
        cases=tuple(cases),
        references=references,
        exact=exact,
        limits=table.limits,
        workers=table.workers,
        timed=table.time_steps,
    )


def digest_of(settings: Mapping[str, Any]) -> str:
    """Return a name for a config from its content, in any order of keys; 1 and 1.0 are one number."""
    text = json.dumps(_canonical(settings), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def _canonical(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _canonical(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_canonical(entry) for entry in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _base(found: str | dict[str, Any], folder: Path) -> dict[str, Any]:
    if not isinstance(found, str):
        return expand(found)
    try:
        _, base = read_toml(folder / found)
        refuse_unusable(base)
    except InputError as error:
        raise InputError(f"base: {error}") from error
    return expand(base)


def _combinations(
    dimensions: tuple[Dimension, ...], table: StudyTable
) -> Iterator[tuple[dict[str, Label], dict[str, Any]]]:
    """Yield labels and changes of all combinations except the excluded ones."""
    excluded = [_exclusion(f"exclude.{index}", entry, dimensions) for index, entry in enumerate(table.exclude)]
    for index in itertools.product(*(range(len(dimension.positions)) for dimension in dimensions)):
        if any(all(index[axis] in places for axis, places in rule.items()) for rule in excluded):
            continue
        chosen = [dimension.positions[place] for dimension, place in zip(dimensions, index, strict=True)]
        labels = {dimension.name: position.label for dimension, position in zip(dimensions, chosen, strict=True)}
        yield labels, {key: value for position in chosen for key, value in position.changes.items()}


def _changed(settings: dict[str, Any], changes: Mapping[str, Any], labels: Mapping[str, Label]) -> dict[str, Any]:
    try:
        for key in sorted(changes, key=lambda key: key.count(".")):  # whole tables before their keys
            assign(settings, key, changes[key])
    except InputError as error:
        raise InputError(f"{_place(labels)}: {error}") from error
    return settings


def _place(labels: Mapping[str, Label]) -> str:
    return f"case {title_of(labels)}" if labels else "reference"


def _case(settings: Mapping[str, Any], labels: Mapping[str, Label]) -> Case:
    try:
        complete = config.parse(settings).plan().config()
    except InputError as error:
        raise InputError(f"{_place(labels)}: {error}") from error
    return Case(labels, complete, digest_of(complete))


def _reference(settings: Mapping[str, Any], change: Mapping[str, Any], case: Case) -> Case:
    """Return the reference of a case; if it only changes the step size, it lasts as long as the case."""
    length = case.config["steps"] * case.config["step_size"]
    copy = expand(settings)
    if "steps" in copy and "step_size" in change:
        copy["duration"] = copy.pop("steps") * case.config["step_size"]
    reference = _case(_changed(copy, change, {}), {})
    end = reference.config["steps"] * reference.config["step_size"]
    if end < length * (1.0 - 1e-9):
        raise InputError(
            f"reference: it ends at time {end:.9g}, the case {case.title} at {length:.9g}; let it last as long."
        )
    return reference


def _exclusion(path: str, entry: Mapping[str, Any], dimensions: tuple[Dimension, ...]) -> dict[int, set[int]]:
    """Return the positions that an entry of ``[[exclude]]`` matches, by number of the dimension."""
    rule: dict[int, set[int]] = {}
    for key, wanted in leaves(entry):
        owners = [axis for axis, dimension in enumerate(dimensions) if key == dimension.name or key in dimension.keys]
        if not owners:
            allowed = [name for dimension in dimensions for name in (dimension.name, *dimension.keys)]
            raise InputError(unknown(f"{path} key", key, dict.fromkeys(allowed)))
        places = dimensions[owners[0]].matching(key, wanted)
        if not places:
            labels = [str(position.label) for position in dimensions[owners[0]].positions]
            raise InputError(unknown(f"{path}.{key}", wanted, labels))
        rule[owners[0]] = rule.get(owners[0], places) & places
    if not rule:
        raise InputError(f"{path} is empty and would exclude everything; name an axis.")
    return rule
