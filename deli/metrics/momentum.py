"""Which components of the momenta a scene conserves, and how well a run kept them."""

import numpy as np
import xarray as xr

from deli.metrics.members import by_member
from deli.recording.schema import TRAJECTORY, UNDECIDED, dataset_of


@by_member
def momentum_error(run: xr.DataTree) -> float:
    """Largest |p - p(0)| of a component of the linear momentum that the scene conserves [M L T-1]; nan without any."""
    return _worst_momentum(run, "p")


@by_member
def angular_momentum_error(run: xr.DataTree) -> float:
    """Largest |L - L(0)| of a component that the scene conserves [M L2 T-1]; nan without any."""
    return _worst_momentum(run, "L")


@by_member
def momentum_errors(run: xr.DataTree) -> dict[str, float]:
    """Largest deviation from the initial value of each momentum component that the scene conserves."""
    return {
        name: float(np.abs(values - values[0]).max())
        for name, values in momentum_components(run, conserved=True).items()
    }


@by_member
def momentum_components(run: xr.DataTree, conserved: bool) -> dict[str, np.ndarray]:
    """Components of linear and angular momentum over time, by name such as ``p_x`` and ``L_z``.

    Parameters
    ----------
    run : xarray.DataTree
    conserved : bool
        Whether to return those that the scene conserves, or all others.
    """
    trajectory = dataset_of(run, TRAJECTORY)
    found: dict[str, np.ndarray] = {}
    for kind, symbol in (("linear", "p"), ("angular", "L")):
        if f"{kind}_momentum" not in trajectory:
            continue
        values = trajectory[f"{kind}_momentum"]
        axes = [str(axis) for axis in values["axis"].values] if values.ndim == 2 else ["z"]
        kept = run.attrs[f"conserved_{kind}_momentum"].split()
        columns = values.values.reshape(len(values), len(axes))
        for index, axis in enumerate(axes):
            if (axis in kept) == conserved:
                found[f"{symbol}_{axis}"] = columns[:, index]
    return found


def undecided_momenta(run: xr.DataTree) -> list[str]:
    """Names, such as ``p_x`` and ``L_z``, of momentum components that the scene may or may not conserve.

    The invariances of potentials and constraints made of a user's functions are measured
    (`deli.mechanics.measured`); they are unknown where that decides nothing.
    """
    names: str = run.attrs.get(UNDECIDED, "none")
    return [name for name in names.split() if name != "none"]


def _worst_momentum(run: xr.DataTree, symbol: str) -> float:
    errors = [error for name, error in momentum_errors(run).items() if name.startswith(symbol)]
    return max(errors, default=np.nan)
