"""The time of a start: imports, help, and a first run."""

import os
import subprocess
import sys
import tempfile
import time

import numpy as np

from deli.bench.part import Column, Measure, Part, Row
from solvers.code_folder import SETTING, SHARED

REPEAT, QUICK_REPEAT = 5, 3
LIMIT = 600.0
_IMPORT = ("-c", "import deli")
_HELP = ("-m", "deli", "--help")
_RUN = (
    "-c",
    "import deli; deli.simulate(deli.scenes.newtons_cradle(), deli.GVI(), step_size=0.01, steps=200)",
)


def _cases(quick: bool) -> list[tuple[str, Measure]]:
    repeat = QUICK_REPEAT if quick else REPEAT
    cases: list[tuple[str, Measure]] = [
        ("import deli", lambda: [_row("import deli", _median(_IMPORT, repeat))]),
        ("deli --help", lambda: [_row("deli --help", _median(_HELP, repeat))]),
        ("run, compiled code on disk", lambda: [_row("run, compiled code on disk", _median(_RUN, repeat))]),
    ]
    return cases if quick else [*cases, ("run, nothing compiled", lambda: [_row("run, nothing compiled", _cold())])]


def _row(what: str, seconds: float) -> Row:
    return {"what": what, "seconds": seconds}


def _median(arguments: tuple[str, ...], repeat: int) -> float:
    """Return the median seconds of new processes, after one that warms up caches."""
    _seconds(arguments)
    return float(np.median([_seconds(arguments) for _ in range(repeat)]))


def _cold() -> float:
    with tempfile.TemporaryDirectory() as empty:
        return _seconds(_RUN, **{SETTING: empty, SHARED: empty})


def _seconds(arguments: tuple[str, ...], **variables: str) -> float:
    environment = {**os.environ, **variables}
    began = time.perf_counter()
    subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, check=True, timeout=LIMIT)
    return time.perf_counter() - began


PART = Part(
    name="import",
    title="seconds of a new process",
    keys=("what",),
    columns=(Column("what", "process"), Column("seconds", "seconds", ".2f", compared=True)),
    cases=_cases,
)
