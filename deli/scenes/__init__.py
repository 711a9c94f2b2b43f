"""The paper's scenes: six functions that return a ``Scene``, and a registry by name."""

from deli.scenes.lennard_jones import lennard_jones
from deli.scenes.newtons_cradle import newtons_cradle
from deli.scenes.nonlinear_oscillator import nonlinear_oscillator
from deli.scenes.pogo_stick import pogo_stick
from deli.scenes.point_mass import point_mass
from deli.scenes.registry import available, defaults, get
from deli.scenes.spring_sphere import spring_sphere

__all__ = [
    "available",
    "defaults",
    "get",
    "lennard_jones",
    "newtons_cradle",
    "nonlinear_oscillator",
    "pogo_stick",
    "point_mass",
    "spring_sphere",
]
