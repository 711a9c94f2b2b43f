"""The cells of the studies of stability, run one by one, and what the studies found in them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import xarray as xr

import deli
from deli.config import parse
from deli.simulation import run_plan
from deli.studies.expansion import Case, load

STUDIES = Path(__file__).parents[3] / "studies" / "stability"
METHODS = ("GVI", "GVI (Verlet)", "GVI (closed loop)", "GVI (numerical energy)", "collision")
BY_METHOD = ("step_size", "mass_ratio", "stiffness", "walls", "grazing", "gap", "units", "long_runs")
BY_BACKEND = tuple(f"{name}_backends" for name in ("walls", "redundant", "parallel", "grazing", "units"))
BY_BACKEND += tuple(f"{name}_backends" for name in ("step_size", "mass_ratio", "stiffness"))

OVERFLOW, TOO_LARGE, NO_EVENT = "the state is no longer finite", "is too large for the", "is met again at once"
UNCONVERGED, INACCURATE, INFEASIBLE = "did not converge", "leaves a residual of", "reports infeasible"
# By study and method, the values from which on something gives: a message where the run ends early; else what may be
# off: E for energy, O for an overlap. Whatever is not listed holds.
FOUND: Mapping[tuple[str, str], Mapping[object, str]] = {
    ("step_size", "GVI"): {0.5: "E", 1.0: "EO", 2.0: "EO"},
    ("step_size", "GVI (Verlet)"): {0.2: "E", 0.5: OVERFLOW, 1.0: OVERFLOW, 2.0: OVERFLOW},
    ("step_size", "GVI (closed loop)"): {0.5: "E", 1.0: "E", 2.0: "E"},
    ("step_size", "GVI (numerical energy)"): {0.5: "E", 1.0: TOO_LARGE, 2.0: TOO_LARGE},
    ("step_size", "collision"): {0.5: "E", 1.0: "E", 2.0: "E"},
    ("stiffness", "GVI"): dict.fromkeys((1e4, 1e5, 1e6, 1e7, 1e8), "O"),
    ("stiffness", "GVI (Verlet)"): {1e4: "E", **dict.fromkeys((1e5, 1e6, 1e7, 1e8), OVERFLOW)},
    ("stiffness", "GVI (numerical energy)"): dict.fromkeys((1e5, 1e6, 1e7, 1e8), TOO_LARGE),
    ("grazing", "collision"): {"1e-12": NO_EVENT},
    ("long_runs", "GVI"): {"1e3": "O", "1e4": "O", "1e5": "O"},
    ("long_runs", "GVI (numerical energy)"): {"1e3": "O", "1e4": "O", "1e5": "O", "1e6": "O"},
}


@dataclass(frozen=True)
class Cell:
    """One case of a study: its method or backend, the value of what is varied, and whether answers are polished."""

    study: str
    subject: str
    value: object
    polish: bool
    case: Case

    @property
    def found(self) -> str:
        """What the study found: a message, letters, or nothing."""
        return FOUND.get((self.study, self.subject), {}).get(self.value, "")

    def __str__(self) -> str:
        return f"{self.study}-{self.subject}-{self.value}{'' if self.polish else '-unpolished'}"


@cache
def cells(study: str, quick: bool) -> tuple[Cell, ...]:
    """The cells of one study; of its methods, those that are to keep the laws."""
    found = []
    for case in load(STUDIES / f"{study}.toml", quick).cases:
        labels = dict(case.labels)
        polish = bool(labels.pop("polish", True))
        subject = str(labels.pop("solver" if study.endswith("backends") else "integrator"))
        (value,) = labels.values()
        if study.endswith("backends") or subject in METHODS:
            found.append(Cell(study, subject, value, polish, case))
    return tuple(found)


@dataclass(frozen=True)
class Verdict:
    """Figures of a run over the scales of its start: energy, size, momentum."""

    outcome: str
    band: float
    overlap: float
    momentum: float
    unverified: int
    run: xr.DataTree


def judge(cell: Cell, **changes: object) -> Verdict:
    """Run a cell and measure it."""
    plan = parse({**cell.case.config, **changes}).plan()
    run = run_plan(plan)
    rows, stats = run["trajectory"], run["solver_stats"]
    energy, size = rows["hamiltonian"].values, float(np.abs(plan.scene.position).max())
    scale = max(abs(energy[0]), float(rows["kinetic_energy"][0]), np.finfo(float).tiny)
    momentum = float(np.abs(plan.scene.momentum).max())
    errors = [
        error / (momentum if name.startswith("p") else momentum * size)
        for name, error in deli.metrics.momentum_errors(run).items()
        if momentum > 0
    ]
    with np.errstate(over="ignore", invalid="ignore"):
        band = float(np.ptp(energy)) / scale
    return Verdict(
        outcome=run.attrs["outcome"],
        band=band,
        overlap=max(0.0, -float(np.nanmin(rows["gap_min"]))) / size,
        momentum=max(errors, default=0.0),
        unverified=int((stats["solves"] - stats["verified"]).sum()),
        run=run,
    )
