"""What a study's metrics say, in sentences computed from them."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from deli.studies.states import DONE, EXCLUDED

SCENE, SOLVER, MEMBERS, COMPLETE = "scene", "solver", "seed", "complete"
SAME = 1.05  # cases within five per cent of each other count as equal
LOST = 0.99  # of the smooth contacts at the tightest tolerance, below which a contact counts as lost
CERTAIN = 4.0  # standard errors from which on a drift is told
LAW = 0.98  # squared correlation of logarithms from which on a power law is named
MOST_PLACES = 8  # named in one sentence
ROUNDING = 1e-12  # a drift per reflected contact below which there is none
WIDE = 0.1  # part of the energy band that a drift must make up to matter


def findings(study: xr.Dataset) -> list[str]:
    """Sentences about outcomes, time, energy, contacts and solvers of a study.

    Comparisons along an axis are over matched cases: those that differ in nothing else, and of which all are complete.
    Scenes are not compared with each other, and neither are the members of an ensemble (`seed`).

    Parameters
    ----------
    study : xarray.Dataset
        From `deli.open_study`.

    Returns
    -------
    list of str
    """
    told = [*_outcomes(study)]
    axes = [str(name) for name in study["state"].dims if study.sizes[name] > 1 and name not in (SCENE, MEMBERS)]
    for tell in (_contacts, _times, _bands, _impacts, _violated):
        for axis in axes:
            told += tell(study, axis)
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
    cause = outcome.split("): ", 1)[-1].split(";")[0].split(" and leaves a residual")[0].removesuffix(".")[:90]
    return state if cause == state else f"{state} ({cause.removeprefix(state).lstrip(': ')})"


def _times(study: xr.Dataset, axis: str) -> Iterator[str]:
    solver = str(study[axis].attrs.get("long_name", "")).startswith("solvers")
    means = _geometric(study, "solver_time" if solver else "wall_time", axis)
    if len(means) < 2:
        return
    spent = "time inside solvers" if solver else "time"
    (first, least), *others = sorted(means.items(), key=lambda entry: entry[1])
    if others[-1][1] / least < SAME:
        yield f"{spent.capitalize()} does not depend on {axis} (within {100 * (SAME - 1):.0f} %)."
        return
    told = ", ".join(f"{label} {mean / least:.3g}" for label, mean in others)
    yield f"Along {axis}, {first} takes the least {spent}; times as much: {told}."


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
    """Up to which tolerance each solver keeps the contacts that the tightest keep, and what becomes of those lost."""
    tolerances = study[axis].values
    if "tolerance" not in axis or not np.issubdtype(tolerances.dtype, np.number):
        return
    complete = study["state"] == DONE
    held, struck = study["smooth_contacts"].where(complete), study["reflected_contacts"].where(complete)
    solver = [SOLVER] if SOLVER in held.dims else []
    tight = held.sel({axis: tolerances.min()})
    best = tight.max(solver)
    lost = complete & (held < LOST * best)
    bounces = struck.sel({axis: tolerances.min()}).where(tight >= LOST * best).max(solver)
    told: dict[str, list[str]] = {}
    bouncing: list[str] = []
    for place in _places(best):
        if not best.sel(place) > 0.0:
            continue
        told.setdefault(_kept(complete.sel(place), lost.sel(place), axis, solver), []).append(_said(place, held))
        excess = (struck - bounces).where(lost).sel(place)
        if excess.max() > 0.0:
            worst = excess.argmax(...)
            here = {str(name): excess[name].values[int(index)] for name, index in worst.items()}
            count = int(struck.sel(place).sel(here)), int(bounces.sel(place))
            where = ", ".join(filter(None, (_said(place, held), _said(here, held))))
            bouncing.append(f"{count[0]:,} reflections instead of {count[1]:,} with {where}")
    for sentence, places in told.items():
        named = "; ".join(places[:MOST_PLACES]) + (
            f" and {more:,} more" if (more := len(places) - MOST_PLACES) > 0 else ""
        )
        yield f"Contacts last{f' with {named}:' if len(told) > 1 else ''} {sentence}."
    if bouncing:
        yield f"What should slide or rest bounces where contacts are lost: {'; '.join(bouncing[:MOST_PLACES])}."


def _kept(complete: xr.DataArray, lost: xr.DataArray, axis: str, solver: list[str]) -> str:
    """Say by solver from which tolerance down no contact is lost; cases that failed tell nothing."""
    names = [str(name) for name in complete[SOLVER].values] if solver else [""]
    loosest: dict[float, list[str]] = {}
    for index, name in enumerate(names):
        chosen = {SOLVER: index} if solver else {}
        ended, gone = complete.isel(chosen), lost.isel(chosen)
        values = np.sort(ended[axis].values[ended.values])
        bad = gone[axis].values[gone.values]
        fine = values[values < bad.min()] if bad.size else values
        failed = int((~ended).sum())
        word = f"{name} (which fails at {failed} of {ended.size})" if failed else name
        loosest.setdefault(float(fine.max()) if fine.size else 0.0, []).append(word.strip())
    if set(loosest) == {float(complete[axis].max())} and bool(complete.all()):
        return f"at every {axis} up to {complete[axis].max():.0e}{' with every solver' if solver else ''}"
    parts = []
    for value, who in sorted(loosest.items(), reverse=True):
        at = f"up to {axis} {value:.0e}" if value else f"at no {axis} that was tried"
        parts.append(f"{at} with {', '.join(who)}" if solver else at)
    return "; ".join(parts)


def _places(values: xr.DataArray) -> Iterator[dict[str, Any]]:
    """Labels of every entry."""
    for index in np.ndindex(values.shape):
        yield {str(name): values[name].values[place] for name, place in zip(values.dims, index, strict=True)}


def _said(place: Mapping[str, Any], along: xr.DataArray) -> str:
    """A place in words, scenes first, without axes of one label; a scene's label speaks for itself."""
    chosen = [name for name in sorted(place, key=lambda name: name != SCENE) if along.sizes[name] > 1]
    return ", ".join(str(place[name]) if name == SCENE else f"{name} = {_word(place[name])}" for name in chosen)


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


