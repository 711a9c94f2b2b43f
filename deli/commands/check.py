"""``deli check``: the check of a config or of a recorded run."""

from pathlib import Path
from typing import Annotated

import typer

from deli.commands.console import INPUT_AT_FAULT, complain, console, guarded
from deli.commands.files import CONFIG, NETCDF, require_kind
from deli.commands.run import Settings, read_config


@guarded
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A config (.toml), a recorded run or an ensemble.")],
    settings: Settings = None,
) -> None:
    """Check a config or a recorded run without running anything.

    For a config, the command prints the run that it describes. For a recorded run, the command verifies the schema, the
    committed rows, that all values are finite, and, for a scene of deli's own, that energies, momenta and gaps follow
    from the recorded states. For an ensemble, it verifies the same of all members, except for checks that need their
    scenes. Exit status: 0 all checks hold, 2 the input is at fault or a check fails.
    """
    from deli.commands.tables import print_plan

    require_kind(file, "check", "a run's config (.toml) or a recorded run", CONFIG, NETCDF)
    if file.suffix == ".toml":
        config = read_config(str(file), settings or [])
        print_plan(console(), config.plan(config.output, overwrite=True))
        return
    _check_run(file)


def _check_run(file: Path) -> None:
    from rich.table import Table
    from rich.text import Text

    from deli.recording.verify import verify

    findings = verify(file)
    table = Table(show_header=False)
    for finding in findings:
        marks = {True: "ok", False: "WRONG", None: "-"}
        table.add_row(*(Text(cell) for cell in (finding.what, marks[finding.holds], finding.seen)))
    console().print(table)
    wrong = [finding.what for finding in findings if finding.holds is False]
    if wrong:
        complain(f"{file} fails these checks: {', '.join(wrong)}.")
        raise typer.Exit(INPUT_AT_FAULT)
