"""The dataset of a study's folder: metrics along the study's axes, and the runs behind them."""

import logging
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.metrics import METRICS
from deli.recording.paths import partial_path
from deli.running.session import COMPLETE
from deli.simulation import open_run
from deli.studies.axes import derived_name
from deli.studies.layout import run_path
from deli.studies.manifest import read_manifest
from deli.studies.measuring import definition, measured
from deli.studies.states import DONE, EXCLUDED
from deli.studies.timing import TIMES

logger = logging.getLogger("deli")


def open_study(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open the folder of a study, finished or not.

    Parameters
    ----------
    path
        The folder that ``deli study`` wrote.

    Returns
    -------
    xarray.Dataset
        Variables on the study's axes:

        - the metrics of `deli.metrics.measure`, nan for an unfinished case; also `cpu_time` and `recording_time` [s] if
          the study has ``time_steps``;
        - `state`: ``done``, ``failed``, ``timed out``, ``out of memory``, ``killed``, ``interrupted``, ``running``,
          ``waiting`` or ``excluded``;
        - `outcome`: ``complete``, a reason in words, or empty for an excluded case;
        - `note`: the reason for a missing comparison with the reference;
        - `file`: the file of the run, relative to the folder.

        ``study.deli.run(solver="daqp", step_size=0.1)`` reads the run of one case, as `deli.open_run` does.

    Raises
    ------
    InputError
        If the folder holds no study, or its manifest or a file of metrics is damaged.

    Examples
    --------
    The folder is one that ``deli study`` wrote; here two cases are run from Python.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import deli
    >>> from deli.studies.expansion import make_study
    >>> from deli.studies.running import run_study
    >>> place = TemporaryDirectory()
    >>> folder = Path(place.name, "steps")
    >>> base = {"scene": "point_mass", "duration": 1.0}
    >>> result = run_study(make_study({"base": base, "axes": {"step_size": [0.1, 0.05]}}, folder), folder, workers=1)
    >>> study = deli.open_study(folder)
    >>> study["state"].values.tolist(), study["steps"].values.tolist()
    (['done', 'done'], [10.0, 20.0])
    >>> study.deli.run(step_size=0.05)["trajectory"].sizes["time"]
    21
    >>> place.cleanup()
    """
    folder = Path(path)
    manifest = read_manifest(folder)
    if manifest is None:
        raise InputError(f"{folder} holds no study: there is no manifest.json.")
    dimensions = manifest["dimensions"]
    names = [dimension["name"] for dimension in dimensions]
    shape = [len(dimension["positions"]) for dimension in dimensions]
    described = METRICS | (TIMES if manifest.get("timed", False) else {})
    values = {name: np.full(shape, np.nan) for name in described}
    words = {name: np.full(shape, "", dtype=object) for name in _WORDS}
    words["state"][...] = EXCLUDED
    places = [
        {position["label"]: index for index, position in enumerate(dimension["positions"])} for dimension in dimensions
    ]
    old = 0
    for case in manifest["cases"]:
        index = tuple(place[case["labels"][name]] for name, place in zip(names, places, strict=True))
        record, file = manifest["runs"][case["digest"]], run_path(folder, case["digest"])
        found = measured(file) if record["state"] == DONE else None
        words["state"][index], words["outcome"][index] = record["state"], _outcome(record)
        words["file"][index], words["note"][index] = file.relative_to(folder).as_posix(), found.note if found else ""
        if found is not None:
            old += found.definition != definition()
            for name in described:
                values[name][index] = found.metrics.get(name, np.nan)
    if old:
        logger.warning("%s: %d runs were measured by other definitions; deli study measures them anew", folder, old)
    variables = {
        name: (names, array, dict(zip(("units", "long_name"), described[name], strict=True)))
        for name, array in values.items()
    }
    variables |= {name: (names, array.astype(str), {"long_name": _WORDS[name]}) for name, array in words.items()}
    return xr.Dataset(
        variables,
        coords=_coordinates(dimensions),
        attrs={
            "title": manifest["title"],
            "study": manifest["study"],
            "folder": os.fspath(folder.resolve()),
            "machine": "; ".join(dict.fromkeys(session["machine"] for session in manifest["sessions"])),
            "workers": max((session["workers"] for session in manifest["sessions"]), default=0),
            "deli_version": "; ".join(dict.fromkeys(session["deli_version"] for session in manifest["sessions"])),
        },
    )


@xr.register_dataset_accessor("deli")
class StudyAccessor:
    """Access to the runs of a study's dataset, as ``study.deli``."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def run(self, **labels: Any) -> xr.DataTree:
        """Read the run of one case; of an unfinished case, read the recorded rows.

        Parameters
        ----------
        labels
            Label of the case on each axis of the dataset.

        Raises
        ------
        InputError
            If the labels name no case or more than one, or nothing is recorded of the case.
        """
        if not {"file", "state"} <= set(self._dataset.variables) or "folder" not in self._dataset.attrs:
            raise InputError("the dataset is not a study's; use a dataset from deli.open_study, or a part of it.")
        case = self._dataset[["file", "state"]]
        for name in case.dims:
            if name not in labels:
                raise InputError(f"name one {name} of: {_listed(case, name)}.")
        for name, label in labels.items():
            if name not in case.dims:
                raise InputError(f"{name!r} is no axis of the study; its axes are: {', '.join(map(str, case.dims))}.")
            try:
                case = case.sel({name: label})
            except KeyError as error:
                raise InputError(f"{name} is {label!r}; allowed: {_listed(case, name)}.") from error
        if not case["file"].item():
            raise InputError(f"the study excludes {_said(labels)}.")
        path = Path(self._dataset.attrs["folder"]) / case["file"].item()
        for candidate in (path, partial_path(path)):
            if candidate.exists():
                return open_run(candidate)
        raise InputError(f"nothing is recorded of {_said(labels)}: it is {case['state'].item()}.")


_WORDS = {
    "state": "state of the case",
    "outcome": "outcome of the case; empty for an excluded case",
    "note": "reason for a missing comparison with the reference",
    "file": "file of the run, relative to the folder of the study",
}


def _outcome(record: Mapping[str, Any]) -> str:
    """Return a run's outcome, or its state so far, in words."""
    state, reason = record["state"], record["reason"]
    if state == DONE:
        return COMPLETE
    return reason if reason.startswith(state) else ": ".join(filter(None, (state, reason)))


def _coordinates(dimensions: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the labels of each dimension, and beside the labels of a zip the values of its keys."""
    coordinates: dict[str, Any] = {}
    for dimension in dimensions:
        name, positions = dimension["name"], dimension["positions"]
        labels = [position["label"] for position in positions]
        coordinates[name] = (name, labels, {"long_name": ", ".join(dimension["keys"]) or "case by hand"})
    for dimension in dimensions:
        for key in dimension["keys"] if len(dimension["keys"]) > 1 else ():
            values = [position["changes"][key] for position in dimension["positions"]]
            beside = derived_name(key)
            free = beside not in coordinates and beside not in {*METRICS, *TIMES, *_WORDS}
            if free and all(isinstance(value, str | int | float) for value in values):
                coordinates[beside] = (dimension["name"], values, {"long_name": key})
    return coordinates


def _listed(case: xr.Dataset, name: Any) -> str:
    return ", ".join(repr(label) for label in case[name].values.tolist())


def _said(labels: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {label}" for name, label in labels.items())
