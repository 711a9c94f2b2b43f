"""The measurement of parts, case by case; a failed case is a row with the reason."""

import sys

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from deli.bench.part import Part, Row


def measure(part: Part, quick: bool, shown: bool) -> list[Row]:
    """Return a part's rows.

    Parameters
    ----------
    part : Part
    quick : bool
        Whether to take few and short measurements.
    shown : bool
        Whether to show a bar, where standard error is a terminal.
    """
    console = Console(file=sys.stderr)
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=20), MofNCompleteColumn(), TimeElapsedColumn())
    cases, rows = part.cases(quick), list[Row]()
    with Progress(*columns, console=console, transient=True, disable=not (shown and console.is_terminal)) as progress:
        task = progress.add_task(part.name, total=len(cases))
        for label, function in cases:
            progress.update(task, description=f"{part.name}: {label}")
            try:
                rows += function()
            except Exception as error:
                text = str(error).splitlines() or [""]
                rows.append({part.keys[0]: label, "failed": f"{type(error).__name__}: {text[0]}"})
            progress.advance(task)
    part.finish(rows)
    return rows
