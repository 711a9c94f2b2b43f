"""What a study's metrics say, in sentences computed from them."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from deli.studies.comparisons import SOLVER, axes_of, comparisons, shortened
from deli.studies.matching import SCENE, in_words, word
from deli.studies.states import DONE, EXCLUDED

COMPLETE = "complete"
LOST = 0.99  # of the smooth contacts at the tightest tolerance, below which a contact counts as lost
CERTAIN = 4.0  # standard errors from which on a drift is told
WIDE = 0.1  # part of the energy band that a drift must make up to matter


def findings(study: xr.Dataset) -> list[str]:
    """Sentences about outcomes, time, energy, contacts and solvers of a study.

    Every number says how many cases it is of; comparisons are between the same cases along every axis
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
    unknown: list[str] = []
    for place in _places(best):
        if not best.sel(place) > 0.0:
            if best.sel(place).isnull() and (study["state"].sel(place) != EXCLUDED).any():
                unknown.append(_said(place, held))
            continue
        kept = _kept(study["state"].sel(place), lost.sel(place), axis, solver)
        told.setdefault(kept, []).append(_said(place, held))
        excess = (struck - bounces).where(lost).sel(place)
        if excess.max() > 0.0:
            worst = excess.argmax(...)
            here = {str(name): excess[name].values[int(index)] for name, index in worst.items()}
            count = int(struck.sel(place).sel(here)), int(bounces.sel(place))
            where = ", ".join(filter(None, (_said(place, held), _said(here, held))))
            bouncing.append(f"{count[0]:,} reflections instead of {count[1]:,} with {where}")
    for sentence, places in told.items():
        yield f"Contacts last{f' with {shortened(places)}:' if len(told) > 1 else ''} {sentence}."
    if any(unknown):
        yield f"Whether contacts last is unknown where no case ended at the tightest {axis}: {shortened(unknown)}."
    if bouncing:
        yield f"What should slide or rest bounces where contacts are lost: {shortened(bouncing)}."


def _kept(state: xr.DataArray, lost: xr.DataArray, axis: str, solver: list[str]) -> str:
    """Say by solver from which tolerance down no contact is lost; cases that failed tell nothing."""
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
        told = f"{name} (which fails at {failed} of {tried})" if failed else name
        loosest.setdefault(float(fine.max()) if fine.size else 0.0, []).append(told.strip())
    if set(loosest) == {float(state[axis].max())} and bool(complete.all()):
        return f"at every {axis} up to {word(state[axis].max().item())}{' with every solver' if solver else ''}"
    parts = []
    for value, who in sorted(loosest.items(), reverse=True):
        at = f"up to {axis} {word(value)}" if value else f"at no {axis} that was tried"
        parts.append(f"{at} with {', '.join(who)}" if solver else at)
    return "; ".join(parts)


def _places(values: xr.DataArray) -> Iterator[dict[str, Any]]:
    """Labels of every entry."""
    for index in np.ndindex(values.shape):
        yield {str(name): values[name].values[place] for name, place in zip(values.dims, index, strict=True)}


def _said(place: Mapping[str, Any], along: xr.DataArray) -> str:
    """A place in words, without axes of one label."""
    return in_words({name: label for name, label in place.items() if along.sizes[name] > 1})


def _drifts(study: xr.Dataset) -> Iterator[str]:
    complete = study["state"] == DONE
    drift, error = study["energy_drift"], study["energy_drift_error"]
    known = complete & drift.notnull()
    if not known.any():
        return
    short = f"; {few:,} more ended with too few rows to tell" if (few := int(complete.sum()) - int(known.sum())) else ""
    over = abs(drift) * study["simulated_time"]
    seen = known & (abs(drift) > CERTAIN * error) & (over > WIDE * study["energy_band"])
    count, of = int(seen.sum()), int(known.sum())
    if not count:
        beyond = f"beyond {CERTAIN:.0f} standard errors and a tenth of its band"
        yield f"Energy drifts in none of {of:,} cases ({beyond}){short}."
        return
    where = over.where(seen).argmax(...)
    place = ", ".join(f"{name} = {word(study[name].values[int(index)])}" for name, index in where.items())
    most = f"most with {place}: {float(drift[where]):+.1e} a unit of time"
    yield f"Energy drifts in {count:,} of {of:,} cases; {most}{short}."


def _violations(study: xr.Dataset) -> Iterator[str]:
    worst = study["violation_worst"].where(study["state"] == DONE)
    if not worst.notnull().any():
        return
    place = worst.argmax(...)
    label = ", ".join(f"{name} = {word(study[name].values[int(index)])}" for name, index in place.items())
    yield f"The worst violation in {int(worst.notnull().sum()):,} cases is {float(worst[place]):.1e}, with {label}."


def _claims(study: xr.Dataset) -> Iterator[str]:
    claimed, verified = study["claimed_solves"].fillna(0), study["verified_solves"].fillna(0)
    total = int(study["solves"].sum())
    false = int((claimed - verified).clip(min=0).sum())
    unclaimed = int((verified - claimed).clip(min=0).sum())
    if total:
        cases = int((study["solves"] > 0).sum())
        yield (
            f"Of {total:,} solves in {cases:,} cases {int(verified.sum()):,} were verified to their tolerance; "
            f"{false:,} were claimed and do not hold, {unclaimed:,} hold and were not claimed."
        )


def _uncalled(study: xr.Dataset) -> Iterator[str]:
    """Say where solvers were chosen or compared that nothing reached."""
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
        f"In {int(idle.sum()):,} of {int(ended.sum()):,} cases{where} a solver was chosen and never called, because "
        "every subproblem was answered without one: these say nothing about solvers. With skip = false solvers are "
        "called for closed forms, too."
    )
