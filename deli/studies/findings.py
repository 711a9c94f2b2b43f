"""What a study's metrics say, in sentences computed from them."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import xarray as xr

from deli.studies.states import DONE, EXCLUDED

SCENE, COMPLETE = "scene", "complete"
SAME = 1.05  # cases within five per cent of each other count as equal
LOST = 0.99  # of the smooth contacts at the tightest tolerance, below which a contact counts as lost
CERTAIN = 4.0  # standard errors from which on a drift is told
LAW = 0.98  # squared correlation of logarithms from which on a power law is named
WIDE = 0.1  # part of the energy band that a drift must make up to matter


def findings(study: xr.Dataset) -> list[str]:
    """Sentences about outcomes, time, energy, contacts and solvers of a study.

    Comparisons along an axis are over matched cases: those that differ in nothing else, and of which all are complete.
    Scenes are not compared with each other.

    Parameters
    ----------
    study : xarray.Dataset
        From `deli.open_study`.

    Returns
    -------
    list of str
    """
    told = [*_outcomes(study)]
    axes = [str(name) for name in study["state"].dims if study.sizes[name] > 1 and name != SCENE]
    for axis in axes:
        told += _times(study, axis)
    for axis in axes:
        told += _bands(study, axis)
    for axis in axes:
        told += _contacts(study, axis)
    return [*told, *_drifts(study), *_violations(study), *_claims(study)]


def _outcomes(study: xr.Dataset) -> Iterator[str]:
    states = study["state"].values.ravel()
    outcomes = study["outcome"].values.ravel()[states != EXCLUDED].tolist()
    done = int((states == DONE).sum())
    if done == len(outcomes):
        yield f"All {done:,} cases ended."
        return
    kinds = Counter(_cause(outcome) for outcome in outcomes if outcome != COMPLETE)
    others = "; ".join(f"{count:,} {kind}" for kind, count in kinds.most_common(5))
    yield f"{done:,} of {len(outcomes):,} cases ended; others: {others}."


def _cause(outcome: str) -> str:
    """An outcome without the step and the advice."""
    state = outcome.split(" in step ")[0].split(":")[0]
    cause = outcome.split("): ", 1)[-1].split(";")[0].removesuffix(".")[:90]
    return state if cause == state else f"{state} ({cause.removeprefix(state).lstrip(': ')})"


def _times(study: xr.Dataset, axis: str) -> Iterator[str]:
    means = _geometric(study, "wall_time", axis)
    if len(means) < 2:
        return
    (first, least), *others = sorted(means.items(), key=lambda entry: entry[1])
    if others[-1][1] / least < SAME:
        yield f"Time does not depend on {axis} (within {100 * (SAME - 1):.0f} %)."
        return
    told = ", ".join(f"{label} {mean / least:.3g}" for label, mean in others)
    yield f"Along {axis}, {first} takes the least time; times as much: {told}."


def _bands(study: xr.Dataset, axis: str) -> Iterator[str]:
    band = _matched(study, "energy_band", axis)
    if band is None:
        return
    positive = band.where(band > 0.0)
    ratio = float((positive.max(axis) / positive.min(axis)).max())
    if not ratio > 0.0:
        return
    if ratio < SAME:
        yield f"The energy band does not depend on {axis} (within {100 * (SAME - 1):.0f} % in all matched cases)."
        return
    means = _geometric(study, "energy_band", axis)
    told = ", ".join(f"{label} {mean:.2e}" for label, mean in means.items())
    order = _order(study[axis].values, np.array(list(means.values())))
    law = "" if order is None else f", about {axis}^{order:.2g}"
    yield f"Energy band by {axis} (geometric mean): {told}{law}."


def _contacts(study: xr.Dataset, axis: str) -> Iterator[str]:
    """Where a loose tolerance loses contacts that a tight one keeps."""
    values = study[axis].values
    if "tolerance" not in axis or not np.issubdtype(values.dtype, np.number):
        return
    held = _matched(study, "smooth_contacts", axis)
    if held is None:
        return
    tight = held.sel({axis: values.min()})
    lost = (held < LOST * tight) & (tight > 0.0)
    places = lost.stack(case=list(lost.dims))
    found = [dict(zip(lost.dims, label, strict=True)) for label in places["case"].values[places.values]]
    if not found:
        yield f"No contact is lost along {axis}, up to {values.max():.0e}."
        return
    worst: dict[str, float] = {}
    for place in found:
        value = place.pop(axis)
        where = ", ".join(f"{name} = {label}" for name, label in place.items()) or "everywhere"
        worst[where] = min(worst.get(where, np.inf), value)
    told = "; ".join(f"from {value:.0e} on with {where}" for where, value in worst.items())
    yield f"Contacts are lost along {axis}: {told}."


def _drifts(study: xr.Dataset) -> Iterator[str]:
    complete = study["state"] == DONE
    drift, error = study["energy_drift"], study["energy_drift_error"]
    known = complete & drift.notnull()
    if not known.any():
        return
    over = abs(drift) * study["simulated_time"]
    seen = known & (abs(drift) > CERTAIN * error) & (over > WIDE * study["energy_band"])
    count, of = int(seen.sum()), int(known.sum())
    if not count:
        yield f"Energy drifts in none of {of:,} cases (beyond {CERTAIN:.0f} standard errors and a tenth of its band)."
        return
    where = over.where(seen).argmax(...)
    place = ", ".join(f"{name} = {study[name].values[int(index)]}" for name, index in where.items())
    yield f"Energy drifts in {count:,} of {of:,} cases; most with {place}: {float(drift[where]):+.1e} a unit of time."


def _violations(study: xr.Dataset) -> Iterator[str]:
    worst = study["violation_worst"].where(study["state"] == DONE)
    if not worst.notnull().any():
        return
    place = worst.argmax(...)
    label = ", ".join(f"{name} = {study[name].values[int(index)]}" for name, index in place.items())
    yield f"The worst violation is {float(worst[place]):.1e}, with {label}."


def _claims(study: xr.Dataset) -> Iterator[str]:
    claimed, verified = study["claimed_solves"].fillna(0), study["verified_solves"].fillna(0)
    total = int(study["solves"].sum())
    false = int((claimed - verified).clip(min=0).sum())
    unclaimed = int((verified - claimed).clip(min=0).sum())
    if total:
        yield (
            f"Of {total:,} solves {int(verified.sum()):,} were verified to their tolerance; {false:,} were claimed and "
            f"do not hold, {unclaimed:,} hold and were not claimed."
        )


def _matched(study: xr.Dataset, name: str, axis: str) -> xr.DataArray | None:
    """The metric where all cases along an axis are complete, as an array with the other axes; None without any."""
    complete = (study["state"] == DONE).all(axis)
    values = study[name].where(complete)
    return values if values.notnull().any() else None


def _geometric(study: xr.Dataset, name: str, axis: str) -> dict[str, float]:
    """Geometric mean of a metric over matched cases by label along an axis."""
    values = _matched(study, name, axis)
    if values is None:
        return {}
    positive = values.where((values > 0.0).all(axis))
    others = [str(other) for other in values.dims if other != axis]
    means = xr.DataArray(np.log(positive)).mean(others)
    return {
        _word(label): float(np.exp(mean))
        for label, mean in zip(study[axis].values, means.values, strict=True)
        if np.isfinite(mean)
    }


def _order(labels: np.ndarray, means: np.ndarray) -> float | None:
    """Exponent of the power law that the means follow along a numeric axis, None where they follow none."""
    if not np.issubdtype(labels.dtype, np.number) or len(labels) < 3 or len(means) < len(labels) or labels.min() <= 0:
        return None
    x, y = np.log(labels), np.log(means)
    slope, _ = np.polyfit(x, y, 1)
    return float(slope) if np.corrcoef(x, y)[0, 1] ** 2 > LAW else None


def _word(label: object) -> str:
    return f"{label:.4g}" if isinstance(label, float | np.floating) else str(label)
