"""Supervision of one worker process: it gets cases, is watched, and is killed if it exceeds its limits."""

import json
import logging
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import psutil

from deli.studies.model import LimitsTable
from deli.studies.states import FAILED, INTERRUPTED, KILLED, OUT_OF_MEMORY, TIMED_OUT
from deli.studies.worker import Order, line_of

POLL_SECONDS = 0.05
GRACE_SECONDS = 10.0
"""The time a worker has to end its step and write its rows."""
WARM_UP_SECONDS = 60.0
"""The time allowed for compiling and loading before a case's own time begins to count."""
SWOLLEN = 0.1
"""The share of the memory limit that a worker may keep from earlier cases."""

_CODE = "import sys; sys.path[:] = {path!r}; from deli.studies.worker import main; main()"
_THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA", "RAYON", "VECLIB", "NUMEXPR")

Ended = dict[str, Any]
"""The end of a case: state, reason, seconds, and attributes of the run from the worker."""


class Supervisor:
    """A supervisor that runs cases in a process of its own and replaces a process that died."""

    def __init__(self, limits: LimitsTable) -> None:
        self._limits = limits
        self._process: subprocess.Popen[str] | None = None

    def run(self, order: Order, report: Callable[[int], None], stopped: Callable[[], bool]) -> Ended:
        """Run one case; pass its step to `report`, and interrupt it as soon as `stopped` returns True.

        The first report is the step from which the run starts or continues, after its code is compiled and loaded.
        """
        if self._process is None or self._process.poll() is not None or self._swollen(self._process):
            self.close()
            self._start()
        process = self._process
        assert process is not None
        ended = self._await_ready(process, stopped) or self._watch(process, order, report, stopped)
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        return {"seconds": order.spent, **ended, "load": load}

    def close(self) -> None:
        """End the process."""
        if self._process is None:
            return
        process, self._process = self._process, None
        assert process.stdin is not None
        with suppress(BrokenPipeError):
            process.stdin.close()
        try:
            process.wait(GRACE_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._reader.join()
        assert process.stdout is not None
        process.stdout.close()
        self._errors.close()

    def _start(self) -> None:
        self._errors = tempfile.TemporaryFile(mode="w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        self._answers: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._process = subprocess.Popen(
            [sys.executable, "-c", _CODE.format(path=sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env={**os.environ, **{f"{library}_NUM_THREADS": "1" for library in _THREADS}},
            start_new_session=True,  # Ctrl-C in a terminal reaches the supervising process alone
        )
        self._reader = threading.Thread(target=self._read, args=(self._process,), daemon=True)
        self._reader.start()
        self._ready, self._resident, self._heard = False, 0, 0

    def _swollen(self, process: "subprocess.Popen[str]") -> bool:
        """Tell whether the worker holds memory of earlier cases that would count against the limit of the next case.

        Memory of libraries that were loaded for earlier cases does not count: a new process would load them again.
        """
        limit, resident = self._limits.memory, _memory(process.pid)
        self._resident = min(self._resident, resident)  # a case's arrays are freed with it
        return limit is not None and resident - self._resident > SWOLLEN * limit

    def _read(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        for line in process.stdout:
            self._answers.put(json.loads(line))
        self._answers.put(None)

    def _next(self) -> dict[str, Any] | None:
        """Return the next answer, {} if there is none yet, None if there will be none."""
        try:
            return self._answers.get(timeout=POLL_SECONDS)
        except queue.Empty:
            return {}

    def _await_ready(self, process: "subprocess.Popen[str]", stopped: Callable[[], bool]) -> Ended | None:
        while not self._ready:
            answer = self._next()
            _pass_on(answer)
            if answer is None:
                return {"state": FAILED, "reason": f"the worker did not start: {self._died(process)}"}
            if stopped():
                return {"state": INTERRUPTED, "reason": "before it began"}
            self._ready = "ready" in answer
            self._resident = _memory(process.pid)
        return None

    def _watch(
        self,
        process: "subprocess.Popen[str]",
        order: Order,
        report: Callable[[int], None],
        stopped: Callable[[], bool],
    ) -> Ended:
        assert process.stdin is not None
        self._heard, held = os.fstat(self._errors.fileno()).st_size, _memory(process.pid)
        try:
            process.stdin.write(line_of(order))
            process.stdin.flush()
        except BrokenPipeError:
            return {"state": KILLED, "reason": self._died(process)}
        began = time.monotonic()
        limits, cause, give_up, peak, ready = self._limits, None, float("inf"), 0, WARM_UP_SECONDS
        while True:
            answer = self._next()
            _pass_on(answer)
            peak = max(peak, _memory(process.pid))
            if answer is None or "ended" in answer:
                ended = {"state": KILLED, "reason": self._died(process)} if answer is None else answer["ended"]
                if cause is not None:
                    self.close()  # a signal may be on its way to it still
                    ended |= cause if ended["state"] in (KILLED, INTERRUPTED) else {}
                return {**ended, "memory": peak, "seconds": order.spent + time.monotonic() - began}
            if "step" in answer:
                report(answer["step"])
            now = time.monotonic()
            if "began" in answer:
                began, ready = now, 0.0
                self._resident += max(0, _memory(process.pid) - held)
            if cause is None:
                if limits.memory is not None and peak > limits.memory:
                    cause = {
                        "state": OUT_OF_MEMORY,
                        "reason": f"{peak / 1e6:.0f} MB, limit {limits.memory / 1e6:.0f} MB",
                    }
                    process.kill()
                elif limits.time is not None and order.spent + now - began > limits.time + ready:
                    cause = {"state": TIMED_OUT, "reason": f"limit {limits.time:g} s"}
                elif stopped():
                    cause = {"state": INTERRUPTED, "reason": ""}
                if cause is not None:
                    process.terminate()
                    give_up = now + GRACE_SECONDS
            elif now > give_up:
                process.kill()

    def _died(self, process: "subprocess.Popen[str]") -> str:
        """Return the cause of the worker's end, and its last line on standard error if it is of the present case."""
        code = process.wait()
        self._errors.seek(self._heard)
        said = self._errors.read().strip().splitlines()[-1:]
        try:
            how = f"by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
        except ValueError:
            how = f"by signal {-code}"
        return ": ".join([how, *said])


def _pass_on(answer: dict[str, Any] | None) -> None:
    """Log a message of the worker in this process."""
    if answer and "told" in answer:
        name, message = answer["told"]
        logging.getLogger(name).warning(message)


def _memory(pid: int) -> int:
    """Return the resident memory of a process in bytes, 0 if it is gone."""
    try:
        return int(psutil.Process(pid).memory_info().rss)
    except psutil.Error:
        return 0
