"""Provenance of a run: its whole configuration, the software, the machine, the times."""

import dataclasses
import functools
import importlib.metadata
import logging
import os
import platform
import re
import tomllib
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from deli import scenes
from deli.errors import InputError
from deli.integrators.registry import METHODS
from deli.mechanics.content import scene_digest
from deli.mechanics.scene import Scene
from deli.recording.schema import AXES, CONVENTIONS, TRAJECTORY, UNDECIDED, UNITS_NOTE
from deli.subproblems.choices import parse_choices
from deli.version import __version__
from solvers.registry import BUILTIN, CHAINS, REFERENCE

if TYPE_CHECKING:
    import xarray as xr

CUSTOM = "custom"
ENSEMBLE = "ensemble"
MADE_IN_PYTHON = {
    CUSTOM: "its scene is the user's own, made in Python, and a config holds no families; run the script that made it",
    ENSEMBLE: "it is of an ensemble of scenes made in Python, and a config holds only one; run the script that made it",
}
"""Names in a run's config of scenes that are not registered, and the reason why such a config does not run again."""
NONE_USED = "none used"
ONLY_WITH: dict[tuple[str, str], tuple[str, str]] = {("gvi", "order"): ("reflection", "sequential")}
"""Settings of methods that have a meaning only with another setting."""
CITATION = (
    f"The developers of deli, deli {__version__}: geometric integration of mechanical systems with contact, with "
    "swappable convex solvers. It implements D. M. Kaufman and D. K. Pai, Geometric numerical integration of "
    "inequality constrained, nonsmooth Hamiltonian systems, SIAM Journal on Scientific Computing 34(5), 2012, "
    "https://doi.org/10.1137/100800105."
)
"""The reference of a run, for a bibliography: that of CITATION.cff."""
SOFTWARE = ("deli_version", "cvxpy_version", "numpy_version", "python_version", "machine")
BETWEEN_SESSIONS = "; "

logger = logging.getLogger("deli")


def describe(scene: Scene, method: Any, **settings: Any) -> dict[str, Any]:
    """Return all settings that decide the numbers of a run, in the form of a config file.

    A scene that its registered name and parameters do not reproduce (a user's own, or one changed afterwards) is
    called ``custom``: its content is in the attribute ``scene``, see `deli.recording.scene_record`.

    Parameters
    ----------
    scene, method
        The scene and the method of the run.
    settings
        Keyword arguments of `deli.simulate` that decide numbers: step_size, steps, every, skip, contact_tolerance,
        solvers, subproblems.
    """
    choices = parse_choices(settings.pop("solvers"))
    record = {"every": settings.pop("every"), "subproblems": settings.pop("subproblems", 0) or None}
    return plain(
        {
            **settings,
            "scene": _describe_scene(scene),
            "method": {"name": method_name(type(method)), **dataclasses.asdict(method)},
            "solvers": {name: dataclasses.asdict(choice) for name, choice in choices.items()},
            "record": record,
        }
    )


def method_name(method: type) -> str:
    """Return the name of a method's class in a config: ``DiscreteSmooth`` is ``discrete_smooth``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", method.__name__).lower()


def scene_of(run: "xr.DataTree") -> Scene | None:
    """Return the scene of a run, or None for a user's own scene, which cannot be rebuilt.

    Raises
    ------
    InputError
        If the recorded config makes no scene, or a scene of another size than the run's.
    """
    table = dict(tomllib.loads(run.attrs["config"])["scene"])
    name = table.pop("name")
    if name == CUSTOM or name not in scenes.available():
        return None
    try:
        scene = scenes.get(name)(**table)
    except (TypeError, ValueError, ArithmeticError, LookupError) as error:
        raise InputError(f"the run's attribute config makes no scene {name}: {error}; is the file damaged?") from error
    sizes = run.children[TRAJECTORY].sizes
    if (scene.dof, scene.dimension) != (sizes["dof"], sizes["axis"]):
        raise InputError(
            f"the run's attribute config makes a scene {name} of {scene.dof} degrees of freedom in {scene.dimension} "
            f"dimensions, and the run has {sizes['dof']} in {sizes['axis']}; is the file damaged?"
        )
    return scene


def attributes(config: Mapping[str, Any], scene: Scene) -> dict[str, Any]:
    """Return the root attributes that are known when a run starts."""
    return {
        "Conventions": CONVENTIONS,
        "title": title(config),
        "config": config_text(config),
        "deli_version": __version__,
        "cvxpy_version": version("cvxpy"),
        "numpy_version": version("numpy"),
        "python_version": platform.python_version(),
        "machine": machine(),
        **conserved_momenta(scene),
        "units_note": UNITS_NOTE,
        "citation": CITATION,
        "start": now(),
        "backend_versions": NONE_USED,
        "outcome": "unfinished",
    }


def config_text(config: Mapping[str, Any]) -> str:
    """Return a config as TOML, which `deli run` carries out again; where it cannot, the first line says why."""
    scene, method = config["scene"]["name"], config["method"]["name"]
    backends = {choice["backend"] for choice in config["solvers"].values()} - {*BUILTIN, *CHAINS}
    own = sorted(name for name in backends if not name.startswith(REFERENCE))
    first = ""
    if scene in MADE_IN_PYTHON:
        first = f"# This config does not run again: {MADE_IN_PYTHON[scene]}.\n"
    elif method not in METHODS:
        first = f"# This config does not run again: its method {method} is the user's own.\n"
    elif own:
        first = f"# This config runs again only where these backends are registered: {', '.join(own)}.\n"
    return first + tomli_w.dumps(config)


def title(config: Mapping[str, Any]) -> str:
    """Return a line that describes a run, without settings that have no meaning in it."""
    method = dict(config["method"])
    name = method.pop("name")
    said = [
        value if isinstance(value, str) else f"{key} = {value}"
        for key, value in method.items()
        if value is not False and ((name, key) not in ONLY_WITH or ONLY_WITH[name, key] in method.items())
    ]
    words = ", ".join(said)
    label = config["scene"].get("label", config["scene"]["name"])
    return f"{label} with {name}({words}), h = {config['step_size']!r}, {config['steps']} steps"


def conserved_momenta(scene: Scene) -> dict[str, str]:
    """Return the components of momentum that the scene's symmetry conserves, and the undecided ones."""
    rotation_axes = {1: (), 2: ("z",), 3: AXES}[scene.dimension]
    linear = dict(zip(AXES, scene.symmetry.linear, strict=False))
    angular = dict(zip(rotation_axes, scene.symmetry.angular, strict=True))
    components = {f"p_{axis}": kept for axis, kept in linear.items()} | {
        f"L_{axis}": kept for axis, kept in angular.items()
    }
    return {
        "conserved_linear_momentum": " ".join(axis for axis, kept in linear.items() if kept) or "none",
        "conserved_angular_momentum": " ".join(axis for axis, kept in angular.items() if kept) or "none",
        UNDECIDED: " ".join(name for name, kept in components.items() if kept is None) or "none",
    }


