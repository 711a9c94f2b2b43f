"""The progress bar of a run: its steps, its rate and its energy error."""

import sys
import time
import uuid

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Column


class ProgressBar:
    """A bar on standard error, or in the output of a notebook's cell; elsewhere nothing is shown.

    Rate and remaining time come from the steps after the first report, because compiling and loading precede it.

    Parameters
    ----------
    name : str
        Name of the run, in a word.
    steps, done : int
        Number of steps in total, and in earlier sessions.
    shown : bool
        Whether to show the bar at all.
    unit : str
        Name of the steps.
    """

    def __init__(self, name: str, steps: int, done: int, shown: bool, unit: str = "steps") -> None:
        console = Console(file=sys.stderr)
        self._notebook = console.is_jupyter
        self.active = shown and (console.is_terminal or self._notebook)
        self._steps, self._done, self._unit = steps, done, unit
        self._warm: tuple[float, int] | None = None
        if self.active:
            self._progress = Progress(
                TextColumn("{task.description}", markup=False, table_column=Column(max_width=24, no_wrap=True)),
                BarColumn(bar_width=20),
                TaskProgressColumn(),
                TextColumn("{task.fields[rate]}{task.fields[note]}"),
                TimeRemainingColumn(),
                console=console,
                auto_refresh=False,
            )
            self._task = self._progress.add_task(name, total=steps, completed=done, rate="starting", note="")

    def __enter__(self) -> "ProgressBar":
        self._began = time.perf_counter()
        if self.active and self._notebook:
            self._name = uuid.uuid4().hex
            self._display()
        elif self.active:
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self.active and not self._notebook:
            self._progress.stop()

    def update(self, step: int, energy_error: float | None = None) -> None:
        """Show that `step` steps are done."""
        note = "" if energy_error is None else f", energy error {energy_error:+.1e}"
        self._progress.update(self._task, completed=step, rate=self._rate(step), note=note, refresh=True)
        if self._notebook:
            self._display(update=True)

    def _rate(self, step: int) -> str:
        now = time.perf_counter()
        if self._warm is None and step > self._done:
            self._warm = (now, step)
        since, first = self._warm or (now, step)
        if step == first == self._steps:  # done by the first report
            since, first = self._began, self._done
        return "starting" if step == first else f"{(step - first) / max(now - since, 1e-9):,.0f} {self._unit}/s"

    def _display(self, update: bool = False) -> None:
        """Show the present bar; rich itself would need ipywidgets for a bar that changes."""
        from IPython.display import display

        display(self._progress, display_id=self._name, update=update)
