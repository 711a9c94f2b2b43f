"""Figures and films of a run, and plots that compare the cases of a study and the backends of a replay."""

from deli.plotting.animation import animate, check_movie, save_animation
from deli.plotting.comparison import MARKERS, energy_traces, heat_map, pareto, work_precision
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
from deli.plotting.lines import color
from deli.plotting.style import STYLE

__all__ = [
    "MARKERS",
    "STYLE",
    "animate",
    "check_movie",
    "check_picture",
    "color",
    "energy",
    "energy_traces",
    "gaps",
    "heat_map",
    "history",
    "momenta",
    "pareto",
    "performance_profile",
    "residuals",
    "save",
    "save_animation",
    "save_replay",
    "trajectory",
    "work_precision",
]
