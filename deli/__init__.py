"""Geometric integration of mechanical systems with contact, with swappable convex solvers."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deli.errors import DeliError, InputError, StepError
from deli.version import __version__

if TYPE_CHECKING:
    from deli import impacts, metrics, plotting, scenes
    from deli.ensemble import simulate_ensemble
    from deli.integrators.collision import Collision
    from deli.integrators.direct import Direct
    from deli.integrators.discrete_smooth import DiscreteSmooth
    from deli.integrators.gvi import GVI
    from deli.integrators.moreau_jean import MoreauJean
    from deli.integrators.newmark import Newmark
    from deli.integrators.nonsmooth_alpha import NonsmoothAlpha
    from deli.integrators.solve_ivp import SolveIvp
    from deli.mechanics.constraints import Planes
    from deli.mechanics.distances import AnchoredRods, Rods, SpheresApart, SpheresInside, SpheresOutside
    from deli.mechanics.functions import Constraints, Potential
    from deli.mechanics.pair_potentials import LennardJones, Springs
    from deli.mechanics.potentials import Gravity, RadialPowers
    from deli.mechanics.scene import Scene
    from deli.reflect import reflect
    from deli.replaying.replay import replay
    from deli.running.interrupts import Interrupted
    from deli.simulation import load_subproblem, open_run, simulate
    from deli.studies.opening import open_study

__all__ = [
    "GVI",
    "AnchoredRods",
    "Collision",
    "Constraints",
    "DeliError",
    "Direct",
    "DiscreteSmooth",
    "Gravity",
    "InputError",
    "Interrupted",
    "LennardJones",
    "MoreauJean",
    "Newmark",
    "NonsmoothAlpha",
    "Planes",
    "Potential",
    "RadialPowers",
    "Rods",
    "Scene",
    "SolveIvp",
    "SpheresApart",
    "SpheresInside",
    "SpheresOutside",
    "Springs",
    "StepError",
    "__version__",
    "impacts",
    "load_subproblem",
    "metrics",
    "open_run",
    "open_study",
    "plotting",
    "reflect",
    "replay",
    "scenes",
    "simulate",
    "simulate_ensemble",
]

_MODULES = ("impacts", "metrics", "plotting", "scenes")
_HOME = {
    "GVI": "deli.integrators.gvi",
    "AnchoredRods": "deli.mechanics.distances",
    "Collision": "deli.integrators.collision",
    "Constraints": "deli.mechanics.functions",
    "Direct": "deli.integrators.direct",
    "DiscreteSmooth": "deli.integrators.discrete_smooth",
    "Gravity": "deli.mechanics.potentials",
    "Interrupted": "deli.running.interrupts",
    "LennardJones": "deli.mechanics.pair_potentials",
    "MoreauJean": "deli.integrators.moreau_jean",
    "Newmark": "deli.integrators.newmark",
    "NonsmoothAlpha": "deli.integrators.nonsmooth_alpha",
    "Planes": "deli.mechanics.constraints",
    "Potential": "deli.mechanics.functions",
    "RadialPowers": "deli.mechanics.potentials",
    "Rods": "deli.mechanics.distances",
    "Scene": "deli.mechanics.scene",
    "SolveIvp": "deli.integrators.solve_ivp",
    "SpheresApart": "deli.mechanics.distances",
    "SpheresInside": "deli.mechanics.distances",
    "SpheresOutside": "deli.mechanics.distances",
    "Springs": "deli.mechanics.pair_potentials",
    "load_subproblem": "deli.simulation",
    "open_run": "deli.simulation",
    "open_study": "deli.studies.opening",
    "reflect": "deli.reflect",
    "replay": "deli.replaying.replay",
    "simulate": "deli.simulation",
    "simulate_ensemble": "deli.ensemble",
}


def _refuse_stranger() -> None:
    """Raise if Python finds another package `solvers` than the one installed beside this one."""
    spec = find_spec("solvers")
    places = [] if spec is None else [spec.origin] if spec.origin else list(spec.submodule_search_locations or ())
    own = Path(__file__).resolve().parent.with_name("solvers")
    if not any(Path(place).resolve().parent == own for place in places):
        raise ImportError(
            f"deli needs its own package 'solvers', but Python found another one first: "
            f"{', '.join(places) or 'none'}. Rename or move that file, or run from another directory."
        )


_refuse_stranger()


def __getattr__(name: str) -> Any:
    # numpy, scipy, xarray and matplotlib take longer to import than `deli --help` should take.
    if name in _MODULES:
        return import_module(f"deli.{name}")
    if name in _HOME:
        # Kept here, because the import of deli.reflect puts the module in the place of the function.
        value = globals()[name] = getattr(import_module(_HOME[name]), name)
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
