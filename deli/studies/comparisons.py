"""Findings of a study that compare cases along its axes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from deli.studies.matching import PROBLEMS, SCENE, LeftOut, Matched, match, word
from deli.studies.states import DONE, EXCLUDED

SOLVER = "solver"
SAME = 1.05  # the ratio below which numbers count as equal
LAW = 0.98  # the squared correlation of logarithms above which a power law is named
_SPENT = {"solver_time": "time inside solvers", "cpu_time": "CPU time of steps", "wall_time": "wall time"}
ROUNDING = 1e-12  # drifts per reflected contact up to here count as zero
MOST_PLACES = 8  # the most that one sentence names


def comparisons(study: xr.Dataset) -> list[str]:
    """Return sentences about times, energies, impacts and violations along each axis.

    All comparisons are between the same cases: every combination of the labels that remain after labels with incomplete
    cases have been left out (`deli.studies.matching.match`). Numbers by one axis therefore agree with those by another.
    If a metric is unknown in some of these cases, or zero under a geometric mean, more labels are left out, and the
    sentence names them.

    Parameters
    ----------
    study : xarray.Dataset
        From `deli.open_study`.

    Returns
    -------
    list of str
    """
    axes, matched = axes_of(study), match(study["state"] != EXCLUDED, study["state"] == DONE)
    told = [*_left_out_of_all(study, matched)] if axes else []
    for tell, name, logarithmic in _COMPARED:
        chosen = {axis: name(study, axis) if callable(name) else name for axis in axes}
        metrics = {name: _metric(study, matched, name, logarithmic) for name in dict.fromkeys(chosen.values())}
        for axis in axes:
            metric = metrics[chosen[axis]]
            if len(metric.matched.places(axis)) > 1:
                told += tell(metric, axis)
    return told


def axes_of(study: xr.Dataset) -> list[str]:
    """Return the axes along which cases are compared: all axes of several labels, except scenes and members."""
    return [str(name) for name in study["state"].dims if study.sizes[name] > 1 and name not in PROBLEMS]


def shortened(said: Sequence[str]) -> str:
    """Return places in words: the first ones, and the number of the others."""
    more = len(said) - MOST_PLACES
    return "; ".join(said[:MOST_PLACES]) + (f" and {more:,} more" if more > 0 else "")


@dataclass(frozen=True)
class _Metric:
    """A metric of the compared cases; `values` is nan in all other cases."""

    values: xr.DataArray
    matched: Matched
    left_out: str

    @property
    def units(self) -> str:
        """Units of the metric, in the scene's own length, mass and time."""
        return str(self.values.attrs["units"])

    def each(self, axis: str) -> str:
        """Return the number of cases behind the number of each label, in words."""
        count = self.matched.count // len(self.matched.places(axis))
        return f"{count:,} case{'s' if count > 1 else ''} each"

    def along(self, axis: str) -> xr.DataArray:
        """Return the values at the compared labels of an axis."""
        return self.values.isel({axis: self.matched.places(axis)})


def _metric(study: xr.Dataset, matched: Matched, name: str, logarithmic: bool) -> _Metric:
    """Return a metric of those matched cases in which it is known, and positive if its logarithm is taken."""
    known = study[name] > 0.0 if logarithmic else study[name].notnull()
    found = match(matched.cases, known)
    why = f"; left out where it is unknown{' or zero' if logarithmic else ''}: {_named(found.left_out)}"
    told = why if found.left_out else ""
    return _Metric(study[name].where(found.cases), found, told)


def _left_out_of_all(study: xr.Dataset, matched: Matched) -> Iterator[str]:
    """Name the labels that are left out of all comparisons, if any."""
    if matched.left_out:
        cases = int((study["state"] != EXCLUDED).sum())
        why = f"left out because of cases that were not completed or are excluded: {_named(matched.left_out)}"
        yield f"Comparisons are between {matched.count:,} of {cases:,} cases; {why}."


def _named(left_out: Sequence[LeftOut]) -> str:
    return shortened([f"{each.place} ({each.missing:,} of {each.cases:,})" for each in left_out])


def _time(study: xr.Dataset, axis: str) -> str:
    """Return the name of the time to compare: time inside solvers along an axis of solvers, else of whole runs."""
    if _of_solvers(study, axis):
        return "solver_time"
    return "cpu_time" if "cpu_time" in study else "wall_time"


def _of_solvers(study: xr.Dataset, axis: str) -> bool:
    return str(study[axis].attrs.get("long_name", "")).startswith("solvers")


