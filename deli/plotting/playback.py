"""The choice of rows of a run as frames, such that playback is uniform in simulated time."""

import math

import numpy as np

from deli.errors import InputError

FPS, SECONDS = 25.0, 10.0
BODIES = 12
RATES = 1e-3, 1e3
"""The least and the largest number of frames a second."""
MOST_FRAMES = 100_000
"""The most frames of a film: more than an hour."""


def choose_rows(
    time: np.ndarray,
    *,
    fps: float = FPS,
    duration: float | None = None,
    start: float | None = None,
    end: float | None = None,
    every: int | None = None,
) -> np.ndarray:
    """Return the rows to show, one a frame: the rows nearest to equidistant times, or every n-th row.

    Without ``duration`` and ``every`` playback takes at most `SECONDS` and repeats no row.

    Parameters
    ----------
    time : numpy.ndarray
        Recorded times, ascending.
    fps : float
        Frames a second of playback.
    duration : float, optional
        Seconds of playback.
    start, end : float, optional
        First and last simulated time to show; rows outside are left out.
    every : int, optional
        Number of rows from frame to frame, in place of a duration.

    Raises
    ------
    InputError
        If a number is out of range or no row lies between ``start`` and ``end``.
    """
    slowest, fastest = RATES
    if not slowest <= fps <= fastest:
        raise InputError(f"fps: found {fps!r}; pass {slowest:g} to {fastest:g} frames a second.")
    if every is not None and duration is not None:
        raise InputError("every and duration are both set; either one fixes the number of frames: pass one of them.")
    if every is not None and every < 1:
        raise InputError(f"every: found {every!r}; pass a whole number of rows >= 1.")
    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise InputError(f"duration: found {duration!r}; pass seconds of playback > 0.")
    shown = _window(time, start, end)
    if duration is not None and duration * fps > MOST_FRAMES:
        raise InputError(
            f"duration {duration!r} at fps {fps!r} is more than {MOST_FRAMES:,} frames; pass a shorter one."
        )
    if every is not None:
        if len(shown) > every * MOST_FRAMES:
            raise InputError(
                f"every {every!r} makes more than {MOST_FRAMES:,} frames of {len(shown):,} rows; pass a larger one."
            )
        return shown[::every]
    count = min(len(shown), round(SECONDS * fps)) if duration is None else round(duration * fps)
    inside = time[shown]
    moments = np.linspace(inside[0], inside[-1], max(count, 1))
    return shown[np.searchsorted((inside[1:] + inside[:-1]) / 2.0, moments)]


def _window(time: np.ndarray, start: float | None, end: float | None) -> np.ndarray:
    low, high = time[0] if start is None else start, time[-1] if end is None else end
    slack = 1e-9 * max(abs(time[0]), abs(time[-1]))
    shown = np.flatnonzero((time >= low - slack) & (time <= high + slack))
    if not shown.size:
        raise InputError(
            f"start and end: found no row between {low:g} and {high:g}; the run has {len(time)} rows from time "
            f"{time[0]:g} to {time[-1]:g}."
        )
    return shown


def misses_motion(position: np.ndarray, rows: np.ndarray) -> bool:
    """Tell whether the frames show less than half of the way that one of the first bodies moves to and fro.

    Parameters
    ----------
    position : numpy.ndarray
        Positions in all rows, shape (rows, bodies, dimension).
    rows : numpy.ndarray
        Rows of the frames.
    """
    first = position[:, :BODIES]
    gone = np.abs(np.diff(first[rows[0] : rows[-1] + 1], axis=0)).sum(axis=0)
    shown = np.abs(np.diff(first[rows], axis=0)).sum(axis=0)
    return bool(np.any((gone > 2.0 * shown) & (gone > np.ptp(first))))
