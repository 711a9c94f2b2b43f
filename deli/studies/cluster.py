"""Cases on a Dask cluster: each Dask worker supervises worker processes of deli's own, as `Local` does."""

import queue
import time
import uuid
from collections.abc import Callable
from typing import Any

from deli.errors import InputError
from deli.studies.local import Event as Happening
from deli.studies.model import LimitsTable
from deli.studies.states import KILLED, WAITING
from deli.studies.supervisor import Supervisor
from deli.studies.worker import Order
from solvers.distribution import install_line

try:
    import distributed
    from distributed import Client, Event, Future, WorkerPlugin
except ImportError as error:
    raise InputError(f"--scheduler needs Dask, which is not installed: {install_line('distributed')}.") from error

CONNECT_SECONDS = 30.0
LOOK_SECONDS = 0.5


class Cluster:
    """A scheduler of cases on Dask workers; see `deli.studies.running.Scheduler`.

    If a Dask worker dies, another one continues its case from the last committed row.
    """

    def __init__(self, address: str, limits: LimitsTable) -> None:
        try:
            self._client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"--scheduler {address}: no Dask scheduler answers there ({error}).") from error
        self.events: queue.SimpleQueue[Happening] = queue.SimpleQueue()
        self._topic = f"deli-study-{uuid.uuid4().hex}"
        self._stop = Event(self._topic, client=self._client)
        self._futures: dict[str, Future] = {}
        self.workers = sum(self._client.nthreads().values())
        if not self.workers:
            self._client.close()
            raise InputError(
                f"--scheduler {address}: the scheduler has no workers; start some (dask worker {address})."
            )
        self._client.subscribe_topic(self._topic, self._hear)
        self._client.register_plugin(_Crew(limits), name=self._topic)

    def submit(self, order: Order) -> None:
        """Run a case as soon as a worker is free."""
        future = self._client.submit(_carry_out, order, self._topic, key=f"{self._topic}-{order.digest}", pure=False)
        self._futures[order.digest] = future
        future.add_done_callback(lambda done: self._end(order.digest, done))

    def stop(self) -> None:
        """Interrupt running cases and begin no others; every submitted case still has an event ``ended``."""
        self._stop.set()

    def close(self) -> None:
        """Disconnect from the cluster; its workers stay."""
        self._client.unregister_worker_plugin(self._topic)
        self._client.unsubscribe_topic(self._topic)
        self._client.close()

    def _hear(self, event: tuple[Any, Any]) -> None:
        kind, digest, what = event[1]
        self.events.put((kind, digest, what))

    def _end(self, digest: str, future: Future) -> None:
        if future.status == "finished":
            ended = future.result()
        else:
            ended = {"state": KILLED, "reason": f"on the cluster: {future.exception() or future.status}"}
        self.events.put(("ended", digest, ended))


class _Crew(WorkerPlugin):
    """The supervisors of one Dask worker: one a thread, kept from case to case."""

    def __init__(self, limits: LimitsTable) -> None:
        self._limits = limits

    def setup(self, worker: "distributed.Worker") -> None:
        """Begin without supervisors."""
        self._idle: queue.SimpleQueue[Supervisor] = queue.SimpleQueue()

    def teardown(self, worker: "distributed.Worker") -> None:
        """End the idle supervisors."""
        while not self._idle.empty():
            self._idle.get().close()

    def run(self, order: Order, report: Callable[[int], None], stopped: Callable[[], bool]) -> dict[str, Any]:
        """Run a case with a free supervisor."""
        try:
            supervisor = self._idle.get_nowait()
        except queue.Empty:
            supervisor = Supervisor(self._limits)
        try:
            return supervisor.run(order, report, stopped)
        finally:
            self._idle.put(supervisor)


def _carry_out(order: Order, topic: str) -> dict[str, Any]:
    """Run a case on a Dask worker."""
    worker = distributed.get_worker()
    stop, looked, found = Event(topic), 0.0, False

    def stopped() -> bool:
        nonlocal looked, found
        if time.monotonic() - looked > LOOK_SECONDS:
            looked, found = time.monotonic(), stop.is_set()
        return found

    if stopped():
        return {"state": WAITING}

    def report(step: int) -> None:
        worker.log_event(topic, ("step", order.digest, step))

    crew: Any = worker.plugins[topic]
    worker.log_event(topic, ("started", order.digest, None))
    ended: dict[str, Any] = crew.run(order, report, stopped)
    return ended
