"""Threads that run the members of an ensemble, each a few at a time."""

import itertools
import math
import queue
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Any

from deli.integrators.systems import bind_systems, shape_of
from deli.kernels.advance import has_strayed
from deli.kernels.record import Record
from deli.mechanics.scene import Scene
from deli.recording.ensemble import Gathering
from deli.running.interrupts import PATIENCE_SECONDS, StopRequests
from deli.running.plan import Plan
from deli.running.progress import ProgressBar
from deli.running.session import COMPLETE, FAILED, INTERRUPTED, REFRESH_SECONDS

_MOST = 128  # members bound at once
_Shape = tuple[int, ...] | None


class Crew:
    """Threads with their own steppers, one for every shape of scene, and therefore their own compiled problems.

    Attributes
    ----------
    outcomes : list of str
        Outcome of each member.
    backends : set of str
        Names of the backends that have solved something.
    """

    def __init__(self, plan: Plan, scenes: list[Scene], gathering: Gathering, workers: int) -> None:
        self._plan, self._scenes, self._gathering = plan, scenes, gathering
        self._workers = min(workers, len(scenes))
        self._first = plan.stepper()  # refuses arguments that do not fit together, before any thread begins
        if any(scene.unilateral.searched for scene in scenes):
            has_strayed.compile()  # before several threads do so at once
        self._chunks = deque(_chunks(len(scenes), self._workers))
        self._stopped, self._lock = False, threading.Lock()
        self._at: dict[int, int] = {}  # the member that each thread works on
        self._ended: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._errors: list[BaseException] = []
        self.outcomes = [f"{INTERRUPTED} before step 1"] * len(scenes)
        self.backends: set[str] = set()

    def run(self, stop: StopRequests, bar: ProgressBar) -> None:
        """Run all members, or until a signal asks for a stop; a member whose step does not end then is abandoned."""
        for number in range(self._workers):
            threading.Thread(target=self._try, args=(number,), name=f"deli_{number}", daemon=True).start()
        try:
            self._watch(stop, bar)
        except KeyboardInterrupt:
            stop.reason = stop.reason or "SIGINT"
            self._stopped = True
            time.sleep(REFRESH_SECONDS)
        for member in list(self._at.values()):
            if self.outcomes[member].startswith(INTERRUPTED):
                step = self._gathering.steps_taken[member]
                self.outcomes[member] = f"{INTERRUPTED} after step {step}, in the middle of the next"
        if self._errors:
            raise self._errors[0]

    def _keep_backends(self, *steppers: Any) -> None:
        with self._lock:
            self.backends.update(*(stepper.backends for stepper in steppers))

    def _watch(self, stop: StopRequests, bar: ProgressBar) -> None:
        """Wait for all threads to end; once they were told to stop, wait no longer than `PATIENCE_SECONDS`."""
        working, told = self._workers, math.inf
        while working and time.monotonic() < told + PATIENCE_SECONDS:
            with suppress(queue.Empty):  # unlike a thread's join, it stays correct when a signal interrupts it
                self._ended.get(timeout=REFRESH_SECONDS)
                working -= 1
            if not self._stopped and (stop.reason is not None or self._errors):
                self._stopped, told = True, time.monotonic()
            if bar.active:
                bar.update(int(self._gathering.steps_taken.sum()))

    def _try(self, number: int) -> None:
        try:
            self._work(number)
        except BaseException as error:
            self._errors.append(error)
        finally:
            self._at.pop(number, None)
            self._ended.put(number)

    def _work(self, number: int) -> None:
        steppers: dict[_Shape, Any] = {shape_of(self._scenes[0]): self._first} if number == 0 else {}
        while not self._stopped:
            try:
                chunk = self._chunks.popleft()
            except IndexError:
                break
            for shape, members in itertools.groupby(chunk, lambda member: shape_of(self._scenes[member])):
                self._run_alike(number, steppers, shape, list(members))
        self._keep_backends(*steppers.values())

    def _run_alike(self, number: int, steppers: dict[_Shape, Any], shape: _Shape, members: list[int]) -> None:
        """Run members of one shape in a thread, by the stepper of that shape."""
        plan, scenes = self._plan, [self._scenes[member] for member in members]
        systems = None if shape is None else bind_systems(scenes, self._first.implicit)
        for place, (member, scene) in enumerate(zip(members, scenes, strict=True)):
            if self._stopped:
                return
            block = self._gathering.block(member)
            self._at[number] = member
            try:
                if shape not in steppers:
                    steppers[shape] = plan.stepper(scene)
                steppers[shape].switch(scene, None if systems is None else systems.addresses[place])
                self.outcomes[member] = self._run(steppers[shape], scene, block)
            except Exception as error:  # an error of a user's function stops its own member only
                self.outcomes[member] = self._failure(block, f"{type(error).__name__}: {error}")
            if self.outcomes[member] != COMPLETE and shape in steppers:
                self._keep_backends(steppers.pop(shape))  # the failed step may have left its arrays unfinished

    def _run(self, stepper: Any, scene: Scene, block: Record) -> str:
        plan, progress = self._plan, block.fields.progress
        stepper.place(scene.position, scene.momentum)
        stepper.record(block)
        while progress[0] < plan.steps:
            if self._stopped:
                return f"{INTERRUPTED} after step {progress[0]}"
            error = stepper.advance(block, plan.steps, plan.every, time.monotonic() + REFRESH_SECONDS)
            if error is not None:
                return self._failure(block, str(error))
        return COMPLETE

    def _failure(self, block: Record, why: str) -> str:
        step = int(block.fields.progress[0])
        return f"{FAILED} in step {step + 1} (from time {step * self._plan.step_size:.9g}): {why}"


def _chunks(members: int, workers: int) -> list[range]:
    """Return ranges of members, smaller towards the end, so that all threads end at about the same time."""
    chunks, begin = [], 0
    while begin < members:
        size = max(1, min(_MOST, (members - begin) // (2 * workers)))
        chunks.append(range(begin, begin + size))
        begin += size
    return chunks
