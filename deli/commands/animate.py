"""``deli animate``: the film of a recorded run."""

from pathlib import Path
from typing import Annotated

import typer

from deli.commands.console import RUN_FAILED, complain, console, guarded
from deli.commands.files import NETCDF, require_kind


@guarded
def animate(
    file: Annotated[Path, typer.Argument(metavar="FILE.nc", help="A recorded run, finished or partial.")],
    member: Annotated[int | None, typer.Option(help="Show this member of an ensemble, counted from 0.")] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="GIF|MP4", help="Film to write, .gif or .mp4 (default: FILE.gif)."),
    ] = None,
    fps: Annotated[
        float, typer.Option("--fps", help="Frames a second; for a GIF, 100 divided by a whole number.")
    ] = 25.0,
    duration: Annotated[
        float | None,
        typer.Option("--duration", metavar="SECONDS", help="Length of the film (default: 10, or less for few rows)."),
    ] = None,
    start: Annotated[
        float | None, typer.Option("--start", metavar="T", help="First simulated time to show (default: all).")
    ] = None,
    end: Annotated[
        float | None, typer.Option("--end", metavar="T", help="Last simulated time to show (default: all).")
    ] = None,
    every: Annotated[
        int | None,
        typer.Option("--every", metavar="N", help="Make a frame of every N-th recorded row, in place of a duration."),
    ] = None,
    dpi: Annotated[float, typer.Option("--dpi", help="Pixels an inch; the picture is 6.4 inches wide.")] = 100.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the film if it exists.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Animate a recorded run: the bodies in their places, the time, and the energy error.

    Frames are equidistant in simulated time. An MP4 needs ffmpeg (`pip install '.[movies]'` in a checkout). A file does
    not hold a scene of your own, so that its bodies are drawn as points;
    `deli.plotting.save_animation(run, path, scene)` draws the scene.
    Exit status: 0 done, 1 writing failed or was interrupted (there is no film then), 2 the input is at fault.
    """
    from deli.plotting import check_movie, save_animation
    from deli.plotting.style import known_scene
    from deli.recording.members import member_of
    from deli.simulation import open_run

    target = output or Path(str(file).removesuffix(".partial")).with_suffix(".gif")
    require_kind(file, "animate", "a recorded run", NETCDF)
    check_movie(target, overwrite=overwrite)
    run = open_run(file) if member is None else member_of(open_run(file), member)
    if not quiet and known_scene(run, None) is None:
        console().print("The scene is not one of deli's own: bodies are drawn as points, without walls.")
    try:
        film = save_animation(
            run,
            target,
            fps=fps,
            duration=duration,
            start=start,
            end=end,
            every=every,
            dpi=dpi,
            overwrite=overwrite,
            progress=not quiet,
        )
    except KeyboardInterrupt as stopped:
        complain(stopped)
        raise typer.Exit(RUN_FAILED) from stopped
    if quiet:
        return
    frames, span = len(film.times), f"time {film.times[0]:g} to {film.times[-1]:g}"
    console().print(f"Animated in {target}: {span} in {frames} frames, {frames / film.fps:.3g} s", soft_wrap=True)
    if film.misses_motion:
        console().print(
            "Bodies move to and fro faster than these frames show: end earlier (--end), or play longer (--duration)."
        )
