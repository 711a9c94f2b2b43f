"""What the metrics of a study say when cases are compared along its axes, in sentences computed from them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from deli.studies.matching import PROBLEMS, SCENE, LeftOut, Matched, match, word
from deli.studies.states import DONE, EXCLUDED

SOLVER = "solver"
SAME = 1.05  # cases within five per cent of each other count as equal
LAW = 0.98  # squared correlation of logarithms from which on a power law is named
_SPENT = {"solver_time": "time inside solvers", "cpu_time": "CPU time of steps", "wall_time": "wall time"}
ROUNDING = 1e-12  # a drift per reflected contact below which there is none
MOST_PLACES = 8  # named in one sentence


def comparisons(study: xr.Dataset) -> list[str]:
    """Sentences about time, energy, impacts and violations along each axis.

    All are between the same cases: every combination of the labels that remain where those are left out with which
    cases did not end (`deli.studies.matching.match`). A metric that is unknown in some of these, or zero where a
    geometric mean is taken, leaves out more, and its sentence says so. So numbers by one axis agree with those by
    another.

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
    """Return the axes along which cases are compared: those of several labels, but scenes and members."""
    return [str(name) for name in study["state"].dims if study.sizes[name] > 1 and name not in PROBLEMS]


def shortened(said: Sequence[str]) -> str:
    """Return places in words, of many only the first."""
    more = len(said) - MOST_PLACES
    return "; ".join(said[:MOST_PLACES]) + (f" and {more:,} more" if more > 0 else "")


@dataclass(frozen=True)
class _Metric:
    """A metric of the cases that are compared in it, `values` being nan elsewhere."""

    values: xr.DataArray
    matched: Matched
    left_out: str

    def each(self, axis: str) -> str:
        """Say over how many cases of each label a number is."""
        count = self.matched.count // len(self.matched.places(axis))
        return f"{count:,} case{'s' if count > 1 else ''} each"

    def along(self, axis: str) -> xr.DataArray:
        """Return the values at the labels of an axis that are compared."""
        return self.values.isel({axis: self.matched.places(axis)})


def _metric(study: xr.Dataset, matched: Matched, name: str, logarithmic: bool) -> _Metric:
    """A metric of matched cases where it is known, and positive if its logarithm is taken."""
    known = study[name] > 0.0 if logarithmic else study[name].notnull()
    found = match(matched.cases, known)
    why = f"; left out where it is unknown{' or zero' if logarithmic else ''}: {_named(found.left_out)}"
    told = why if found.left_out else ""
    return _Metric(study[name].where(found.cases), found, told)


def _left_out_of_all(study: xr.Dataset, matched: Matched) -> Iterator[str]:
    """Say what is left out of all comparisons, if anything."""
    if matched.left_out:
        cases = int((study["state"] != EXCLUDED).sum())
        why = f"left out because of cases that did not end or are excluded: {_named(matched.left_out)}"
        yield f"Comparisons are between {matched.count:,} of {cases:,} cases; {why}."


def _named(left_out: Sequence[LeftOut]) -> str:
    return shortened([f"{each.place} ({each.missing:,} of {each.cases:,})" for each in left_out])


def _time(study: xr.Dataset, axis: str) -> str:
    """Name the time that solvers are compared by, or everything else."""
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
        compared = f"within {100 * (SAME - 1):.0f} %, {metric.each(axis)}{metric.left_out}"
        yield f"{spent[0].upper()}{spent[1:]} does not depend on {axis} ({compared})."
        return
    told = ", ".join(f"{label} {mean / least:.3g}" for label, mean in others)
    how = f"geometric mean of {metric.each(axis)}{metric.left_out}"
    yield f"Along {axis}, {first} takes the least {spent}; times as much ({how}): {told}."


def _bands(metric: _Metric, axis: str) -> Iterator[str]:
    band = metric.along(axis)
    if float((band.max(axis) / band.min(axis)).max()) < SAME:
        compared = f"within {100 * (SAME - 1):.0f} % in all {metric.matched.count:,} cases compared{metric.left_out}"
        yield f"The energy band does not depend on {axis} ({compared})."
        return
    means = _geometric(metric, axis)
    told = ", ".join(f"{label} {mean:.2e}" for label, mean in means.items())
    order = _order(band[axis].values, np.array(list(means.values())))
    law = "" if order is None else f", about {axis}^{order:.2g}"
    yield f"Energy band by {axis} (geometric mean of {metric.each(axis)}{metric.left_out}): {told}{law}."


def _impacts(metric: _Metric, axis: str) -> Iterator[str]:
    """What a reflection does to the energy by a choice of the method, scene by scene."""
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
                f"{word(label)} {value:.1e}" for label, value in zip(row[axis].values, row.values, strict=True)
            )
            count = f"{int(part.notnull().sum()) // row.size:,} cases each"
            told.append(f"{means} ({count})" if scene is None else f"{scene} {means} ({count})")
    if told:
        yield f"Energy drift per reflected contact by {axis} (root mean square{metric.left_out}): {'; '.join(told)}."
    else:
        compared = f"{metric.matched.count:,} cases compared{metric.left_out}"
        yield f"The energy drift per reflected contact does not depend on {axis} ({compared})."


def _violated(metric: _Metric, axis: str) -> Iterator[str]:
    """Along which axes the worst violation is another by more than a factor of ten."""
    values = metric.along(axis)
    worst = values.max([name for name in values.dims if name != axis])
    if worst.max() > 10.0 * worst.min():
        told = ", ".join(
            f"{word(label)} {float(value):.1e}" for label, value in zip(worst[axis].values, worst, strict=True)
        )
        yield f"The worst violation by {axis} (of {metric.each(axis)}{metric.left_out}): {told}."


def _geometric(metric: _Metric, axis: str) -> dict[str, float]:
    """Geometric mean of a metric by label along an axis."""
    values = metric.along(axis)
    means = xr.DataArray(np.log(values)).mean([name for name in values.dims if name != axis])
    return {word(label): float(np.exp(mean)) for label, mean in zip(means[axis].values, means.values, strict=True)}


def _order(labels: np.ndarray, means: np.ndarray) -> float | None:
    """Exponent of the power law that the means follow along a numeric axis, None where they follow none."""
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
"""What is compared along axes, of which metric, and whether of its logarithm."""
