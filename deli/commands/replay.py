"""``deli replay``: the comparison of backends on recorded subproblems."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deli.commands.console import console, guarded
from deli.commands.files import NETCDF, require_kind

if TYPE_CHECKING:
    import xarray as xr


@guarded
def replay(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE.nc]",
            help="A run recorded with record.subproblems = true (default: deli's library of easy and hard problems).",
        ),
    ] = None,
    backends: Annotated[
        list[str] | None,
        typer.Option(
            "--backends",
            "-b",
            metavar="NAME,...",
            help="Backends, separated by commas; repeatable (default: all installed backends).",
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option("--tolerance", metavar="T", help="Largest scaled KKT residual of a solved problem.")
    ] = 1e-9,
    polish: Annotated[
        bool,
        typer.Option("--polish/--no-polish", help="Polish answers, as runs do, or take the answers of the backend."),
    ] = True,
    limit: Annotated[
        float,
        typer.Option("--limit", metavar="S", help="Time limit of a problem in seconds, and the cost of a failure."),
    ] = 1.0,
    repeat: Annotated[
        int, typer.Option("--repeat", metavar="N", help="Number of solves of each problem; times are medians.")
    ] = 5,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="NC", help="Dataset (netCDF) to write the results to.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="PNG", help="Draw performance profiles and errors into this file.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the output, and the picture, if they exist.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Show neither progress bar nor tables.")] = False,
) -> None:
    """Solve recorded subproblems again with every backend, and report verified accuracy and time.

    An answer is verified if its recomputed KKT residuals are within the tolerance; the backend's own claim is in a
    separate column. Times are from the data to the checked answer, polish included. The mean time is a shifted
    geometric mean, in which an unsolved problem costs the limit. Errors are distances to a reference solution whose
    residuals are rounding errors.

    The worst cases are listed by their index in the file: `deli.load_subproblem(FILE, INDEX)` returns one as a cvxpy
    problem. Exit status: 0 done, 2 the input is at fault.
    """
    from deli.recording.paths import check_output
    from deli.recording.whole import write_tree
    from deli.replaying.replay import replay as solve_again
    from deli.replaying.tables import print_replay

    names = [name.strip() for part in backends for name in part.split(",") if name.strip()] if backends else None
    if file is not None:
        require_kind(file, "replay", "a run with recorded subproblems", NETCDF)
    if output is not None:
        check_output(output, resume=False, overwrite=overwrite)
    if plot is not None:
        from deli.plotting import check_picture

        check_picture(plot, overwrite=overwrite)
    data: xr.Dataset = solve_again(
        file, backends=names, tolerance=tolerance, polish=polish, repeat=repeat, limit=limit, progress=not quiet
    )
    if output is not None:
        write_tree(output, data)
    if not quiet:
        print_replay(console(), data)
    if plot is not None:
        from deli.plotting import save_replay

        save_replay(data, plot)
    for target, done in ((output, "Recorded in"), (plot, "Drawn in")):
        if target is not None and not quiet:
            console().print(f"{done} {target}", soft_wrap=True)
