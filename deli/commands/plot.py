"""``deli plot``: a recorded run as a picture."""

from pathlib import Path
from typing import Annotated

import typer

from deli.commands.console import console, guarded


@guarded
def plot(
    file: Annotated[Path, typer.Argument(metavar="FILE.nc", help="A recorded run, finished or partial.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Picture to write (default: FILE.png).")] = None,
) -> None:
    """Draw a recorded run: energy, momenta, gaps and solver residuals over time, beside the trajectory."""
    from deli.plotting import check_picture, save
    from deli.simulation import open_run

    target = output or file.with_suffix(".png")
    check_picture(target)
    save(open_run(file), target)
    console().print(f"Drawn into {target}", soft_wrap=True)