def _impacts(study: xr.Dataset, axis: str) -> Iterator[str]:
    """What a reflection does to the energy by a choice of the method, scene by scene."""
    moved = _matched(study, "drift_per_impact", axis)
    if moved is None or axis == SOLVER or np.issubdtype(study[axis].dtype, np.number):
        return
    typical = xr.DataArray(np.sqrt((moved**2).mean([name for name in moved.dims if name not in (axis, SCENE)])))
    told = []
    for scene in typical[SCENE].values if SCENE in typical.dims else [None]:
        row = typical if scene is None else typical.sel({SCENE: scene})
        if row.max() > max(SAME * float(row.min()), ROUNDING):
            means = ", ".join(
                f"{_word(label)} {value:.1e}" for label, value in zip(row[axis].values, row.values, strict=True)
            )
            told.append(means if scene is None else f"{scene} {means}")
    if told:
        yield f"Energy drift per reflected contact by {axis} (root mean square): {'; '.join(told)}."
    elif typical.notnull().any():
        yield f"The energy drift per reflected contact does not depend on {axis}."


def _violated(study: xr.Dataset, axis: str) -> Iterator[str]:
    """Along which axes the worst violation is another by more than a factor of ten."""
    values = _matched(study, "violation_worst", axis)
    if values is None:
        return
    worst = values.max([name for name in values.dims if name != axis])
    if worst.max() > 10.0 * worst.min():
        told = ", ".join(
            f"{_word(label)} {float(value):.1e}" for label, value in zip(study[axis].values, worst, strict=True)
        )
        yield f"The worst violation by {axis}: {told}."


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
