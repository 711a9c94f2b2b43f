"""Record of a scene in a run's attributes, and comparison of other scenes with it.

The attribute ``scene`` is the scene's content as TOML, see `deli.mechanics.content.scene_content`. The attribute
``scene_digest`` is a digest of all numbers that decide the motion.
"""

import logging
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from deli.errors import InputError
from deli.mechanics.content import differences, sampled, scene_content, scene_digest
from deli.mechanics.scene import Scene
from deli.recording.schema import TRAJECTORY

if TYPE_CHECKING:
    import xarray as xr

SCENE, DIGEST = "scene", "scene_digest"
MOST_NAMED = 5
DIGITS = 12

logger = logging.getLogger("deli")


def scene_attributes(scene: Scene) -> dict[str, str]:
    """Return the root attributes that describe the scene of a run."""
    content = scene_content(scene)
    functions = ", ".join(sampled(content))
    note = f"# {functions}: functions in Python; samples of them are recorded, and compared when a run is resumed.\n"
    return {SCENE: (note if functions else "") + tomli_w.dumps(content), DIGEST: scene_digest(scene)}


def differing(attributes: Mapping[Any, Any], scene: Scene) -> list[str] | None:
    """Return the differences of a scene from the scene that attributes describe; None where they describe none.

    Functions in Python are compared by their samples.
    """
    try:
        return differences(tomllib.loads(attributes[SCENE]), scene_content(scene))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        return None


def require_scene_of(run: "xr.DataTree", scene: Scene) -> None:
    """Refuse a scene that is not the run's: a scene of another size or another digest.

    A run without a digest, such as a member of an ensemble, is compared by its size only.

    Raises
    ------
    InputError
        If it is another; the message names both scenes and their differences.
    """
    described, sizes = tomllib.loads(run.attrs["config"])["scene"], run.children[TRAJECTORY].sizes
    digest, recorded = scene_digest(scene), run.attrs.get(DIGEST)
    found = _size(scene.bodies, scene.dimension)
    due = _size(sizes["dof"] // sizes["axis"], sizes["axis"])
    if found == due:
        if recorded in (None, digest):
            return
        found, due = f"digest {digest[:DIGITS]}", f"digest {recorded[:DIGITS]}"
    differences = "; ".join((differing(run.attrs, scene) or [])[:MOST_NAMED])
    where = f" Compared with the run: {differences}." if differences else ""
    raise InputError(
        f"scene: found {scene.name!r} ({found}); the run is of {described.get('label', described['name'])!r} ({due})."
        f"{where} Pass the scene that was run."
    )


def _size(bodies: int, dimension: int) -> str:
    return f"{bodies} {'body' if bodies == 1 else 'bodies'} in {dimension} dimension{'s' * (dimension > 1)}"


def require_same_scene(attributes: Mapping[Any, Any], scene: Scene, path: Path) -> None:
    """Refuse to resume a run with a scene other than the file's; warn of functions, which are compared by samples.

    Raises
    ------
    InputError
        If it is another; the message names the arrays and the families that differ.
    """
    found = differing(attributes, scene)
    if found is None:
        raise InputError(
            f"{path} cannot be resumed: its attribute {SCENE} is missing or describes no scene, so the scene of "
            "its rows is unknown. Overwrite it, or name another output."
        )
    if found:
        more = f"; and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        raise InputError(
            f"{path} cannot be resumed, its scene is another: {'; '.join(found[:MOST_NAMED])}{more}. Use the same "
            "scene, overwrite it, or name another output."
        )
    functions = sampled(scene_content(scene))
    if functions:
        logger.warning("%s goes on with %s: functions in Python, compared by samples only", path, ", ".join(functions))
