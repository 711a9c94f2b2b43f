"""Metrics of ensembles: metrics of the members along one more dimension."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, ParamSpec, TypeVar

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.recording.members import count_members, is_ensemble, member_of, rows_of
from deli.recording.schema import MEMBER, TRAJECTORY

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def by_member(metric: Callable[Parameters, Result]) -> Callable[Parameters, Any]:
    """Extend a metric of a run to ensembles: each of its numbers becomes an array along ``member``.

    Other ensembles among the arguments are split into the same members. A member without rows has nan.
    """

    @functools.wraps(metric)
    def measured(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Any:
        run: Any = args[0] if args else kwargs["run"]
        if not is_ensemble(run):
            return metric(*args, **kwargs)
        members = count_members(run)

        def part(argument: Any, member: int) -> Any:
            if not (isinstance(argument, xr.DataTree) and is_ensemble(argument)):
                return argument
            if count_members(argument) != members:
                raise InputError(
                    f"the reference has {count_members(argument)} members and the run has {members}; pass a reference "
                    "with as many members, or a single run."
                )
            return member_of(argument, member)

        found: list[Any] = []
        for member in range(members):
            if rows_of(run, member) == 0:
                found.append(None)
                continue
            arguments = [part(argument, member) for argument in args]
            named = {name: part(argument, member) for name, argument in kwargs.items()}
            found.append(metric(*arguments, **named))
        if all(one is None for one in found):
            raise InputError("no member of the ensemble has a row; there is nothing to measure.")
        return _stacked(found, run)

    return measured


def _stacked(found: Sequence[Any], run: xr.DataTree) -> Any:
    """Put the metrics of the members, None for a member without rows, into arrays along ``member``."""
    known = next(one for one in found if one is not None)
    if isinstance(known, dict | xr.Dataset):
        parts = {name: _stacked([None if one is None else one[name] for one in found], run) for name in known}
        return xr.Dataset(parts, attrs=known.attrs) if isinstance(known, xr.Dataset) else parts
    if isinstance(known, tuple):
        columns = [_stacked([None if one is None else one[k] for one in found], run) for k in range(len(known))]
        return type(known)(*columns) if hasattr(known, "_fields") else tuple(columns)
    coords = {name: values for name, values in run.coords.items() if values.dims == (MEMBER,)}
    dims = (MEMBER, "time") if np.ndim(known) else (MEMBER,)
    shape = tuple(run.children[TRAJECTORY].sizes[name] for name in dims)
    values = np.full(shape, np.nan)
    for member, one in enumerate(found):
        if one is not None:
            part: Any = (member, *(slice(length) for length in np.shape(one)))
            values[part] = one
    if "time" in dims:
        coords["time"] = run.children[TRAJECTORY]["time"]
    attrs = known.attrs if isinstance(known, xr.DataArray) else {}
    return xr.DataArray(values, coords, dims, attrs=attrs)
