"""``deli report``: what a study found, as a page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from deli.commands.console import console, guarded
from deli.commands.files import FOLDER, STUDY_FOLDER, require_kind
from deli.numerals import numeral
from deli.studies.states import DONE, EXCLUDED

if TYPE_CHECKING:
    import xarray as xr

    from deli.studies.plot_tables import HeatMap


@guarded
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A study's folder, finished or not.")],
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Write what a study found: DIR/report.html, a page that needs no other file, and DIR/report.md.

    Prints the first heat map as a table, and the findings: sentences computed from the data. The report has these,
    the plots that the study's file asks for under `[[plots]]` (or a first look), a table of cases, failures by reason,
    and what ran where. Exit status: 0 done, 2 the input is at fault.
    """
    from deli.studies.findings import findings
    from deli.studies.opening import open_study
    from deli.studies.plot_tables import HeatMap
    from deli.studies.report import plots_of, write_report

    require_kind(folder, "report", "a study's folder", STUDY_FOLDER, FOLDER)
    study = open_study(folder)
    page, text = write_report(study)
    if not quiet:
        maps = [plot for plot in plots_of(study) if isinstance(plot, HeatMap)]
        for plot in maps[:1]:
            _print_map(plot, study)
        console().print("\n".join(f"- {sentence}" for sentence in findings(study)), soft_wrap=True)
        console().print(f"Report in {page} and {text}", soft_wrap=True)


def _print_map(plot: "HeatMap", study: "xr.Dataset") -> None:
    """Print a heat map as a table: a row for each place along its y, a block of columns for each panel."""
    from rich.table import Table
    from rich.text import Text

    from deli.studies.plots import panels_of

    parts = panels_of(plot, study)
    table = Table(title=f"{plot.title}: {study[plot.value].attrs['long_name']}", title_justify="left")
    table.add_column(plot.y)
    for title, part in parts.items():
        for label in part[plot.x].values:
            table.add_column(Text(f"{title}\n{_word(label)}".strip()), justify="right")
    labels = next(iter(parts.values()))[plot.y].values  # fewer than the study's where the plot is restricted
    for place, label in enumerate(labels):
        row = [part.isel({plot.y: place, plot.x: k}) for part in parts.values() for k in range(part.sizes[plot.x])]
        table.add_row(Text(_word(label)), *(Text(_worst(cases, plot.value)) for cases in row))
    console().print(table)


def _worst(cases: "xr.Dataset", value: str) -> str:
    """The metric of largest magnitude of the cases, or how a case stands that has none; excluded ones are no cases."""
    states = [str(state) for state in cases["state"].values.ravel() if state != EXCLUDED]
    unfinished = [state for state in states if state != DONE]
    if not states or unfinished:
        return unfinished[0] if states else EXCLUDED
    return _word(float(abs(cases[value]).max()))


def _word(label: Any) -> str:
    return numeral(label, 3) if isinstance(label, float) else str(label)
