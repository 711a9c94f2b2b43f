"""Scenes: functions that return a ``Scene``, the six scenes of the paper first, and a registry by name."""

from deli.scenes.lennard_jones import lennard_jones
from deli.scenes.newtons_cradle import newtons_cradle
from deli.scenes.nonlinear_oscillator import nonlinear_oscillator
from deli.scenes.pogo_stick import pogo_stick
from deli.scenes.point_mass import point_mass
from deli.scenes.registry import available, defaults, get
from deli.scenes.spring_sphere import spring_sphere

# isort: split
from deli.scenes.chain_on_cylinder import chain_on_cylinder
from deli.scenes.disc_pile import disc_pile
from deli.scenes.granular_chain import granular_chain
from deli.scenes.hard_rods import hard_rods
from deli.scenes.hard_sphere_gas import hard_sphere_gas
from deli.scenes.quartic_wall import quartic_wall
from deli.scenes.wedge import wedge

__all__ = [
    "available",
    "chain_on_cylinder",
    "defaults",
    "disc_pile",
    "get",
    "granular_chain",
    "hard_rods",
    "hard_sphere_gas",
    "lennard_jones",
    "newtons_cradle",
    "nonlinear_oscillator",
    "pogo_stick",
    "point_mass",
    "quartic_wall",
    "spring_sphere",
    "wedge",
]
