"""Geometric integration of mechanical systems with contact, with swappable convex solvers."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from deli import plotting
    from deli.running.interrupts import Interrupted
    from deli.simulation import open_run, simulate

__version__ = "0.1.0"

__all__ = [
    "GVI",
    "AnchoredRods",
    "Constraints",
    "DeliError",
    "DiscreteSmooth",
    "Gravity",
    "InputError",
    "Interrupted",
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
    "open_run",
    "plotting",
    "reflect",
    "scenes",
    "simulate",
]

_ON_DEMAND = {"Interrupted": "deli.running.interrupts", "open_run": "deli.simulation", "simulate": "deli.simulation"}


def __getattr__(name: str) -> Any:
    # xarray, netCDF4 and matplotlib take longer to import than everything else; `deli --help` does without them.
    if name == "plotting":
        return import_module("deli.plotting")
    if name in _ON_DEMAND:
        return getattr(import_module(_ON_DEMAND[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
