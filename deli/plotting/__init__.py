"""Figures of a run: what it conserves over time, where it goes, and how it moves."""

from deli.plotting.animation import animate, check_movie, save_animation
from deli.plotting.figures import check_picture, energy, gaps, history, momenta, residuals, save, trajectory

__all__ = [
    "animate",
    "check_movie",
    "check_picture",
    "energy",
    "gaps",
    "history",
    "momenta",
    "residuals",
    "save",
    "save_animation",
    "trajectory",
]
