"""Components of the momenta that a scene conserves, and their errors in a run."""

import numpy as np
import xarray as xr

from deli.metrics.members import by_member
from deli.recording.schema import TRAJECTORY, UNDECIDED, dataset_of


@by_member
def momentum_error(run: xr.DataTree) -> float:
    """Return the largest |p - p(0)| of all conserved components of the linear momentum [M L T-1]; nan if none is.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.hard_rods(boundary="ring"), deli.GVI(), step_size=0.01, steps=50)
    >>> bool(deli.metrics.momentum_error(run) < 1e-9)
    True
    """
    return _worst_momentum(run, "p")


@by_member
def angular_momentum_error(run: xr.DataTree) -> float:
    """Return the largest |L - L(0)| of all conserved components of the angular momentum [M L2 T-1]; nan if none is.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> bool(deli.metrics.angular_momentum_error(run) < 1e-9)
    True
    """
    return _worst_momentum(run, "L")


@by_member
def momentum_errors(run: xr.DataTree) -> dict[str, float]:
    """Return the largest deviation from its initial value of each conserved component of the momenta, by name.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> list(deli.metrics.momentum_errors(run))
    ['L_z']
    """
    return {
        name: float(np.abs(values - values[0]).max())
        for name, values in momentum_components(run, conserved=True).items()
    }


@by_member
def momentum_components(run: xr.DataTree, conserved: bool) -> dict[str, np.ndarray]:
    """Return components of linear and angular momentum over time, by names such as ``p_x`` and ``L_z``.

    Parameters
    ----------
    run : xarray.DataTree
    conserved : bool
        Whether to return the components that the scene conserves, or the other components.

    Returns
    -------
    dict
        Arrays of shape (rows,) by name, in units of M L T-1 (linear) and M L2 T-1 (angular).

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> {name: values.shape for name, values in deli.metrics.momentum_components(run, conserved=False).items()}
    {'p_x': (51,), 'p_y': (51,)}
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
    """Return the names, such as ``p_x`` and ``L_z``, of components of the momenta whose conservation is unknown.

    The invariances of potentials and constraints made of a user's functions are measured
    (`deli.mechanics.measured`); they are unknown if the measurement does not decide.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.metrics.undecided_momenta(run)
    []
    """
    names: str = run.attrs.get(UNDECIDED, "none")
    return [name for name in names.split() if name != "none"]


def _worst_momentum(run: xr.DataTree, symbol: str) -> float:
    errors = [error for name, error in momentum_errors(run).items() if name.startswith(symbol)]
    return max(errors, default=np.nan)
