"""The bar that shows how far a run is, how fast it goes and what energy it has lost."""

import sys
import time

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


class ProgressBar:
    """A bar on standard error; shows nothing where that is not a terminal.

    Parameters
    ----------
    name : str
        What is run, in a word.
    steps, done : int
        Steps in total, and those of earlier sessions.
    shown : bool
        Whether to show the bar at all.
    unit : str
        What a step is called.
    """

    def __init__(self, name: str, steps: int, done: int, shown: bool, unit: str = "steps") -> None:
        console = Console(file=sys.stderr)
        self.active = shown and (console.is_terminal or console.is_jupyter)
        self._done, self._unit = done, unit
        if self.active:
            self._progress = Progress(
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=20),
                TaskProgressColumn(),
                TextColumn("{task.fields[rate]}{task.fields[note]}"),
                TimeRemainingColumn(),
                console=console,
                auto_refresh=False,
            )
            self._task = self._progress.add_task(name, total=steps, completed=done, rate="starting", note="")

    def __enter__(self) -> "ProgressBar":
        self._started = time.perf_counter()
        if self.active:
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self.active:
            self._progress.stop()

    def update(self, step: int, energy_error: float | None = None) -> None:
        """Show that `step` steps are done."""
        seconds = max(time.perf_counter() - self._started, 1e-9)
        rate = f"{(step - self._done) / seconds:,.0f} {self._unit}/s"
        note = "" if energy_error is None else f", energy error {energy_error:+.1e}"
        self._progress.update(self._task, completed=step, rate=rate, note=note, refresh=True)
