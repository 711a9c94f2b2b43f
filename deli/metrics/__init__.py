"""What a run is judged by: how well it kept energy, momenta and constraints, and what its solvers cost.

Each function takes a run from `deli.simulate` or `deli.open_run`, and works from its recorded rows alone, so that a run
that stopped early is measured until where it got. Of an ensemble each takes one member, ``run.isel(member=0)``, or all
at once: every number is then an array along ``member``. `measure` collects them all. Units are in the scene's own
length L, mass M and time T, as in the dataset; times of solvers are in seconds.
"""

from deli.metrics.contact import complementarity, contacts, equality_residual, violation
from deli.metrics.energy import Drift, drift, drift_per_impact, energy_drift, energy_range
from deli.metrics.momentum import (
    angular_momentum_error,
    momentum_components,
    momentum_error,
    momentum_errors,
    undecided_momenta,
)
from deli.metrics.shadow import shadow_energy
from deli.metrics.table import METRICS, measure
from deli.metrics.trajectory import steps_taken, trajectory_error
from deli.metrics.uncalled import uncalled_note, uncalled_solvers

__all__ = [
    "METRICS",
    "Drift",
    "angular_momentum_error",
    "complementarity",
    "contacts",
    "drift",
    "drift_per_impact",
    "energy_drift",
    "energy_range",
    "equality_residual",
    "measure",
    "momentum_components",
    "momentum_error",
    "momentum_errors",
    "shadow_energy",
    "steps_taken",
    "trajectory_error",
    "uncalled_note",
    "uncalled_solvers",
    "undecided_momenta",
    "violation",
]
