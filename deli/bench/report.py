"""Tables of results beside earlier results."""

import math
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from deli.bench.part import Column, Part, Row


def print_part(console: Console, part: Part, now: dict[str, Any], before: dict[str, Any] | None) -> None:
    """Print a part's rows, with the values of earlier rows and the ratios to them if they are known."""
    earlier = {} if before is None else {part.key(row): row for row in before["rows"]}
    keys = tuple(column for column in part.columns if column.name in part.keys)
    for title, columns in ((part.title, part.columns), (None, keys + part.more)):
        rows = [row for row in now["rows"] if any(_known(row, column) for column in columns[len(keys) :])]
        if rows:
            console.print(_table(title, columns, rows, earlier, part))
    for row in now["rows"]:
        if row.get("failed"):
            case = " ".join(str(value) for value in part.key(row) if value is not None)
            console.print(f"{case}: {row['failed']}", markup=False, soft_wrap=True)
    if before is not None and earlier:
        which = " (--quick)" if before["quick"] else ""
        console.print(f"before: {before['date']}{which}, {before['machine']['processor']}", style="dim", markup=False)


def _table(
    title: str | None, columns: tuple[Column, ...], rows: list[Row], earlier: dict[tuple[Any, ...], Row], part: Part
) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    shown = [column for column in columns if any(_known(row, column) for row in rows)]
    for column in shown:
        key = column.name in part.keys
        table.add_column(column.heading, justify="left" if key and not column.form else "right", no_wrap=key)
        if earlier and column.compared:
            table.add_column("before", justify="right", style="dim")
            table.add_column("ratio", justify="right")
    for row in rows:
        table.add_row(*(Text(cell) for cell in _cells(shown, row, earlier, part)))
    return table


def _cells(columns: list[Column], row: Row, earlier: dict[tuple[Any, ...], Row], part: Part) -> list[str]:
    cells = []
    for column in columns:
        value = row.get(column.name)
        cells.append(_text(value, column.form))
        if earlier and column.compared:
            was = earlier.get(part.key(row), {}).get(column.name)
            cells.append(_text(was, column.form))
            cells.append(_text(value / was if value and was else None, ".2f"))
    return cells


def _known(row: Row, column: Column) -> bool:
    return _text(row.get(column.name), column.form) != "–"


def _text(value: Any, form: str) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    return format(value, form) if form and not isinstance(value, str) else str(value)
