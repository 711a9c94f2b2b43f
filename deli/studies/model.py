"""The shape of a study file as pydantic models."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, ByteSize, Field, TypeAdapter, ValidationError, model_validator
from pydantic_core import PydanticCustomError

import solvers
from deli.config.models import Table, say
from deli.config.reading import refuse_unusable
from deli.errors import InputError
from deli.studies.plot_tables import Plot

AXIS_KEYS = {"values", "count"}
MOST_CASES = 20_000
"""The most combinations of a study: each is a run with files of its own, and checking so many takes minutes."""
MOST_WORKERS = 1000
INSTALLED = "installed"
BACKEND_KEYS = {"solvers", "solvers.default", "solvers.default.backend"}
Name = Annotated[str, Field(pattern=r"^[A-Za-z_]\w*$")]


class AxisTable(Table):
    """Values of one config key, or ``count = n`` for 0, 1, ... n - 1 (seeds), and a name for the dimension."""

    values: Annotated[list[Any], Field(min_length=1)] | None = None
    count: int | None = Field(default=None, ge=1, le=MOST_CASES)
    name: Name | None = None

    @model_validator(mode="after")
    def _one_of_them(self) -> "AxisTable":
        if (self.values is None) == (self.count is None):
            raise PydanticCustomError("axis", "give exactly one of values = [...] and count = n")
        return self

    @property
    def entries(self) -> list[Any]:
        """Values along the axis."""
        return list(range(self.count)) if self.count is not None else list(self.values or ())


class ZipTable(Table):
    """Config keys that vary together along one dimension: lists of one length, and a label for each position."""

    name: Name
    values: dict[str, Any]
    labels: list[str] | None = None


def _memory(value: Any) -> Any:
    if value is None or isinstance(value, bool):
        raise PydanticCustomError("memory", 'allowed: a size such as "2 GB" or "500 MiB", or a number of bytes')
    try:
        size = int(TypeAdapter(ByteSize).validate_python(value))
    except ValidationError:
        size = 0
    if size < 1:
        raise PydanticCustomError("memory", 'allowed: a size such as "2 GB" or "500 MiB", or a number of bytes')
    return size


class LimitsTable(Table):
    """Limits of one case: seconds, and memory of its process, which includes some 300 MB of deli's own."""

    time: float | None = Field(default=None, gt=0)
    memory: Annotated[int, BeforeValidator(_memory)] | None = None


class StudyTable(Table):
    """The content of a study file.

    `base` is a config (a table, or a file's path relative to the study file). The cases are the product of all `axes`,
    of all entries of `zip`, each of which is one dimension, and of `cases`, a list of changes by hand. Cases that match
    an entry of `exclude` are left out. `reference` changes the config of a case into the config of its reference run;
    ``{exact = true}`` compares the case with the closed form of its scene. With `time_steps`, the steps of each case
    are timed by CPU time, without recording: metrics `cpu_time` and `recording_time`. `plots` are the plots of the
    study's report.
    """

    title: str = ""
    base: str | dict[str, Any]
    axes: dict[str, Any] = Field(default_factory=dict)
    zip: list[ZipTable] = Field(default_factory=list)
    cases: list[dict[str, Any]] = Field(default_factory=list)
    exclude: list[dict[str, Any]] = Field(default_factory=list)
    reference: dict[str, Any] | None = None
    limits: LimitsTable = Field(default_factory=LimitsTable)
    workers: int | None = Field(default=None, ge=1, le=MOST_WORKERS)
    time_steps: bool = False
    plots: list[Plot] = Field(default_factory=list)


def check_table(found: Mapping[str, Any]) -> StudyTable:
    """Check a study's table.

    Raises
    ------
    InputError
        With the key's path, the value found and the values allowed.
    """
    refuse_unusable(found)
    try:
        return StudyTable.model_validate(found)
    except ValidationError as error:
        raise InputError("; ".join(say(entry, StudyTable) for entry in error.errors())) from error


def check_axis(key: str, found: Any) -> AxisTable:
    """Check one entry of ``[axes]``: a list of values, a table of its own, or all installed backends.

    Raises
    ------
    InputError
        See `check_table`.
    """
    if found == INSTALLED and key in BACKEND_KEYS:
        found = solvers.available()
    if not isinstance(found, list | Mapping):
        backends = f", or {INSTALLED!r}" if key in BACKEND_KEYS else ""
        allowed = f"a list of values, or a table such as {{ count = 20 }}{backends}"
        raise InputError(f"axes.{key} is {found!r}; allowed: {allowed}.")
    try:
        return AxisTable.model_validate({"values": found} if isinstance(found, list) else found)
    except ValidationError as error:
        entries = [{**entry, "loc": ("axes", key, *entry["loc"])} for entry in error.errors()]
        raise InputError("; ".join(_said(entry) for entry in entries)) from error


def _said(entry: Any) -> str:
    path, message = ".".join(map(str, entry["loc"])), entry["msg"]
    if entry["type"] == "extra_forbidden":
        return f"{path} is an unknown key; allowed: {', '.join(AxisTable.model_fields)}."
    if entry["type"] == "axis":
        return f"{path}: {message}."
    return f"{path} is {entry['input']!r}; allowed: {message.removeprefix('Input should be ')}."
