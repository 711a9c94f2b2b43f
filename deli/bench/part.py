"""What a part of the benchmark is: cases to measure, and how their rows are shown."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Row = dict[str, Any]
"""Values by the names of a part's columns; ``failed`` says why a case has none."""

Measure = Callable[[], list[Row]]


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    name : str
        Of the value in a row.
    heading : str
    form : str
        Format of a number, such as ``.2f``; text is shown as it is.
    compared : bool
        Whether an earlier value and the ratio to it are shown beside it.
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
        Columns that tell rows apart; earlier rows are found by them.
    columns : tuple of Column
        Those of `keys` first.
    cases : callable
        ``cases(quick)`` returns what is measured: labels, and functions that return rows.
    finish : callable
        Adds what follows from all rows together.
    more : tuple of Column
        Of a second table, behind the keys.
    """

    name: str
    title: str
    keys: tuple[str, ...]
    columns: tuple[Column, ...]
    cases: Callable[[bool], list[tuple[str, Measure]]]
    finish: Callable[[list[Row]], None] = lambda rows: None
    more: tuple[Column, ...] = ()

    def key(self, row: Row) -> tuple[Any, ...]:
        """Return what tells a row from others."""
        return tuple(row.get(name) for name in self.keys)