def _times(metric: _Metric, axis: str) -> Iterator[str]:
    means = _geometric(metric, axis)
    spent = _SPENT[str(metric.values.name)]
    (first, least), *others = sorted(means.items(), key=lambda entry: entry[1])
    if others[-1][1] / least < SAME:
        compared = f"geometric means of {metric.each(axis)}, equal within {100 * (SAME - 1):.0f} %{metric.left_out}"
        yield f"The {spent} does not depend on {axis} ({compared})."
        return
    told = ", ".join(f"{mean / least:.3g} with {label}" for label, mean in others)
    how = f"geometric means of {metric.each(axis)}{metric.left_out}"
    yield f"The {spent} by {axis} is least with {first}, {least:.3g} s; it is longer by a factor of {told} ({how})."


def _bands(metric: _Metric, axis: str) -> Iterator[str]:
    band = metric.along(axis)
    if float((band.max(axis) / band.min(axis)).max()) < SAME:
        compared = f"{metric.matched.count:,} cases compared, equal within {100 * (SAME - 1):.0f} %{metric.left_out}"
        yield f"The energy band does not depend on {axis} ({compared})."
        return
    means = _geometric(metric, axis)
    told = ", ".join(f"{mean:.2e} with {label}" for label, mean in means.items())
    order = _order(band[axis].values, np.array(list(means.values())))
    law = "" if order is None else f"; it varies about as {axis}^{order:.2g}"
    how = f"geometric means of {metric.each(axis)}{metric.left_out}"
    yield f"The energy band [{metric.units}] by {axis} is {told}{law} ({how})."


def _impacts(metric: _Metric, axis: str) -> Iterator[str]:
    """Say how the energy drift per reflected contact depends on a choice of the method, scene by scene."""
    moved = metric.along(axis)
    if axis == SOLVER or np.issubdtype(moved[axis].dtype, np.number):
        return
    told = []
    for scene in moved[SCENE].values[metric.matched.places(SCENE)] if SCENE in moved.dims else [None]:
        part = moved if scene is None else moved.sel({SCENE: scene})
        others = [name for name in part.dims if name != axis]
        row = xr.DataArray(np.sqrt((part**2).mean(others)))
        if row.max() > max(SAME * float(row.min()), ROUNDING):
            means = ", ".join(
                f"{value:.1e} with {word(label)}" for label, value in zip(row[axis].values, row.values, strict=True)
            )
            count = f"{int(part.notnull().sum()) // row.size:,} cases each"
            told.append(f"{means} ({count})" if scene is None else f"in {scene} {means} ({count})")
    if told:
        name = f"The energy drift per reflected contact [{metric.units}] by {axis} (root mean square{metric.left_out})"
        yield f"{name} is {'; '.join(told)}."
    else:
        compared = f"{metric.matched.count:,} cases compared{metric.left_out}"
        yield f"The energy drift per reflected contact does not depend on {axis} ({compared})."


def _violated(metric: _Metric, axis: str) -> Iterator[str]:
    """State the worst violations along an axis if they differ by more than a factor of ten."""
    values = metric.along(axis)
    worst = values.max([name for name in values.dims if name != axis])
    if worst.max() > 10.0 * worst.min():
        told = ", ".join(
            f"{float(value):.1e} with {word(label)}" for label, value in zip(worst[axis].values, worst, strict=True)
        )
        count = f"{metric.each(axis)}{metric.left_out}"
        yield f"The worst violation [{metric.units}] by {axis} is {told} ({count})."


def _geometric(metric: _Metric, axis: str) -> dict[str, float]:
    """Return the geometric mean of a metric by label along an axis."""
    values = metric.along(axis)
    means = xr.DataArray(np.log(values)).mean([name for name in values.dims if name != axis])
    return {word(label): float(np.exp(mean)) for label, mean in zip(means[axis].values, means.values, strict=True)}


def _order(labels: np.ndarray, means: np.ndarray) -> float | None:
    """Return the exponent of the power law of the means along a numeric axis, or None if they follow none."""
    if not np.issubdtype(labels.dtype, np.number) or len(labels) < 3 or labels.min() <= 0:
        return None
    x, y = np.log(labels), np.log(means)
    slope, _ = np.polyfit(x, y, 1)
    return float(slope) if np.corrcoef(x, y)[0, 1] ** 2 > LAW else None


_Teller = Callable[[_Metric, str], Iterator[str]]
_COMPARED: tuple[tuple[_Teller, str | Callable[[xr.Dataset, str], str], bool], ...] = (
    (_times, _time, True),
    (_bands, "energy_band", True),
    (_impacts, "drift_per_impact", False),
    (_violated, "violation_worst", False),
)
"""The comparisons along axes: a function that makes sentences, its metric, and whether its logarithm is compared."""
