"""The quantities that a figure can show over time, from a recorded trajectory."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from deli.figures.cradle import clean_swings, swinging_share
from deli.mechanics.scene import Scene

Values = Callable[[Scene, xr.Dataset], xr.Variable]


@dataclass(frozen=True)
class Quantity:
    """A quantity: its symbol, its name, and a function of group ``trajectory`` with values along time first."""

    symbol: str
    long_name: str
    values: Values


def _recorded(name: str) -> Values:
    return lambda scene, trajectory: trajectory[name].variable


def _energy_change(scene: Scene, trajectory: xr.Dataset) -> xr.Variable:
    energy = trajectory["hamiltonian"].variable
    return xr.Variable("time", energy.values - energy.values[0], energy.attrs)


def _radius(scene: Scene, trajectory: xr.Dataset) -> xr.Variable:
    position = trajectory["position"].variable
    bodies = position.values.reshape(len(position), -1, trajectory.sizes["axis"])
    return xr.Variable(("time", "body"), np.linalg.norm(bodies, axis=-1), position.attrs)


def _swinging_share(scene: Scene, trajectory: xr.Dataset) -> xr.Variable:
    attributes = {"units": "1", "clean_swings": clean_swings(scene, trajectory)}
    return xr.Variable("time", swinging_share(scene, trajectory), attributes)


QUANTITIES = {
    "position": Quantity("q", "position", _recorded("position")),
    "radius": Quantity("|q|", "distance from the origin", _radius),
    "energy": Quantity("H", "energy", _recorded("hamiltonian")),
    "energy_change": Quantity("H - H(0)", "change of energy", _energy_change),
    "angular_momentum": Quantity("L", "angular momentum", _recorded("angular_momentum")),
    "swinging_share": Quantity("s", "energy in the swinging balls", _swinging_share),
}


def extract(scene: Scene, trajectory: xr.Dataset, names: list[str]) -> xr.Dataset:
    """Return a dataset of the named quantities of a scene's run along ``time``."""
    variables = {}
    for name in names:
        quantity = QUANTITIES[name]
        values = quantity.values(scene, trajectory)
        kept = {key: values.attrs[key] for key in ("units", "clean_swings") if key in values.attrs}
        variables[name] = xr.Variable(values.dims, values.values, kept | {"long_name": quantity.long_name})
    return xr.Dataset(variables, coords={"time": trajectory["time"].variable})
