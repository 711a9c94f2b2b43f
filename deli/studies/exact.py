"""Closed forms as references of a study's cases, in the place of a finer run."""

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.recording.provenance import scene_of
from deli.recording.schema import TRAJECTORY, dataset_of

BY_SCENE = {"point_mass": "bouncing_ball", "hard_rods": "passing_points"}
"""Names of closed forms in `deli.figures.exact`, by the name of the scene."""


def require_exact(scene: str) -> None:
    """Refuse a scene without a closed form of its motion.

    Raises
    ------
    InputError
        With the names of the scenes that have one.
    """
    if scene not in BY_SCENE:
        raise InputError(
            f"reference.exact: no closed form is known of scene {scene}, only of {', '.join(BY_SCENE)}; "
            "compare with a finer run, such as step_size = 1e-4."
        )


def exact_run(run: xr.DataTree) -> xr.DataTree:
    """Return the closed form at a run's times, with the variables that `deli.metrics.measure` reads of a reference."""
    from deli.figures.exact import SOLUTIONS  # it imports matplotlib, which no worker needs

    scene = scene_of(run)
    if scene is None:
        raise InputError("the run's scene is a user's own, and no closed form is known.")
    time = dataset_of(run, TRAJECTORY)["time"].values
    position = np.asarray(SOLUTIONS[BY_SCENE[scene.name]](scene, time))
    trajectory = xr.Dataset({"position": (("time", "dof"), position)}, coords={"time": time})
    return xr.DataTree.from_dict({f"/{TRAJECTORY}": trajectory})
