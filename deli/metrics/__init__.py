"""Metrics of a run: errors of energy, momenta and constraints, and the cost of its solvers.

Each function takes a run from `deli.simulate` or `deli.open_run` and uses its recorded rows alone. A run that stopped
early is measured up to its last row. Of an ensemble, each function takes one member, ``run.isel(member=0)``, or all
members at once; every number is then an array along ``member``. `measure` collects all metrics. Units are the scene's
own length L, mass M and time T, as in the dataset; times of solvers are in seconds.
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
