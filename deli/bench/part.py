"""A part of the benchmark: cases to measure, and the columns of their rows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Row = dict[str, Any]
"""Values by the names of a part's columns; ``failed`` is the reason for a case without values."""

Measure = Callable[[], list[Row]]


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    name : str
        Name of the value in a row.
    heading : str
    form : str
        Format of a number, such as ``.2f``; text is shown unchanged.
    compared : bool
        Whether the earlier value and the ratio of the two are shown beside the value.
    """

    name: str
    heading: str
    form: str = ""
    compared: bool = False


@dataclass(frozen=True)
class Part:
    """One part of the benchmark.

    Parameters
    ----------
    name, title : str
    keys : tuple of str
        Names of the columns that identify a row, also among earlier rows.
    columns : tuple of Column
        Columns, those of `keys` first.
    cases : callable
        ``cases(quick)`` returns the cases: labels, and functions that return rows.
    finish : callable
        Function that adds values computed from all rows together.
    more : tuple of Column
        Columns of a second table, after the keys.
    """

    name: str
    title: str
    keys: tuple[str, ...]
    columns: tuple[Column, ...]
    cases: Callable[[bool], list[tuple[str, Measure]]]
    finish: Callable[[list[Row]], None] = lambda rows: None
    more: tuple[Column, ...] = ()

    def key(self, row: Row) -> tuple[Any, ...]:
        """Return the values that identify a row."""
        return tuple(row.get(name) for name in self.keys)