def backend_versions(names: Iterable[str], recorded: str = NONE_USED) -> str:
    """Return the backends that solved something, with versions, and those `recorded` earlier, separated by commas."""
    earlier = set() if recorded == NONE_USED else set(recorded.split(", "))
    return ", ".join(sorted(earlier | {f"{name} {backend_version(name)}" for name in names})) or NONE_USED


def backend_version(name: str) -> str:
    """Return the version of a backend's package; the version of a backend registered by hand is unknown."""
    if name.startswith(REFERENCE):
        return version("cvxpy")
    return version(BUILTIN[name][1]) if name in BUILTIN else "(registered by the user)"


@functools.cache
def version(distribution: str) -> str:
    """Return the version of an installed distribution; it is kept, because loaded code does not change."""
    return importlib.metadata.version(distribution)


def machine() -> str:
    """Return the operating system and the number of processors."""
    return f"{platform.platform()}, {os.cpu_count()} CPUs"


def now() -> str:
    """Return the present time, in UTC, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def continued(recorded: Mapping[str, Any], attributes: Mapping[str, Any], path: object) -> dict[str, Any]:
    """Return root attributes of a resumed run: those of its beginning, with software and machines of all sessions.

    A run may go on with another version of deli or numpy. A log line says that its rows may then differ by rounding.
    """
    found = {key: recorded.get(key, value) for key, value in attributes.items()} | {"outcome": attributes["outcome"]}
    for key in SOFTWARE:
        sessions = str(found[key]).split(BETWEEN_SESSIONS)
        if attributes[key] not in sessions:
            logger.warning(
                "%s goes on with another %s, %s after %s: its rows may differ from those of one session by rounding",
                *(path, key, attributes[key], found[key]),
            )
            found[key] = BETWEEN_SESSIONS.join([*sessions, attributes[key]])
    return found


def require_same(recorded: str, config: Mapping[str, Any], path: object) -> None:
    """Refuse to resume a run with a configuration other than the file's.

    Raises
    ------
    InputError
        Naming every key that differs.
    """
    before, now_ = flatten(tomllib.loads(recorded)), flatten(config)
    differing = [key for key in before | now_ if before.get(key) != now_.get(key)]
    if differing:
        found = "; ".join(
            f"{key} is {before.get(key, 'absent')!r} there and {now_.get(key, 'absent')!r} now" for key in differing
        )
        raise InputError(
            f"{path} cannot be resumed, its configuration differs: {found}. Use the same configuration, "
            "overwrite it, or name another output."
        )


def flatten(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return a nested table as a flat table with dotted keys."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def plain(value: Any) -> Any:
    """Return mappings, arrays and numbers in the types of TOML; None is left out of tables."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


@functools.lru_cache(maxsize=8)  # the cases of a study share scenes
def _describe_scene(scene: Scene) -> dict[str, Any]:
    if _registered(scene):
        return {"name": scene.name, **scene.parameters}
    return {"name": CUSTOM, "label": scene.name}


def _registered(scene: Scene) -> bool:
    """Return whether a scene's registered name and its parameters make the same scene again."""
    if scene.name not in scenes.available():
        return False
    try:
        again = scenes.get(scene.name)(**scene.parameters)
    except (InputError, TypeError, ValueError):  # parameters of the user's own
        return False
    return scene_digest(again) == scene_digest(scene)
