"""The process that runs cases one after another; orders and answers are lines of JSON.

It ends at the end of its input. A run under way then stops after its step, and its rows are kept.
"""

import json
import logging
import math
import os
import queue
import signal
import sys
import threading
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TextIO

from deli.kernels import LOGGERS

REPORT_SECONDS = 0.25
PATIENCE_SECONDS, RETRY_SECONDS = 20.0, 0.1

_met: set[tuple[str, ...]] = set()


@dataclass(frozen=True)
class Order:
    """A case to run.

    Attributes
    ----------
    digest, file : str
        Name of the case, and the file of its run.
    config : dict
    reference : str or None
        Digest of the reference, or ``exact``.
    fresh : bool
        Whether to drop recorded rows; otherwise an unfinished run is continued, and a finished one only measured.
    spent : float
        Seconds that the run took before it was interrupted.
    timed : bool
        Whether to time the steps of the case, too.
    """

    digest: str
    file: str
    config: dict[str, Any]
    reference: str | None
    fresh: bool
    spent: float = 0.0
    timed: bool = False


def main() -> None:
    """Carry out orders from standard input until it ends."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1, encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # output of libraries is no answer
    orders: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    busy = threading.Event()
    threading.Thread(target=_listen, args=(orders, busy), daemon=True).start()
    for name in LOGGERS:
        logging.getLogger(name).addHandler(_Told(answers))
    _prepare()
    _say(answers, ready=True)
    while (line := orders.get()) is not None:
        busy.set()
        _say(answers, ended=_carry_out(Order(**json.loads(line)), answers))
        busy.clear()


def _listen(orders: "queue.SimpleQueue[str | None]", busy: threading.Event) -> None:
    for line in sys.stdin:
        orders.put(line)
    orders.put(None)
    if busy.is_set():
        os.kill(os.getpid(), signal.SIGTERM)


def _prepare() -> None:
    """Import and compile the code that all runs need."""
    import deli.config
    import deli.simulation
    import deli.studies.measuring  # noqa: F401
    from deli.kernels.build import ready

    ready()


def _carry_out(order: Order, answers: TextIO) -> dict[str, Any]:
    """Run a case and measure it; return its end."""
    from deli.recording.holding import RecordingError
    from deli.running.interrupts import Interrupted
    from deli.studies.states import DONE, FAILED, INTERRUPTED, OUT_OF_MEMORY

    reported = -math.inf

    def report(step: int) -> None:
        nonlocal reported
        if time.monotonic() - reported > REPORT_SECONDS:
            reported = time.monotonic()
            _say(answers, step=step)

    try:
        _warm_up(order)
        _say(answers, began=True)
        attributes = _run(order, report)
    except Interrupted as stopped:
        return {"state": INTERRUPTED, "reason": stopped.run.attrs["outcome"]}
    except RecordingError as error:  # no fault of the case: a rerun continues it from its last committed row
        return {"state": INTERRUPTED, "reason": str(error)}
    except MemoryError as error:
        return {"state": OUT_OF_MEMORY, "reason": str(error) or "the system refused more memory"}
    except Exception as error:  # any error ends this case alone, and no other case
        return {"state": FAILED, "reason": f"{type(error).__name__}: {error}"}
    outcome = attributes["outcome"]
    state, reason = (DONE, "") if outcome == "complete" else (FAILED, outcome)
    return {"state": state, "reason": reason, **attributes}


def _warm_up(order: Order) -> None:
    """Take a step if the kind of run is new to this process: compiling and loading are no part of a case's time."""
    from deli.config import parse
    from deli.errors import StepError

    config = order.config
    backends = [str(solver["backend"]) for solver in config["solvers"].values()]
    kind = (config["scene"]["name"], json.dumps(config["method"], sort_keys=True), str(config["skip"]), *backends)
    if kind in _met:
        return
    _met.add(kind)
    plan = parse(order.config).plan()
    with suppress(StepError):  # the run itself will report it
        plan.stepper().step(plan.scene.position, plan.scene.momentum)


def _run(order: Order, report: Any) -> dict[str, str]:
    import tomli_w

    from deli.config import parse
    from deli.recording.holding import Busy
    from deli.recording.whole import write_text
    from deli.simulation import run_plan
    from deli.studies.layout import config_path
    from deli.studies.measuring import measure

    path = Path(order.file)
    write_text(config_path(path), tomli_w.dumps(order.config))
    deadline = time.monotonic() + PATIENCE_SECONDS
    while True:
        try:
            plan = parse(order.config).plan(path, resume=not order.fresh, overwrite=order.fresh)
            run = run_plan(plan, report)
            break
        except Busy:  # a worker whose scheduler died may still be at its last rows
            if time.monotonic() > deadline:
                raise
            time.sleep(RETRY_SECONDS)
    measure(path, run, order.reference, plan if order.timed else None)
    return {key: run.attrs[key] for key in ("outcome", "deli_version", "backend_versions", "machine")}


class _Told(logging.Handler):
    """A handler that sends log messages to the supervisor."""

    def __init__(self, answers: TextIO) -> None:
        super().__init__(logging.WARNING)
        self._answers = answers

    def emit(self, record: logging.LogRecord) -> None:
        _say(self._answers, told=[record.name, record.getMessage()])


def _say(answers: TextIO, **message: Any) -> None:
    with suppress(BrokenPipeError):  # the supervisor is gone, and `_listen` has noticed it, too
        answers.write(json.dumps(message) + "\n")


def line_of(order: Order) -> str:
    """Return an order as a line."""
    return json.dumps(asdict(order)) + "\n"
