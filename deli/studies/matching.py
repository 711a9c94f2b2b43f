"""Cases of a study that can be compared along every axis at once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from deli.numerals import numeral

SCENE, MEMBERS = "scene", "seed"
PROBLEMS = (SCENE, MEMBERS)
"""Axes whose labels are problems, on which the labels of all other axes are tried; problems are not compared."""


@dataclass(frozen=True)
class LeftOut:
    """A label that is left out of comparisons.

    Attributes
    ----------
    place : str
        The label in words, such as ``solver = highs``.
    missing, cases : int
        Number of its cases that have no value or are excluded, and number of all its cases.
    """

    place: str
    missing: int
    cases: int


@dataclass(frozen=True)
class Matched:
    """Cases of a study that are all combinations of some labels of its axes.

    The mean of any label is therefore a mean over the same labels of all other axes, and the means along one axis have
    the same mean as the means along any other axis.

    Attributes
    ----------
    cases : xarray.DataArray
        Whether a case is compared, on the study's axes.
    left_out : tuple of LeftOut
        The labels that are left out because some of their cases have no value.
    """

    cases: xr.DataArray
    left_out: tuple[LeftOut, ...]

    @property
    def count(self) -> int:
        """Number of compared cases."""
        return int(self.cases.sum())

    def places(self, axis: str) -> np.ndarray:
        """Return the positions along an axis with compared cases (labels that are truth values would be a mask)."""
        others = [name for name in self.cases.dims if name != axis]
        return np.flatnonzero(self.cases.any(others).values)


def match(among: xr.DataArray, known: xr.DataArray) -> Matched:
    """Find the cases to compare: all combinations of some labels, such that every combination has a value.

    Labels are left out one by one, the label with the largest share of missing cases first. A failing solver is thus
    left out rather than the scenes on which it fails, and a step size at which most methods fail rather than the
    methods. An axis keeps two labels as long as another axis has more. A scene and a member of an ensemble (`PROBLEMS`)
    are left out together, because scenes have different members.

    Parameters
    ----------
    among : xarray.DataArray
        Whether a case may be compared, on the study's axes; labels without such a case are not reported as left out.
    known : xarray.DataArray
        Whether a case has a value, on the study's axes.

    Returns
    -------
    Matched
    """
    problems = [name for name in PROBLEMS if name in known.dims]
    axes = [str(name) for name in known.dims if name not in problems]
    shape = (-1, *(known.sizes[name] for name in axes))
    values = known.transpose(*problems, *axes).values.reshape(shape)
    there = among.transpose(*problems, *axes).values.reshape(shape)
    every = [np.flatnonzero(there.any(axis=_others(values.ndim, axis))) for axis in range(values.ndim)]
    live, dropped = list(every), []
    while (part := values[np.ix_(*live)]).size and not part.all():
        axis, place = _worst(part)
        dropped.append((axis, int(live[axis][place])))
        live[axis] = np.delete(live[axis], place)
    chosen = np.zeros(values.shape, dtype=bool)
    chosen[np.ix_(*live)] = True
    cases = known.transpose(*problems, *axes).copy(
        data=chosen.reshape(*(known.sizes[name] for name in problems), *shape[1:])
    )
    left_out = []
    for axis, place in dropped:
        missing = ~values[
            np.ix_(*(np.array([place]) if axis == other else every[other] for other in range(values.ndim)))
        ]
        named = _problem(known, problems, place) if axis == 0 else {axes[axis - 1]: known[axes[axis - 1]].values[place]}
        left_out.append(LeftOut(in_words(named), int(missing.sum()), missing.size))
    return Matched(cases.transpose(*known.dims), tuple(left_out))


def word(label: object) -> str:
    """Return a label in words."""
    return numeral(float(label)) if isinstance(label, float | np.floating) else str(label)


def in_words(place: Mapping[str, Any]) -> str:
    """Return a place in words, scenes first; a scene's label speaks for itself."""
    chosen = sorted(place, key=lambda name: name != SCENE)
    return ", ".join(word(place[name]) if name == SCENE else f"{name} = {word(place[name])}" for name in chosen)


def _problem(known: xr.DataArray, problems: Sequence[str], place: int) -> dict[str, Any]:
    """Return the labels of a problem, without axes of one label."""
    index = np.unravel_index(place, [known.sizes[name] for name in problems])
    named = zip(problems, index, strict=True)
    return {name: known[name].values[k] for name, k in named if known.sizes[name] > 1}


def _others(dimensions: int, axis: int) -> tuple[int, ...]:
    return tuple(other for other in range(dimensions) if other != axis)


def _worst(known: np.ndarray) -> tuple[int, int]:
    """Return axis and position of the label to leave out: the label with the largest share of missing cases."""
    found = []
    for axis in range(known.ndim):
        missing = 1.0 - known.mean(axis=_others(known.ndim, axis))
        place, labels = int(missing.argmax()), known.shape[axis]
        spare = missing[place] == 1.0 or labels > (1 if axis == 0 else 2)
        found.append((spare, labels > 1, missing[place], labels, axis, place))
    *_, axis, place = max(found)
    return axis, place
