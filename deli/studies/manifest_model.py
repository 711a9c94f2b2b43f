"""The shape of a manifest as pydantic models, which refuse manifests with missing or inconsistent entries."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from deli.errors import InputError
from deli.studies.states import ENDS, RUNNING, WAITING

Label = str | bool | int | float
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]+$")]


def _toml(text: Any) -> Any:
    if isinstance(text, str):
        try:
            tomllib.loads(text)
        except RecursionError as error:
            raise ValueError("it is nested too deeply") from error
    return text


class _Part(BaseModel):
    model_config = ConfigDict(strict=True)


class _Position(_Part):
    label: Label
    changes: dict[str, Any]


class _Dimension(_Part):
    name: str
    keys: list[str]
    positions: list[_Position]


class _Case(_Part):
    labels: dict[str, Label]
    digest: Digest


class _Run(_Part):
    state: Annotated[str, Field(pattern=f"^({'|'.join((WAITING, RUNNING, *ENDS))})$")]
    reason: str
    seconds: float
    steps: int
    outcome: str = ""
    deli_version: str = ""
    backend_versions: str = ""
    machine: str = ""


class _Session(_Part):
    machine: str
    deli_version: str
    workers: int


class _Manifest(_Part):
    title: str
    timed: bool = False
    study: Annotated[str, BeforeValidator(_toml)]
    sessions: list[_Session]
    dimensions: list[_Dimension]
    cases: list[_Case]
    runs: dict[Digest, _Run]
    references: dict[Digest, Digest]

    @model_validator(mode="after")
    def _fits(self) -> "_Manifest":
        allowed = {each.name: {position.label for position in each.positions} for each in self.dimensions}
        for each in self.dimensions:
            for position in each.positions:
                if len(each.keys) > 1 and not set(each.keys) <= set(position.changes):
                    raise ValueError(f"the position {position.label!r} of {each.name} lacks changes")
        for case in self.cases:
            if set(case.labels) != set(allowed) or any(
                label not in allowed[name] for name, label in case.labels.items()
            ):
                raise ValueError(f"the case {case.labels} has no place in the dimensions")
            if case.digest not in self.runs:
                raise ValueError(f"the case {case.labels} has no run")
        return self


def check_manifest(found: Mapping[str, Any], path: Path) -> None:
    """Refuse a manifest that is damaged.

    Raises
    ------
    InputError
        With the damaged entry, and a remedy.
    """
    try:
        _Manifest.model_validate(found)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the whole"
        raise InputError(
            f"{path} is damaged: {place:.200}: {first['msg']:.300}. Move it away; deli study then makes a new one from "
            "the recorded runs."
        ) from error
