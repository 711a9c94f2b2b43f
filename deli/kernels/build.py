"""Compile the units once for a machine, several at a time, and load them from disk from then on."""

import hashlib
import logging
import os
import subprocess
import sys
import threading
from contextlib import nullcontext
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding as llvm
from filelock import FileLock

from deli.kernels import (
    advance,
    balance,
    collision,
    direct,
    islands,
    landing,
    native,
    nonsmooth_alpha,
    position,
    reflection,
    shadow,
    step,
    turning,
)
from deli.kernels.compiled import UNITS, Unit
from deli.mechanics import tables
from solvers import native as solver
from solvers.kept import cache_of, find_room

logger = logging.getLogger(__name__)

# Units that few runs need: compiled when one does.
_RARE = {
    unit.symbol
    for unit in (
        turning.turn_numerical,
        shadow.turn_shadow,
        shadow.measure_shadow,
        landing.land,
        balance.balance_numerical,
        balance.balance_shadow,
        step.reflect_touching,
        advance.has_strayed,
        direct.substitute,
        nonsmooth_alpha.advance_and_jump,
        collision.collide,
        *collision.collide.needs,
    )
}
# Seconds to compile; others take about half a one.
_COSTS = {
    native.project_program: 4.0,
    position._iterate: 3.8,
    step.step: 2.9,
    reflection.reflect: 2.2,
    islands.connect: 1.5,
    advance.record_state: 1.1,
}
_ROOM = 1 << 23  # bytes on disk, four times what they are
_lock = threading.Lock()


def ready() -> None:
    """Compile all units that every run needs, or load them."""
    with _lock:
        wanted = [unit for symbol, unit in UNITS.items() if symbol not in _RARE and not unit.compiled]
        if not wanted:
            return
        if not _on_disk(wanted[0]):
            _make(wanted)
        for unit in wanted:
            unit.compile()


def sources() -> list[Path]:
    """Return the files whose text decides what the units are compiled to."""
    solvers = Path(solver.__file__).parent
    return [
        *sorted(Path(__file__).parent.glob("*.py")),
        *sorted(solvers.glob("native*.py")),
        *(solvers / f"{name}.py" for name in ("absorbed", "kept", "code_folder")),
        Path(tables.__file__),
    ]


def _make(units: list[Unit]) -> None:
    """Compile units, and put them on disk where there is room for them."""
    folder = find_room(units[0].function, _ROOM)
    with nullcontext() if folder is None else FileLock(folder / "deli.lock"):
        if _on_disk(units[0]):  # another process put them there while this one waited
            return
        logger.warning("compiling deli for this machine: some sixteen seconds on two cores")
        if folder is not None:  # elsewhere, other processes could not leave them
            _build(units)
        for unit in units:
            unit.compile()
        if folder is not None:
            (folder / _marker()).touch()


def _on_disk(unit: Unit) -> bool:
    """Whether units of these sources have been put on disk."""
    folder = cache_of(unit.function).cache_path
    return folder is not None and (Path(folder) / _marker()).exists()


def _marker() -> str:
    """Name of the file that says so."""
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources()))
    digest.update(repr((sys.version, version("numba"), version("llvmlite"), llvm.get_host_cpu_name())).encode())
    return f"deli-{digest.hexdigest()[:16]}"


def _build(units: list[Unit]) -> None:
    """Compile units in as many processes as there are cores.

    None in this one, where code that was linked to units that are merely declared would stay.
    """
    for unit in UNITS.values():  # numba knows a unit by its own file, not by the files of what it absorbs
        cache_of(unit.function).flush()
    count = min(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1, 4)
    shares: list[list[Unit]] = [[] for _ in range(count)]
    for unit in sorted(units, key=_cost, reverse=True):
        min(shares, key=lambda share: sum(map(_cost, share))).append(unit)
    helpers = [
        subprocess.Popen([sys.executable, "-c", _CODE.format(path=sys.path, symbols=[unit.symbol for unit in share])])
        for share in shares
        if share
    ]
    for helper in helpers:
        helper.wait()  # what it could not compile is compiled here, where an error is seen


# Without the garbage collector, which would go through all that numba keeps again and again.
_CODE = """
import gc, sys
gc.disable()
sys.path[:] = {path!r}
from deli.kernels.build import compile_apart
compile_apart({symbols!r})
"""


def compile_apart(symbols: list[str]) -> None:
    """Put units on disk without the units that they call."""
    for unit in UNITS.values():
        unit.declare()
    for symbol in symbols:
        UNITS[symbol].compile_to_disk()


def _cost(unit: Unit) -> float:
    return _COSTS.get(unit, 0.5)
