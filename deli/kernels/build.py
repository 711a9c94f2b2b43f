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
from numba.core.caching import FunctionCache

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

logger = logging.getLogger("deli")

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
_lock = threading.Lock()


def ready() -> None:
    """Compile all units that every run needs, or load them."""
    with _lock:
        wanted = [unit for symbol, unit in UNITS.items() if symbol not in _RARE and not unit.compiled]
        if not wanted:
            return
        marker = _marker(wanted[0])
        marker.parent.mkdir(parents=True, exist_ok=True)
        with FileLock(marker.parent / "deli.lock") if not marker.exists() else nullcontext():
            if not marker.exists():  # nor did another process make it while this one waited
                logger.warning("compiling deli for this machine: once, some sixteen seconds on two cores")
                _build(wanted)
            for unit in wanted:
                unit.compile()
            marker.touch()


def sources() -> list[Path]:
    """Return the files whose text decides what the units are compiled to."""
    solvers = Path(solver.__file__).parent
    return [
        *sorted(Path(__file__).parent.glob("*.py")),
        *sorted(solvers.glob("native*.py")),
        solvers / "absorbed.py",
        Path(tables.__file__),
    ]


def _marker(unit: Unit) -> Path:
    """The file that says that units of these sources are on disk."""
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources()))
    digest.update(repr((sys.version, version("numba"), version("llvmlite"), llvm.get_host_cpu_name())).encode())
    return Path(FunctionCache(unit.function).cache_path) / f"deli-{digest.hexdigest()[:16]}"


def _build(units: list[Unit]) -> None:
    """Compile units in as many processes as there are cores.

    None in this one, where code that was linked to units that are merely declared would stay.
    """
    for unit in UNITS.values():  # numba knows a unit by its own file, not by the files of what it absorbs
        FunctionCache(unit.function).flush()
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
