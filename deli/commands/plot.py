"""``deli plot``: the picture of a recorded run."""

from pathlib import Path
from typing import Annotated

import typer

from deli.commands.console import console, guarded
from deli.commands.files import NETCDF, require_kind


@guarded
def plot(
    file: Annotated[
        Path, typer.Argument(metavar="FILE.nc", help="A recorded run, finished or partial, or an ensemble.")
    ],
    member: Annotated[int | None, typer.Option(help="Draw this member of an ensemble, counted from 0.")] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="PICTURE", help="Picture to write, .png, .pdf or .svg (default: FILE.png)."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the picture if it exists.")] = False,
) -> None:
    """Draw a recorded run: energy, momenta, gaps and solver residuals over time, beside the trajectory.

    An ensemble is drawn without trajectories: up to eight members as a line each, more members as median and range.
    """
    from deli.plotting import check_picture, save
    from deli.recording.members import member_of
    from deli.simulation import open_run

    require_kind(file, "plot", "a recorded run", NETCDF)
    target = output or Path(str(file).removesuffix(".partial")).with_suffix(".png")
    check_picture(target, overwrite=overwrite)
    run = open_run(file)
    save(run if member is None else member_of(run, member), target)
    console().print(f"Drawn in {target}", soft_wrap=True)
