"""What a figure can show over time, from a recorded trajectory."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

Values = Callable[[xr.Dataset], xr.Variable]


@dataclass(frozen=True)
class Quantity:
    """A quantity with its symbol, and how it follows from group ``trajectory`` of a run: along time first."""

    symbol: str
    long_name: str
    values: Values


def _recorded(name: str) -> Values:
    return lambda trajectory: trajectory[name].variable


def _energy_change(trajectory: xr.Dataset) -> xr.Variable:
    energy = trajectory["hamiltonian"].variable
    return xr.Variable("time", energy.values - energy.values[0], energy.attrs)


def _radius(trajectory: xr.Dataset) -> xr.Variable:
    position = trajectory["position"].variable
    bodies = position.values.reshape(len(position), -1, trajectory.sizes["axis"])
    return xr.Variable(("time", "body"), np.linalg.norm(bodies, axis=-1), position.attrs)


QUANTITIES = {
    "position": Quantity("q", "position", _recorded("position")),
    "radius": Quantity("|q|", "distance from the origin", _radius),
    "energy": Quantity("H", "energy", _recorded("hamiltonian")),
    "energy_change": Quantity("H - H(0)", "change of energy", _energy_change),
    "angular_momentum": Quantity("L", "angular momentum", _recorded("angular_momentum")),
}


def extract(trajectory: xr.Dataset, names: list[str]) -> xr.Dataset:
    """Return a dataset of the named quantities along ``time``."""
    variables = {}
    for name in names:
        quantity = QUANTITIES[name]
        values = quantity.values(trajectory)
        variables[name] = xr.Variable(
            values.dims, values.values, {"units": values.attrs["units"], "long_name": quantity.long_name}
        )
    return xr.Dataset(variables, coords={"time": trajectory["time"].variable})
