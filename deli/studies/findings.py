"""Findings of a study: sentences computed from its metrics."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from deli.studies.comparisons import SOLVER, axes_of, comparisons, shortened
from deli.studies.matching import SCENE, in_words, word
from deli.studies.states import DONE, EXCLUDED

COMPLETE = "complete"
LOST = 0.99  # smooth contacts count as lost below this share of their number at the tightest tolerance
CERTAIN = 4.0  # standard errors that a significant drift exceeds
WIDE = 0.1  # share of the energy band that a significant drift exceeds over the run
SHOWN_CAUSES = 5


def findings(study: xr.Dataset) -> list[str]:
    """Return sentences about the outcomes, times, energies, contacts and solvers of a study.

    Every sentence gives the number of cases behind it. Comparisons along any two axes are between the same cases
    (`deli.studies.comparisons`). Scenes are not compared with each other, and neither are the members of an ensemble
    (`seed`).

    Parameters
    ----------
    study : xarray.Dataset
        From `deli.open_study`.

    Returns
    -------
    list of str
    """
    told = [*_outcomes(study)]
    for axis in axes_of(study):
        told += _contacts(study, axis)
    told += [*comparisons(study), *_drifts(study), *_violations(study), *_claims(study), *_uncalled(study)]
    return told


def _outcomes(study: xr.Dataset) -> Iterator[str]:
    states = study["state"].values.ravel()
    outcomes = study["outcome"].values.ravel()[states != EXCLUDED].tolist()
    done = int((states == DONE).sum())
    if done == len(outcomes):
        yield f"All {done:,} cases were completed."
        return
    kinds = Counter(_cause(outcome) for outcome in outcomes if outcome != COMPLETE).most_common()
    others = "; ".join(f"{count:,} {kind}" for kind, count in kinds[:SHOWN_CAUSES])
    rest = sum(count for _, count in kinds[SHOWN_CAUSES:])
    more = f"; {rest:,} with other outcomes" if rest else ""
    yield f"{done:,} of {len(outcomes):,} cases were completed; the others: {others}{more}."


def _cause(outcome: str) -> str:
    """Return an outcome without the step and the advice."""
    state = outcome.split(" in step ")[0].split(":")[0]
    cause = outcome.split("): ", 1)[-1].split(";")[0].split(" and leaves a residual")[0].removesuffix(".")[:90]
    return state if cause == state else f"{state} ({cause.removeprefix(state).lstrip(': ')})"


def _contacts(study: xr.Dataset, axis: str) -> Iterator[str]:
    """Say up to which tolerance each solver keeps the smooth contacts, and how many lost ones become reflections."""
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
    counts: Counter[str] = Counter()
    bouncing: list[str] = []
    unknown: list[str] = []
    for place in _places(best):
        if not best.sel(place) > 0.0:
            if best.sel(place).isnull() and (study["state"].sel(place) != EXCLUDED).any():
                unknown.append(_said(place, held))
            continue
        kept = _kept(study["state"].sel(place), lost.sel(place), axis, solver)
        told.setdefault(kept, []).append(_said(place, held))
        counts[kept] += int(complete.sel(place).sum())
        excess = (struck - bounces).where(lost).sel(place)
        if excess.max() > 0.0:
            worst = excess.argmax(...)
            here = {str(name): excess[name].values[int(index)] for name, index in worst.items()}
            count = int(struck.sel(place).sel(here)), int(bounces.sel(place))
            where = ", ".join(filter(None, (_said(place, held), _said(here, held))))
            bouncing.append(f"{count[0]:,} instead of {count[1]:,} with {where}")
    share = f"at least {100 * LOST:.0f} % of their mean number at the tightest {axis}"
    for kept, places in told.items():
        head = f"With {shortened(places)}: smooth" if len(told) > 1 else "Smooth"
        yield f"{head} contacts are kept {kept} ({counts[kept]:,} cases; kept: {share})."
    if any(unknown):
        yield (
            f"A loss of smooth contacts cannot be judged with {shortened(unknown)}, because no case was completed at "
            f"the tightest {axis}."
        )
    if bouncing:
        yield (
            f"Where smooth contacts are lost, more contacts are reflected than at the tightest {axis} (worst cases): "
            f"{shortened(bouncing)}."
        )


def _kept(state: xr.DataArray, lost: xr.DataArray, axis: str, solver: list[str]) -> str:
    """Say for each solver the largest tolerance up to which no completed case loses smooth contacts."""
    there, complete = state != EXCLUDED, state == DONE
    names = [str(name) for name in state[SOLVER].values] if solver else [""]
    loosest: dict[float, list[str]] = {}
    for index, name in enumerate(names):
        chosen = {SOLVER: index} if solver else {}
        ended, gone = complete.isel(chosen), lost.isel(chosen)
        values = np.sort(ended[axis].values[ended.values])
        bad = gone[axis].values[gone.values]
        fine = values[values < bad.min()] if bad.size else values
        tried = int(there.isel(chosen).sum())
        failed = tried - int(ended.sum())
        told = f"{name} ({failed} of {tried} cases not completed)" if failed else name
        loosest.setdefault(float(fine.max()) if fine.size else 0.0, []).append(told.strip())
    if set(loosest) == {float(state[axis].max())} and bool(complete.all()):
        return f"at every {axis} (up to {word(state[axis].values.max())}){' with every solver' if solver else ''}"
    parts = []
    for value, named in sorted(loosest.items(), reverse=True):
        at = f"at {axis} ≤ {word(value)}" if value else f"at no {axis}"
        parts.append(f"{at} with {', '.join(named)}" if solver else at)
    return "; ".join(parts)


def _places(values: xr.DataArray) -> Iterator[dict[str, Any]]:
    """Yield the labels of every entry."""
    for index in np.ndindex(values.shape):
        yield {str(name): values[name].values[place] for name, place in zip(values.dims, index, strict=True)}


def _said(place: Mapping[str, Any], along: xr.DataArray) -> str:
    """Return a place in words, without axes of one label."""
    return in_words({name: label for name, label in place.items() if along.sizes[name] > 1})


def _drifts(study: xr.Dataset) -> Iterator[str]:
    complete = study["state"] == DONE
    drift, error = study["energy_drift"], study["energy_drift_error"]
    known = complete & drift.notnull()
    if not known.any():
        return
    few = int(complete.sum()) - int(known.sum())
    short = f"; {few:,} more completed cases have too few rows for an estimate" if few else ""
    over = abs(drift) * study["simulated_time"]
    seen = known & (abs(drift) > CERTAIN * error) & (over > WIDE * study["energy_band"])
    count, of = int(seen.sum()), int(known.sum())
    criterion = f"more than {CERTAIN:.0f} standard errors, and over the run more than {WIDE:g} of the energy band"
    if not count:
        yield f"The energy drift is significant in none of {of:,} cases ({criterion}){short}."
        return
    where = over.where(seen).argmax(...)
    place = ", ".join(f"{name} = {word(study[name].values[int(index)])}" for name, index in where.items())
    most = f"the largest over a run is {float(drift[where]):+.1e} [{drift.attrs['units']}] with {place}"
    yield f"The energy drift is significant in {count:,} of {of:,} cases ({criterion}); {most}{short}."


def _violations(study: xr.Dataset) -> Iterator[str]:
    worst = study["violation_worst"].where(study["state"] == DONE)
    if not worst.notnull().any():
        return
    place = worst.argmax(...)
    label = ", ".join(f"{name} = {word(study[name].values[int(index)])}" for name, index in place.items())
    value = f"{float(worst[place]):.1e} [{study['violation_worst'].attrs['units']}]"
    yield f"The worst violation in {int(worst.notnull().sum()):,} cases is {value}, with {label}."


def _claims(study: xr.Dataset) -> Iterator[str]:
    claimed, verified = study["claimed_solves"].fillna(0), study["verified_solves"].fillna(0)
    total = int(study["solves"].sum())
    false = int((claimed - verified).clip(min=0).sum())
    unclaimed = int((verified - claimed).clip(min=0).sum())
    if total:
        cases = int((study["solves"] > 0).sum())
        yield (
            f"Of {total:,} solves in {cases:,} cases, {int(verified.sum()):,} were verified (recomputed residuals "
            f"within the tolerance); at least {false:,} were claimed by the solver and not verified, at least "
            f"{unclaimed:,} were verified and not claimed."
        )


def _uncalled(study: xr.Dataset) -> Iterator[str]:
    """Say in which cases a chosen solver was never called."""
    ended = study["state"] == DONE
    idle = ended & (study["uncalled_solvers"] > 0.0)
    if not idle.any():
        return
    where = ""
    if SCENE in idle.dims and study.sizes[SCENE] > 1:
        counts = idle.sum([name for name in idle.dims if name != SCENE])
        counted = zip(study[SCENE].values, counts.values, strict=True)
        where = f" ({shortened([f'{scene} {count:,}' for scene, count in counted if count])})"
    yield (
        f"In {int(idle.sum()):,} of {int(ended.sum()):,} completed cases{where}, a chosen solver was never called, "
        "because all of its subproblems were answered without a solver; these cases do not compare solvers. With "
        "skip = false, solvers are called for closed forms too."
    )
