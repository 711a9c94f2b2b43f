"""Configs: from TOML to a checked plan.

A config names registered scenes, methods and backends only; nothing in it is evaluated, imported or unpickled.
"""

import functools
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from deli import scenes
from deli.config.models import config_model, method_model, say, scene_model, unknown
from deli.config.overrides import apply_overrides, expand
from deli.config.reading import read_toml, refuse_unusable
from deli.errors import InputError
from deli.integrators.registry import METHODS
from deli.mechanics.scene import Scene
from deli.recording.provenance import MADE_IN_PYTHON
from deli.running.plan import Plan, make_plan

LENGTHS = ("steps", "duration")

__all__ = ["Config", "load", "parse"]


@dataclass(frozen=True)
class Config:
    """A checked config with the scene's own defaults filled in.

    Attributes
    ----------
    table : dict
        The arguments of `deli.simulate`, with the keys of a config file.
    """

    table: dict[str, Any]

    @property
    def output(self) -> str | None:
        """The file named by ``record.output``."""
        output: str | None = self.table["record"].get("output")
        return output

    def plan(self, output: str | Path | None = None, *, resume: bool = False, overwrite: bool = False) -> Plan:
        """Build the scene and the method, and check that the run is possible.

        The run is recorded to `output`, also if the config names another file.

        Raises
        ------
        InputError
            If the scene or the method refuses its parameters, or `deli.simulate` its arguments.
        """
        settings = dict(self.table)
        scene, method, record = (dict(settings.pop(name)) for name in ("scene", "method", "record"))
        return make_plan(
            _scene(json.dumps(scene)),
            _build("method", METHODS[method.pop("name")], method),
            output=output,
            every=record["every"],
            subproblems=record["subproblems"],
            resume=resume,
            overwrite=overwrite,
            **settings,
        )


def load(path: str | Path, overrides: Iterable[str] = ()) -> Config:
    """Read a config from a TOML file, and apply `overrides` of the form ``key.path=value``.

    Raises
    ------
    InputError
        If the file cannot be read or is not TOML, or `parse` refuses its table.
    """
    _, table = read_toml(Path(path))
    try:
        return parse(table, overrides)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def parse(table: Mapping[str, Any], overrides: Iterable[str] = ()) -> Config:
    """Check a config's table.

    The scene's own defaults replace a missing step_size, a missing length (steps or duration) and a missing scheme of
    the method; the default method is ``gvi``.

    Raises
    ------
    InputError
        For an unknown key, scene, method or backend, a wrong type, or a value out of range, with the key's path, the
        value found and the values allowed.

    Examples
    --------
    >>> from deli.config import parse
    >>> parse({"scene": "point_mass"}, ["step_size=0.02"]).table["step_size"]
    0.02
    """
    refuse_unusable(table)
    filled = apply_overrides(expand(table), overrides)
    scene = _named(filled, "scene", scenes.available(), MADE_IN_PYTHON)
    if isinstance(filled.setdefault("method", {}), dict):
        filled["method"].setdefault("name", "gvi")
    method = _named(filled, "method", METHODS)
    defaults = scenes.defaults(scene)
    of_scene, of_method = scene_model(scenes.get(scene)), method_model(METHODS[method])
    model = config_model(of_scene, of_method)
    filled.setdefault("step_size", defaults["step_size"])
    if not set(LENGTHS) & set(filled):
        filled["duration"] = defaults["duration"]
    if "scheme" in of_method.model_fields:
        filled["method"].setdefault("scheme", defaults["scheme"])
    try:
        checked = model.model_validate(filled)
    except ValidationError as error:
        raise InputError("; ".join(say(found, model) for found in error.errors())) from error
    if len(set(LENGTHS) & set(filled)) == 2:
        raise InputError(f"steps is {filled['steps']} and duration is {filled['duration']}; give one of them.")
    table = checked.model_dump(exclude_none=True)
    return Config({**table, "scene": filled["scene"], "solvers": _inherited(filled.get("solvers", {}))})


def _inherited(solvers: dict[str, Any]) -> dict[str, Any]:
    """Complete choices of single subproblems without a backend with entries of the default choice."""
    default = solvers.setdefault("default", {"backend": "auto"})
    return {name: choice if "backend" in choice else {**default, **choice} for name, choice in solvers.items()}


def _named(
    table: dict[str, Any], key: str, allowed: Collection[str], recorded: Mapping[str, str] = MappingProxyType({})
) -> str:
    """Return an entry's name; `recorded` holds names in records of runs that cannot run again, with the reasons."""
    entry = table.get(key)
    if not isinstance(entry, dict):
        found = "is missing" if entry is None else f"is {entry!r}"
        raise InputError(f"{key} {found}; expected a table [{key}] with a name, one of: {', '.join(allowed)}.")
    name = entry.get("name")
    if isinstance(name, str) and name in recorded:
        raise InputError(f"{key}.name is {name!r}, and such a recorded run does not run again: {recorded[name]}.")
    if not isinstance(name, str) or name not in allowed:
        raise InputError(unknown(f"{key}.name", name, allowed))
    return str(name)


@functools.lru_cache(maxsize=8)
def _scene(text: str) -> Scene:
    """Build a scene once for all configs that share it, because scenes are immutable."""
    settings = json.loads(text)
    scene: Scene = _build("scene", scenes.get(settings.pop("name")), settings)
    return scene


def _build(key: str, builder: Any, settings: dict[str, Any]) -> Any:
    try:
        return builder(**settings)
    except InputError as error:
        raise InputError(f"{key}: {error}") from error
