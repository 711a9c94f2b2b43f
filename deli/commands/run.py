"""``deli run``: a run of a config, or of a scene as in the paper."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deli.commands.console import RUN_FAILED, complain, console, guarded
from deli.commands.files import CONFIG, require_kind

if TYPE_CHECKING:
    import xarray as xr

    from deli.config import Config

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the config, such as scene.balls=3 or solvers.default=osqp. Repeatable.",
    ),
]


@guarded
def run(
    source: Annotated[str, typer.Argument(metavar="CONFIG.toml|SCENE", help="A config file, or a scene's name.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to record to (default: record.output, or NAME.nc in this folder)."),
    ] = None,
    settings: Settings = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="PNG", help="Also draw the run into this file.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an unfinished run, or start anew if there is none.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the output, and the picture, if they exist.")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check everything, say what would run, and stop.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Run a config or a scene, and record it.

    A scene given by name runs as in the paper. Exit status: 0 done, 1 the run failed or was interrupted (the computed
    rows are in the file), 2 the input is at fault. Ctrl-C or SIGTERM stops the run after the present step; if the step
    takes five seconds more, or a second signal comes, the run stops within the step. A solver that never returns from
    its own code notices no such signal: SIGQUIT ends the process, and the committed rows are in OUTPUT.partial, for
    --resume.
    """
    from deli.commands.tables import print_plan, print_summary
    from deli.running.interrupts import Interrupted
    from deli.simulation import run_plan

    config = read_config(source, settings or [])
    target = output or Path(config.output or f"{Path(source).stem}.nc")
    plan = config.plan(target, resume=resume, overwrite=overwrite)
    if plot is not None:
        from deli.plotting import check_picture

        check_picture(plot, overwrite=overwrite or resume)
    if dry_run:
        print_plan(console(), plan)
        return
    try:
        result = run_plan(plan, progress=not quiet)
    except Interrupted as stopped:
        complain(stopped)
        raise typer.Exit(RUN_FAILED) from stopped
    if not quiet:
        print_summary(console(), result)
        console().print(f"Recorded in {target}{_subproblems(result)}", soft_wrap=True)
    if plot is not None:
        from deli.plotting import save

        save(result, plot)
        if not quiet:
            console().print(f"Drawn in {plot}", soft_wrap=True)
    if result.attrs["outcome"] != "complete":
        complain(f"{result.attrs['outcome']}; {result['trajectory'].sizes['time']} rows are in {target}.")
        raise typer.Exit(RUN_FAILED)


def _subproblems(run: "xr.DataTree") -> str:
    """Return the numbers of recorded and left out subproblems in words."""
    if "subproblems" not in run:
        return ""
    kept, left_out = run["subproblems"].sizes["problem"], int(run["subproblems"]["left_out"])
    return f", with {kept:,} subproblems" + (f" ({left_out:,} more were left out)" if left_out else "")


def read_config(source: str, settings: list[str]) -> "Config":
    """Read a config from a file, or make one from a scene's name."""
    from deli import scenes
    from deli.config import load, parse
    from deli.config.models import listed
    from deli.errors import InputError

    if source in scenes.available():
        return parse({"scene": {"name": source}}, settings)
    require_kind(Path(source), "run", "a run's config (.toml) or a scene's name", CONFIG)
    if source.endswith(".toml") or Path(source).exists():
        return load(source, settings)
    raise InputError(f"{source!r} is neither a file nor a scene; scenes: {listed(source, scenes.available())}.")
