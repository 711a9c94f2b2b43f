"""Animations for notebooks and files."""

import os
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter, FuncAnimation
from matplotlib.colors import to_rgb
from PIL import Image

from deli.errors import DeliError, InputError
from deli.mechanics.scene import Scene
from deli.memory import require_memory
from deli.plotting.lines import COLORS
from deli.plotting.picture import Picture
from deli.plotting.playback import FPS, choose_rows, misses_motion
from deli.plotting.style import STYLE, check_folder, known_scene
from deli.recording.paths import partial_path
from deli.recording.schema import TRAJECTORY, dataset_of
from deli.running.interrupts import StopRequests
from deli.running.progress import ProgressBar
from solvers.distribution import install_line

SUFFIXES = (".gif", ".mp4")
DPI = 100
SHADES = 128  # colours of a GIF; flat colours with soft edges need no more
GIF_SLOWEST, GIF_FASTEST = 100.0 / 65535.0, 50.0
"""Frames a second: the least rate that the format holds, and the largest rate that browsers do not slow down."""
GIF_BYTES = 2
"""Bytes of memory for each pixel of each frame; all frames are written together."""


Frames = Iterable[np.ndarray]


class Film(NamedTuple):
    """The times and the rate of a written animation.

    Attributes
    ----------
    times : numpy.ndarray
        The simulated time of each frame.
    fps : float
        Frames a second.
    misses_motion : bool
        Whether bodies move to and fro faster than the frames show.
    """

    times: np.ndarray
    fps: float
    misses_motion: bool


def animate(
    run: xr.DataTree,
    scene: Scene | None = None,
    *,
    fps: float = FPS,
    duration: float | None = None,
    start: float | None = None,
    end: float | None = None,
    every: int | None = None,
) -> FuncAnimation:
    """Animate the bodies, uniformly in simulated time; ``.to_jshtml()`` plays the animation in a notebook.

    Bodies are drawn with their radii, among walls, rods and springs; the energy error is drawn below. In one dimension,
    bodies stand on a vertical line, beside their positions over time. In a periodic box, bodies are drawn inside the
    box, except with rods or springs.

    Parameters
    ----------
    run : xarray.DataTree
        From `deli.simulate` or `deli.open_run`.
    scene : deli.Scene, optional
        Scene with walls, rods and radii (default: the run's, if it is one of deli's own, else bodies are points).
    fps : float
        Frames a second of playback.
    duration : float, optional
        Seconds of playback (default: 10, or less if the run has too few rows).
    start, end : float, optional
        Simulated time to show (default: the recorded time).
    every : int, optional
        Number of rows from frame to frame, in place of a duration.

    Returns
    -------
    matplotlib.animation.FuncAnimation

    Raises
    ------
    InputError
        If a number is out of range, no row lies between ``start`` and ``end``, or the scene is not the run's.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> film = deli.plotting.animate(run, every=50)
    >>> len(list(film.new_frame_seq()))
    2
    >>> text = film.to_jshtml()
    """
    rows = choose_rows(_times(run), fps=fps, duration=duration, start=start, end=end, every=every)
    with matplotlib.rc_context(STYLE):
        picture = Picture(run, known_scene(run, scene), rows, DPI)
    return FuncAnimation(picture.figure, picture.show, frames=picture.frames, interval=1000.0 / fps)


