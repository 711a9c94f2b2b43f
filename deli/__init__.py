"""Geometric integration of mechanical systems with contact, with swappable convex solvers."""

import solvers

if getattr(solvers, "PROJECT", None) != "deli":
    _found = getattr(solvers, "__file__", None) or ", ".join(getattr(solvers, "__path__", ["an unknown place"]))
    raise ImportError(
        f"deli needs its own package 'solvers', but Python found another one first: {_found}. Rename or move that "
        "file, or run from another directory."
    )

from deli import scenes
from deli.errors import DeliError, InputError, StepError
from deli.integrators.discrete_smooth import DiscreteSmooth
from deli.integrators.gvi import GVI
from deli.mechanics.constraints import Planes
from deli.mechanics.distances import AnchoredRods, Rods, SpheresApart, SpheresInside
from deli.mechanics.functions import Constraints, Potential
from deli.mechanics.pair_potentials import LennardJones, Springs
from deli.mechanics.potentials import Gravity, RadialPowers
from deli.mechanics.scene import Scene
from deli.reflect import reflect

__version__ = "0.1.0"

__all__ = [
    "GVI",
    "AnchoredRods",
    "Constraints",
    "DeliError",
    "DiscreteSmooth",
    "Gravity",
    "InputError",
    "LennardJones",
    "Planes",
    "Potential",
    "RadialPowers",
    "Rods",
    "Scene",
    "SpheresApart",
    "SpheresInside",
    "Springs",
    "StepError",
    "reflect",
    "scenes",
]
