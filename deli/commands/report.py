"""``deli report``: what a study found, as a page."""

from pathlib import Path
from typing import Annotated

import typer

from deli.commands.console import console, guarded


@guarded
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A study's folder, finished or not.")],
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Write what a study found: DIR/report.html, a page that needs no other file, and DIR/report.md.

    Findings in sentences computed from the data, the plots that the study's file asks for under `[[plots]]` (or a first
    look), a table of cases, failures by reason, and what ran where. Exit status: 0 done, 2 the input is at fault.
    """
    from deli.studies.findings import findings
    from deli.studies.opening import open_study
    from deli.studies.report import write_report

    study = open_study(folder)
    page, text = write_report(study)
    if not quiet:
        console().print("\n".join(f"- {sentence}" for sentence in findings(study)), markup=False, soft_wrap=True)
        console().print(f"Report in {page} and {text}", markup=False, soft_wrap=True)
