"""Record of a scene in a run's attributes, and whether a run that goes on is of the same scene.

The attribute ``scene`` is the scene's content as TOML, see `deli.mechanics.content.scene_content`, and ``scene_digest``
one digest of all that decides the motion.
"""

import logging
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from deli.errors import InputError
from deli.mechanics.content import differences, sampled, scene_content, scene_digest
from deli.mechanics.scene import Scene

SCENE, DIGEST = "scene", "scene_digest"
MOST_NAMED = 5

logger = logging.getLogger("deli")


def scene_attributes(scene: Scene) -> dict[str, str]:
    """Root attributes that say which scene a run is of."""
    content = scene_content(scene)
    functions = ", ".join(sampled(content))
    note = f"# {functions}: functions in Python, of which samples are recorded, and compared when a run goes on.\n"
    return {SCENE: (note if functions else "") + tomli_w.dumps(content), DIGEST: scene_digest(scene)}


def differing(attributes: Mapping[Any, Any], scene: Scene) -> list[str] | None:
    """Say in what a scene differs from that of a run with these attributes; None where those do not describe one.

    Functions in Python are compared by their samples.
    """
    try:
        return differences(tomllib.loads(attributes[SCENE]), scene_content(scene))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        return None


def require_same_scene(attributes: Mapping[Any, Any], scene: Scene, path: Path) -> None:
    """Refuse to go on with another scene than the file's; warn of functions, of which only samples are known.

    Raises
    ------
    InputError
        Naming the arrays and the families that differ.
    """
    found = differing(attributes, scene)
    if found is None:
        raise InputError(
            f"{path} cannot be resumed: its attribute {SCENE} is missing or describes no scene, so nobody knows which "
            "it is of. Overwrite it, or name another output."
        )
    if found:
        more = f"; and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        raise InputError(
            f"{path} cannot be resumed, its scene is another: {'; '.join(found[:MOST_NAMED])}{more}. Use the same "
            "scene, overwrite it, or name another output."
        )
    functions = sampled(scene_content(scene))
    if functions:
        logger.warning(
            "%s goes on with %s: functions in Python, of which only samples were compared", path, ", ".join(functions)
        )
