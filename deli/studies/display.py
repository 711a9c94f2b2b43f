"""The display of a running study: a live table on a terminal, elsewhere a line for each run that ends."""

import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
from rich.table import Table
from rich.text import Text

from deli.studies.planning import KEEP, RUN, Decision
from deli.studies.states import DONE

REFRESH_SECONDS = 0.25


@dataclass
class _Shown:
    """A run under way: the time of its beginning, and the time and step of its first report."""

    decision: Decision
    begun: float
    step: int = 0
    heard: float = 0.0
    warm: tuple[float, int] | None = None

    def take(self, step: int) -> None:
        """Note a step; the first report comes after the run's code is compiled and loaded."""
        self.step, self.heard = step, time.monotonic()
        self.warm = self.warm or (self.heard, step)

    @property
    def spent(self) -> tuple[float, int]:
        """Seconds and steps since the first report."""
        since, first = self.warm or (self.heard, self.step)
        return self.heard - since, self.step - first


class Board:
    """A watcher that shows running and ended runs and estimates the remaining time; progress is counted in steps.

    On a terminal it is a live table on standard error, elsewhere a line on standard output for each run that ends. The
    estimate uses the steps that runs took after compiling and loading.
    """

    def __init__(self, decisions: Sequence[Decision]) -> None:
        self._todo = [decision for decision in decisions if decision.action != KEEP]
        self._work = sum(map(_work, self._todo))
        self._running: dict[str, _Shown] = {}
        self._ended, self._failed, self._behind, self._at_once = 0, 0, 0, 1
        self._seconds, self._taken = 0.0, 0
        self._drawn = 0.0
        console = Console(file=sys.stderr)
        self._live: Live | None = None
        if console.is_terminal and self._todo:
            self._progress = Progress(
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=24),
                TaskProgressColumn(),
                TextColumn("{task.fields[left]}"),
                console=console,
            )
            self._task = self._progress.add_task("starting", total=self._work, left="")
            self._live = Live(self._drawing(), console=console, auto_refresh=False, transient=True)

    def __enter__(self) -> "Board":
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._live is not None:
            self._live.stop()

    def started(self, decision: Decision) -> None:
        """See `deli.studies.running.Watcher`."""
        self._running[decision.case.digest] = _Shown(decision, time.monotonic())
        self._at_once = max(self._at_once, len(self._running))

    def step(self, decision: Decision, step: int) -> None:
        """See `deli.studies.running.Watcher`."""
        if decision.case.digest in self._running:
            self._running[decision.case.digest].take(step)

    def ended(self, decision: Decision, record: dict[str, Any]) -> None:
        """See `deli.studies.running.Watcher`."""
        shown = self._running.pop(decision.case.digest, None)
        if shown is not None and shown.warm is not None:
            if record["state"] == DONE:
                shown.take(decision.case.steps)
            self._seconds, self._taken = self._seconds + shown.spent[0], self._taken + shown.spent[1]
        self._ended += 1
        self._behind += _work(decision)
        self._failed += record["state"] != DONE
        how = f": {record['reason']}" if record["reason"] else ""
        line = f"[{self._ended}/{len(self._todo)}] {record['state']} in {_short(record['seconds'])}: "
        line += f"{decision.case.title} ({decision.why}){how}"
        if self._live is None:
            print(f"{line}; {self._left()}" if self._ended < len(self._todo) else line, flush=True)
        elif record["state"] != DONE:
            self._live.console.print(Text(line))

    def tick(self) -> None:
        """See `deli.studies.running.Watcher`."""
        if self._live is None or time.monotonic() - self._drawn < REFRESH_SECONDS:
            return
        self._drawn = time.monotonic()
        failed = f", {self._failed} not done" if self._failed else ""
        said = f"{self._ended} of {len(self._todo)} runs{failed}"
        self._progress.update(self._task, completed=self._steps, description=said, left=self._left())
        self._live.update(self._drawing(), refresh=True)

    @property
    def _steps(self) -> int:
        return self._behind + sum(shown.step for shown in self._running.values())

    def _left(self) -> str:
        """Estimate the time of the remaining steps, with as many runs at once as so far."""
        spent = [shown.spent for shown in self._running.values()]
        seconds, taken = self._seconds + sum(s for s, _ in spent), self._taken + sum(n for _, n in spent)
        if not taken:
            return "compiling and loading"
        at_once = max(min(self._at_once, len(self._todo) - self._ended), 1)
        return f"about {_short(seconds / taken * (self._work - self._steps) / at_once)} left"

    def _drawing(self) -> Group:
        table = Table("running", "steps", "for", "why")
        for shown in self._running.values():
            decision = shown.decision
            share = f"{100 * shown.step // max(decision.case.steps, 1)} %" if shown.warm else "compiling, loading"
            cells = (decision.case.title, share, _short(time.monotonic() - shown.begun), decision.why)
            table.add_row(*(Text(cell) for cell in cells))
        return Group(table, self._progress)


def reasons(decisions: Sequence[Decision]) -> str:
    """Say in a line how many runs are to be done, and why."""
    todo = [decision for decision in decisions if decision.action != KEEP]
    if not todo:
        return f"nothing to do: all {len(decisions)} runs are recorded"
    counts = Counter(decision.why.partition(":")[0] for decision in todo)
    said = ", ".join(f"{count} {why}" for why, count in counts.items())
    return f"{len(todo)} of {len(decisions)} runs to do: {said}"


def _work(decision: Decision) -> int:
    return decision.case.steps if decision.action == RUN else 1


def _short(seconds: float) -> str:
    if seconds < 99.5:
        return f"{seconds:.2g} s"
    return f"{seconds / 60:.0f} min" if seconds < 5970 else f"{seconds / 3600:.1f} h"
