"""The metrics of a case's run, in a file beside the run."""

import functools
import hashlib
import inspect
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import xarray as xr
from pydantic import TypeAdapter, ValidationError

from deli import metrics
from deli.errors import InputError
from deli.recording.reading import read
from deli.recording.schema import build_tree
from deli.recording.whole import write_text
from deli.running.plan import Plan
from deli.studies import exact, timing
from deli.studies.layout import metrics_path, read_json
from deli.studies.timing import time_run

EXACT = "exact"


@dataclass(frozen=True)
class Measured:
    """The content of the file of metrics beside a run.

    Attributes
    ----------
    definition : str
        Name of the definition by which the metrics were computed.
    reference : str or None
        Digest of the reference, or ``exact``.
    metrics : dict
    note : str
        Reason for a missing trajectory error, if the study has a reference.
    """

    definition: str
    reference: str | None
    metrics: Mapping[str, float]
    note: str = ""


_measured = TypeAdapter(Measured)


@functools.cache
def definition() -> str:
    """Return a name for the present definition of the metrics: a digest of its sources."""
    sources = [
        *sorted(Path(inspect.getfile(metrics)).parent.glob("*.py")),
        Path(inspect.getfile(exact)),
        Path(inspect.getfile(timing)),
    ]
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]


def measured(run: Path) -> Measured | None:
    """Read the metrics beside a run, or return None if there are none.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    path = metrics_path(run)
    if not path.exists():
        return None
    try:
        return _measured.validate_python(read_json(path))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the whole"
        raise InputError(f"{path} is damaged: {place}: {first['msg']}; deli study measures the run again.") from error


def measure(path: Path, run: xr.DataTree, reference: str | None, timed: Plan | None = None) -> Measured:
    """Measure a run against its reference, time the steps of the plan `timed`, and write both beside the run."""
    against, note = _reference(path, run, reference)
    try:
        found = metrics.measure(run, against)
    except InputError as error:
        note, found = str(error), metrics.measure(run)
    values = {str(name): float(value) for name, value in found.data_vars.items()}
    if timed is not None and run.attrs["outcome"] == "complete":
        values |= time_run(timed)
    result = Measured(definition(), reference, values, note)
    write_text(metrics_path(path), json.dumps(asdict(result), indent=1))
    return result


def _reference(path: Path, run: xr.DataTree, reference: str | None) -> tuple[xr.DataTree | None, str]:
    if reference is None:
        return None, ""
    if reference == EXACT:
        return exact.exact_run(run), ""
    file = path.with_name(f"{reference}.nc")
    if not file.exists():
        return None, f"the reference {reference} did not finish"
    groups, attributes = read(file)
    if attributes["outcome"] != "complete":
        return None, f"the reference {reference}: {attributes['outcome']}"
    return build_tree(groups, attributes), ""
