"""``deli plot``: a recorded run as a picture."""

from pathlib import Path
from typing import Annotated

import typer

from deli.commands.console import console, guarded


@guarded
def plot(
    file: Annotated[
        Path, typer.Argument(metavar="FILE.nc", help="A recorded run, finished or partial, or an ensemble.")
    ],
    member: Annotated[int | None, typer.Option(help="Draw this member of an ensemble, counted from 0.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Picture to write (default: FILE.png).")] = None,
) -> None:
    """Draw a recorded run: energy, momenta, gaps and solver residuals over time, beside the trajectory.

    Of an ensemble: of up to eight members a line each, of more their median and range, without trajectories.
    """
    from deli.plotting import check_picture, save
    from deli.recording.members import member_of
    from deli.simulation import open_run

    target = output or file.with_suffix(".png")
    check_picture(target)
    run = open_run(file)
    save(run if member is None else member_of(run, member), target)
    console().print(f"Drawn into {target}", soft_wrap=True)
