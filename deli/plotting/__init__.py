"""Figures of a run: what it conserves over time, and where it goes."""

from deli.plotting.figures import check_picture, energy, gaps, history, momenta, residuals, save, trajectory

__all__ = [
    "check_picture",
    "energy",
    "gaps",
    "history",
    "momenta",
    "residuals",
    "save",
    "trajectory",
]
