"""The methods, by their names in a config."""

from deli.integrators.collision import Collision
from deli.integrators.direct import Direct
from deli.integrators.discrete_smooth import DiscreteSmooth
from deli.integrators.gvi import GVI
from deli.integrators.integrator import Integrator
from deli.integrators.moreau_jean import MoreauJean
from deli.integrators.newmark import Newmark
from deli.integrators.nonsmooth_alpha import NonsmoothAlpha
from deli.integrators.solve_ivp import SolveIvp

METHODS: dict[str, type[Integrator]] = {
    "gvi": GVI,
    "discrete_smooth": DiscreteSmooth,
    "collision": Collision,
    "direct": Direct,
    "newmark": Newmark,
    "moreau_jean": MoreauJean,
    "nonsmooth_alpha": NonsmoothAlpha,
    "solve_ivp": SolveIvp,
}
