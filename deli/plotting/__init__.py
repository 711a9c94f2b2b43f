"""Figures of a run: what it conserves, where it goes, how it moves; and how backends compare on subproblems."""

from deli.plotting.animation import animate, check_movie, save_animation
from deli.plotting.figures import (
    check_picture,
    energy,
    gaps,
    history,
    momenta,
    performance_profile,
    residuals,
    save,
    save_replay,
    trajectory,
)

__all__ = [
    "animate",
    "check_movie",
    "check_picture",
    "energy",
    "gaps",
    "history",
    "momenta",
    "performance_profile",
    "residuals",
    "save",
    "save_animation",
    "save_replay",
    "trajectory",
]