def save_animation(
    run: xr.DataTree,
    path: str | os.PathLike[str],
    scene: Scene | None = None,
    *,
    fps: float = FPS,
    duration: float | None = None,
    start: float | None = None,
    end: float | None = None,
    every: int | None = None,
    dpi: float = DPI,
    overwrite: bool = False,
    progress: bool = False,
) -> Film:
    """Write an animation into a GIF or an MP4 file, which appears under its name when it is complete; see `animate`.

    Parameters
    ----------
    path
        File to write, .gif or .mp4.
    fps
        Frames a second; a GIF takes the nearest rate that it can hold, 100 divided by a whole number.
    dpi
        Pixels an inch; the picture is 6.4 inches wide.
    overwrite
        Whether to replace an existing file.
    progress
        Whether to show a bar on standard error.

    Returns
    -------
    Film
        Times and rate of the frames.

    Raises
    ------
    InputError
        If `animate` refuses its arguments, the file exists, cannot be written or has another suffix, or ffmpeg is
        missing for an MP4.
    DeliError
        If writing fails after it has begun.
    KeyboardInterrupt
        On SIGINT or SIGTERM; no file is left then.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> with TemporaryDirectory() as folder:
    ...     film = deli.plotting.save_animation(run, Path(folder, "pogo.gif"), every=25, dpi=50)
    >>> film.times.round(9).tolist()
    [0.0, 2.5, 5.0]
    """
    target = Path(path)
    check_movie(target, overwrite=overwrite)
    if not (np.isfinite(dpi) and 10.0 <= dpi <= 1000.0):
        raise InputError(f"dpi: found {dpi!r}; pass 10 to 1000 pixels an inch.")
    gif = target.suffix.lower() == ".gif"
    rate = gif_rate(fps) if gif else fps
    time = _times(run)
    rows = choose_rows(time, fps=rate, duration=duration, start=start, end=end, every=every)
    with matplotlib.rc_context(STYLE):
        picture = Picture(run, known_scene(run, scene), rows, dpi)
        if gif:
            across, up = (round(pixels) for pixels in picture.figure.bbox.size)
            what = f"{picture.frames:,} frames of {across} x {up} pixels"
            require_memory(what, GIF_BYTES * picture.frames * across * up, "pass fewer, a smaller dpi, or .mp4")
        with ProgressBar(target.name, picture.frames, 0, progress, unit="frames") as bar:
            _write(picture, target, rate, _write_gif if gif else _write_mp4, bar)
    return Film(time[rows], rate, misses_motion(_positions(run), rows))


