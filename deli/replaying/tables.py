"""The tables that `deli replay` prints."""

import math

import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table
from rich.text import Text

from deli.numerals import numeral
from deli.replaying.profiles import charged_times, ratios, shifted_geometric_mean
from deli.subproblems.choices import SUBPROBLEMS

WORST = 3


def print_replay(console: Console, data: xr.Dataset) -> None:
    """Print a summary of the problems, the comparison of backends, and the worst cases of each backend."""
    kinds = np.bincount(data["subproblem"].values, minlength=len(SUBPROBLEMS))
    counted = ", ".join(f"{count:,} {name}" for name, count in zip(SUBPROBLEMS, kinds, strict=True) if count)
    polish = "polished" if data.attrs["polish"] else "not polished"
    console.print(
        f"{data.sizes['problem']:,} subproblems of {data.attrs['file']}: {counted}; "
        f"at most {int(data['variables'].max())} variables, {int(data['rows'].max())} rows\n"
        f"tolerance {numeral(data.attrs['tolerance'])}, answers {polish}, limit {data.attrs['limit']:g} s",
        markup=False,
        soft_wrap=True,
    )
    console.print(_comparison(data))
    console.print(_worst(data))
    unknown = int(data["reference_residual"].isnull().sum())
    if unknown:
        console.print(f"No reference solution was found for {unknown:,} problems; errors leave them out.")


def _comparison(data: xr.Dataset) -> Table:
    times = ("mean, s", "× best", "median, s", "fastest")
    table = Table("backend", "claimed", "verified", "false claims", *times, "largest error")
    means = shifted_geometric_mean(charged_times(data))
    fastest = (ratios(data) == 1.0).mean(axis=0)
    for place in np.argsort(means, kind="stable"):
        one = data.isel(backend=place)
        claimed, verified = one["claimed"].values, one["verified"].values
        false = int((claimed & ~verified).sum())
        solved = one["time"].values[verified]
        table.add_row(
            Text(str(one["backend"].item())),
            _share(claimed),
            _share(verified),
            str(false) if false else "–",
            f"{means[place]:.2e}",
            f"{means[place] / means.min():.3g}",
            f"{np.median(solved):.2e}" if solved.size else "–",
            f"{fastest[place]:.0%}",
            _number(np.nanmax(one["error"].values, initial=0.0)),
        )
    return table


def _worst(data: xr.Dataset) -> Table:
    """Return a table of the indices of each backend's worst problems."""
    columns = ("backend", "not verified", "largest verified error", "slowest against the fastest")
    table = Table(*columns, title="worst cases, by index")
    found = ratios(data)
    for place, name in enumerate(data["backend"].values):
        one = data.isel(backend=place)
        failed = np.flatnonzero(~one["verified"].values)
        listed = [f"{index} ({_said(data, index)})" for index in failed[:WORST]]
        listed += [f"{len(failed) - WORST:,} more"] if len(failed) > WORST else []
        errors = np.where(one["verified"].values, one["error"].values, np.nan)
        slow = np.where(np.isfinite(found[:, place]), found[:, place], np.nan)
        table.add_row(
            Text(str(name)), Text("\n".join(listed) or "–"), Text(_top(data, errors)), Text(_top(data, slow, "×"))
        )
    return table


def _top(data: xr.Dataset, values: np.ndarray, unit: str = "") -> str:
    """Return the largest value with its index, in words."""
    if np.isnan(values).all():
        return "–"
    index = int(np.nanargmax(values))
    value = f"{values[index]:.3g}{unit}" if unit else _number(values[index])
    return f"{index}: {value} ({_said(data, index)})"


def _said(data: xr.Dataset, index: int) -> str:
    one = data.isel(problem=index)
    origin = str(one["origin"].item())
    return f"{origin + ' ' if origin else ''}{SUBPROBLEMS[int(one['subproblem'])]}, step {int(one['step'])}"


def _share(flags: np.ndarray) -> str:
    """Return a share in percent, rounded down, so that only all are 100 %."""
    return "100 %" if flags.all() else f"{math.floor(1000 * flags.mean()) / 10:.1f} %"


def _number(value: float) -> str:
    return f"{value:.1e}" if np.isfinite(value) else "–"
