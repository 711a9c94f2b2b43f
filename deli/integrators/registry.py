"""Methods by the name they have in a config."""

from typing import Any

from deli.integrators.direct import CONSTRAINTS, Direct
from deli.integrators.discrete_smooth import DiscreteSmooth
from deli.integrators.gvi import GVI, PREDICTORS
from deli.integrators.moreau_jean import MoreauJean
from deli.integrators.newmark import Newmark
from deli.mechanics.schemes import SCHEMES
from deli.subproblems.reflection import ENERGIES, OPERATORS, ORDERS

METHODS: dict[str, type[Any]] = {
    "gvi": GVI,
    "discrete_smooth": DiscreteSmooth,
    "direct": Direct,
    "newmark": Newmark,
    "moreau_jean": MoreauJean,
}

CHOICES: dict[str, tuple[str, ...]] = {
    "scheme": tuple(SCHEMES),
    "reflection": tuple(OPERATORS),
    "energy": tuple(ENERGIES),
    "predictor": tuple(PREDICTORS),
    "constraint": tuple(CONSTRAINTS),
    "order": tuple(ORDERS),
}
"""Values a method's setting can have."""