def check_movie(path: Path, *, overwrite: bool) -> None:
    """Refuse a file of an animation that exists or cannot be written.

    Raises
    ------
    InputError
        If the suffix is neither .gif nor .mp4, the folder is missing or unwritable, the file exists and may not be
        overwritten, or ffmpeg is missing for an MP4.

    Examples
    --------
    >>> from pathlib import Path
    >>> import deli
    >>> deli.plotting.check_movie(Path("run.avi"), overwrite=False)
    Traceback (most recent call last):
    ...
    deli.errors.InputError: animation run.avi: found the suffix '.avi'; allowed: .gif, .mp4.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"animation {path}: found the suffix {path.suffix!r}; allowed: {', '.join(SUFFIXES)}.")
    check_folder("animation", path)
    if path.is_dir():
        raise InputError(f"animation {path} is a folder; name a file, such as {path / 'run.gif'}.")
    if path.exists() and not overwrite:
        raise InputError(f"animation {path} exists; name another, or replace it (overwrite=True, --overwrite).")
    if path.suffix.lower() == ".mp4":
        ffmpeg()


def ffmpeg() -> str:
    """Return the path of ffmpeg, from the search path or the package imageio-ffmpeg.

    Raises
    ------
    InputError
        If there is no ffmpeg.
    """
    if FFMpegWriter.isAvailable():
        return str(FFMpegWriter.bin_path())
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        raise InputError(
            f"MP4 needs ffmpeg, which was not found: {install_line('movies')}, or write a .gif."
        ) from error


def gif_rate(fps: float) -> float:
    """Return the rate nearest to ``fps`` that a GIF can hold; its frames last whole hundredths of a second.

    Raises
    ------
    InputError
        If the rate is slower than a GIF can hold, or faster than browsers play.
    """
    if not GIF_SLOWEST <= fps <= GIF_FASTEST:
        raise InputError(
            f"fps: found {fps!r}; allowed for a GIF: {GIF_SLOWEST:.2g} to {GIF_FASTEST:g} a second; or write .mp4."
        )
    return 100.0 / round(100.0 / fps)


def _times(run: xr.DataTree) -> np.ndarray:
    return np.asarray(dataset_of(run, TRAJECTORY)["time"].values)


def _positions(run: xr.DataTree) -> np.ndarray:
    recorded = dataset_of(run, TRAJECTORY)
    return np.asarray(recorded["position"].values).reshape(recorded.sizes["time"], -1, recorded.sizes["axis"])


def _write(
    picture: Picture,
    target: Path,
    rate: float,
    write: Callable[[Picture, Frames, Path, float], None],
    bar: ProgressBar,
) -> None:
    partial = partial_path(target)
    with StopRequests() as stop:

        def frames() -> Frames:
            for number, pixels in enumerate(picture.drawn(), 1):
                yield pixels
                if bar.active:
                    bar.update(number)
                if stop.reason is not None:
                    return

        try:
            write(picture, frames(), partial, rate)
            if stop.reason is None:
                os.replace(partial, target)
        except (OSError, subprocess.CalledProcessError) as error:
            if stop.reason is None:  # a signal from a terminal reaches ffmpeg too
                said = (getattr(error, "stderr", None) or b"").decode(errors="replace").strip().splitlines()[-1:]
                raise DeliError(f"animation {target} could not be written: {' '.join([str(error), *said])}") from error
        finally:
            partial.unlink(missing_ok=True)
    if stop.reason is not None:
        raise KeyboardInterrupt(f"stopped by {stop.reason}; {target} was not written.")


def _write_gif(picture: Picture, frames: Frames, partial: Path, rate: float) -> None:
    palette: Image.Image | None = None

    def images() -> Iterable[Image.Image]:
        nonlocal palette
        for pixels in frames:
            image = Image.fromarray(pixels).convert("RGB")
            if palette is None:  # all frames have the same colours; one palette keeps still pixels the same
                palette = _palette(image)
            yield image.quantize(palette=palette, dither=Image.Dither.NONE)

    rest = iter(images())
    next(rest).save(
        partial, format="GIF", save_all=True, append_images=rest, duration=round(1000.0 / rate), loop=0, optimize=True
    )


def _palette(image: Image.Image) -> Image.Image:
    """Return a palette of the colours of bodies and the commonest other colours, unchanged; quantizers tint white.

    Of nearly equal colours only one is taken, because pillow finds the nearest colour by leading bits.
    """
    common = sorted(image.getcolors(image.width * image.height) or (), reverse=True)
    bodies: list[Any] = [tuple(round(255.0 * part) for part in to_rgb(hue)) for hue in COLORS]
    distinct: dict[tuple[int, ...], tuple[int, ...]] = {}
    for shade in [*bodies, *(shade for _, shade in common)]:
        distinct.setdefault(tuple(part >> 3 for part in shade), shade)
    chosen = list(distinct.values())[:SHADES]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.array(chosen, dtype=np.uint8).tobytes())
    return palette


class _Mp4Writer(FFMpegWriter):
    """A writer of frames that are drawn already; matplotlib's own writer redraws each figure."""

    _proc: Any

    def take(self, pixels: np.ndarray) -> None:
        self._proc.stdin.write(pixels)


def _write_mp4(picture: Picture, frames: Frames, partial: Path, rate: float) -> None:
    with matplotlib.rc_context({"animation.ffmpeg_path": ffmpeg()}):
        # The name ends in .partial, so that ffmpeg needs the format.
        settings: Any = {"fps": rate}  # ffmpeg takes fractions; matplotlib's annotation says int
        writer = _Mp4Writer(**settings, codec="h264", extra_args=["-f", "mp4", "-movflags", "+faststart"])
        with writer.saving(picture.figure, str(partial), dpi=picture.figure.dpi):
            for pixels in frames:
                writer.take(pixels)
