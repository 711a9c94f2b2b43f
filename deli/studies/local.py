"""Cases on this machine: threads, each of which supervises one worker process."""

import os
import queue
import threading
from typing import Any

from deli.studies.model import LimitsTable
from deli.studies.states import WAITING
from deli.studies.supervisor import Supervisor
from deli.studies.worker import Order

Event = tuple[str, str, Any]
"""An event of a run: ``started``, ``step`` or ``ended``, the run's digest, and the step or the end."""


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Local:
    """A scheduler of cases on worker processes of this machine.

    Attributes
    ----------
    events : queue
        Events of the runs, see `Event`.
    workers : int
    """

    def __init__(self, workers: int, limits: LimitsTable) -> None:
        self.events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self.workers, self._limits = workers, limits
        self._orders: queue.SimpleQueue[Order | None] = queue.SimpleQueue()
        self._stopped = threading.Event()
        self._threads: list[threading.Thread] = []

    def submit(self, order: Order) -> None:
        """Run a case as soon as a worker is free."""
        self._orders.put(order)
        if len(self._threads) < self.workers:
            self._threads.append(threading.Thread(target=self._work, name=f"deli-{len(self._threads)}"))
            self._threads[-1].start()

    def stop(self) -> None:
        """Interrupt running cases and begin no others; every submitted case still has an event ``ended``."""
        self._stopped.set()

    def close(self) -> None:
        """End the workers."""
        self.stop()
        for _ in self._threads:
            self._orders.put(None)
        for thread in self._threads:
            thread.join()

    def _work(self) -> None:
        supervisor = Supervisor(self._limits)
        try:
            while (order := self._orders.get()) is not None:
                self.events.put(("ended", order.digest, self._run(supervisor, order)))
        finally:
            supervisor.close()

    def _run(self, supervisor: Supervisor, order: Order) -> dict[str, Any]:
        if self._stopped.is_set():
            return {"state": WAITING}
        self.events.put(("started", order.digest, None))

        def report(step: int) -> None:
            self.events.put(("step", order.digest, step))

        return supervisor.run(order, report, self._stopped.is_set)
