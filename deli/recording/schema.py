"""The schema of a recorded run: every variable with its dimensions, type, units and long name."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from deli.errors import InputError
from deli.recording.subproblems import LEFT_OUT, SUBPROBLEM_VARIABLES
from deli.recording.variable import Block, Variable
from deli.subproblems.choices import SUBPROBLEMS
from deli.subproblems.stats import STATUS_MEANINGS

if TYPE_CHECKING:
    import xarray as xr

CONVENTIONS = "deli-2"
UNITS_NOTE = (
    "L, M and T are the scene's own units of length, mass and time; a system without units has all three equal to 1. "
    "Times of solvers and of the run are in seconds (s). Positions and momenta of scenes whose "
    "coordinates are not lengths follow the scene."
)
AXES = ("x", "y", "z")
UNDECIDED = "undecided_momenta"
"""Attribute that names the components of momentum whose conservation is undecided."""
TRAJECTORY, STATS, POSED = "trajectory", "solver_stats", "subproblems"
MEMBER = "member"
"""The dimension of an ensemble's members."""

VariableData = tuple[tuple[str, ...], np.ndarray, dict[str, Any]]  # dims, values, attributes
Groups = dict[str, dict[str, VariableData]]


@dataclass(frozen=True)
class Schema:
    """The groups of a run of a system with `dof` degrees of freedom in `dimension` dimensions.

    Group ``trajectory`` grows along ``time`` (row 0 is the initial state), group ``solver_stats`` along ``step``:
    ``step`` k leads from row k to row k + 1 and sums up all integration steps between them. `memory` names the
    quantities besides position and momentum that the method carries from step to step. With `subproblems` there is a
    group ``subproblems``, which grows along ``problem`` and the ragged dimensions that hold its numbers.
    """

    dof: int
    dimension: int
    memory: tuple[str, ...] = ()
    subproblems: bool = False

    @property
    def groups(self) -> dict[str, tuple[Variable, ...]]:
        """Variables by group, coordinates first."""
        posed = {POSED: SUBPROBLEM_VARIABLES} if self.subproblems else {}
        return {TRAJECTORY: self._trajectory(), STATS: _STATS, **posed}

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the dimensions that do not grow."""
        return {"dof": self.dof, "axis": self.dimension, "subproblem": len(SUBPROBLEMS)}

    @property
    def row_bytes(self) -> int:
        """Bytes of a row and of the statistics of the steps that lead to it."""
        growing = [variable for name in (TRAJECTORY, STATS) for variable in self.groups[name] if variable.grows]
        places = [math.prod(self.sizes.get(dimension, 1) for dimension in variable.dims) for variable in growing]
        return sum(n * np.dtype(variable.dtype).itemsize for n, variable in zip(places, growing, strict=True))

    def growing(self, group: str) -> tuple[str, ...]:
        """Return the names of the variables of a group that rows, or subproblems, are appended to."""
        return tuple(variable.name for variable in self.groups[group] if variable.grows)

    def constants(self) -> dict[str, Block]:
        """Return the values of the variables that do not grow, by group."""
        body = np.repeat(np.arange(self.dof // self.dimension), self.dimension)
        direction = np.tile(np.array(AXES[: self.dimension]), self.dof // self.dimension)
        return {
            TRAJECTORY: {
                "dof": np.arange(self.dof),
                "body": body,
                "direction": direction,
                "axis": np.array(AXES[: self.dimension]),
            },
            STATS: {"subproblem": np.array(SUBPROBLEMS)},
            POSED: {LEFT_OUT: np.array(0)},
        }

    def _trajectory(self) -> tuple[Variable, ...]:
        angular = {1: (), 2: ("time",), 3: ("time", "axis")}[self.dimension]
        variables: tuple[Variable, ...] = _TRAJECTORY
        if angular:
            about = "total angular momentum about the origin, sum of r x p"
            variables += (Variable("angular_momentum", angular, "f8", "M L2 T-1", about),)
        return variables + _CONTACT + tuple(_MEMORY[name] for name in self.memory)


_WORK = "in all attempts at the steps, discarded ones included"  # contacts are counted in accepted steps only


def _time(name: str, long_name: str) -> Variable:
    return Variable(name, ("step", "subproblem"), "f8", "s", f"{long_name}, {_WORK}")


def _count(name: str, long_name: str) -> Variable:
    return Variable(name, ("step", "subproblem"), "i8", "1", f"{long_name}, {_WORK}")


def _residual(name: str, long_name: str) -> Variable:
    long_name = f"{long_name} of the answers {_WORK}; nan where nothing was measured"
    return Variable(name, ("step", "subproblem"), "f8", "1", long_name)


_ENERGY = "M L2 T-2"
_TRAJECTORY = (
    Variable("time", ("time",), "f8", "T", "time since the initial state", {"axis": "T"}),
    Variable("dof", ("dof",), "i8", "1", "degree of freedom, counted from 0"),
    Variable("body", ("dof",), "i8", "1", "body the degree of freedom belongs to, counted from 0"),
    Variable("direction", ("dof",), "str", "1", "direction of the degree of freedom"),
    Variable("axis", ("axis",), "str", "1", "direction of the component"),
    Variable("position", ("time", "dof"), "f8", "L", "position q"),
    Variable("momentum", ("time", "dof"), "f8", "M L T-1", "momentum p"),
    Variable("hamiltonian", ("time",), "f8", _ENERGY, "total energy H(q, p)"),
    Variable("kinetic_energy", ("time",), "f8", _ENERGY, "kinetic energy"),
    Variable("potential_energy", ("time",), "f8", _ENERGY, "potential energy V(q)"),
    Variable("linear_momentum", ("time", "axis"), "f8", "M L T-1", "total linear momentum"),
)
_CONTACT = (
    Variable(
        "gap_min",
        ("time",),
        "f8",
        "L",
        "smallest gap, negative in penetration; nan without unilateral constraints",
    ),
    Variable(
        "equality_residual",
        ("time",),
        "f8",
        "L",
        "largest |f(q)| of the bilateral constraints; nan without any",
    ),
    Variable(
        "smooth_contacts",
        ("time",),
        "i8",
        "1",
        "contacts in the smooth set of the step that leads to the row; 0 for steps from event to event",
    ),
    Variable(
        "reflected_contacts",
        ("time",),
        "i8",
        "1",
        "contacts reflected in the steps since the previous row, once for each reflection, without discarded attempts",
    ),
)
_MEMORY = {
    variable.name: variable
    for variable in (
        Variable("auxiliary_acceleration", ("time", "dof"), "f8", "L T-2", "acceleration a that the method averages"),
        Variable("smooth_acceleration", ("time", "dof"), "f8", "L T-2", "acceleration of the motion without contacts"),
    )
}
_STATS = (
    Variable("step", ("step",), "i8", "1", "interval between rows: step k leads from row k to row k + 1"),
    Variable("subproblem", ("subproblem",), "str", "1", "convex subproblem of an integration step"),
    _count("solves", "calls of a solver"),
    _count("skipped", "subproblems answered without a solver"),
    _count("iterations", "iterations of the solver"),
    _count("rows", "constraint rows handed to the solver"),
    _count("fallbacks", "members of a solver chain that failed before one succeeded"),
    _count("claimed", "calls that the solver says were solved"),
    _count("verified", "calls whose recomputed residuals are within the tolerance"),
    _time("solve_time", "time inside the solver"),
    _time("overhead_time", "time to write the solver's data, read its answer and check it"),
    _residual("primal_residual", "largest scaled primal residual"),
    _residual("dual_residual", "largest scaled dual residual"),
    _residual("complementarity", "largest scaled complementarity residual"),
    Variable(
        "status",
        ("step", "subproblem"),
        "i1",
        "1",
        f"worst status of the subproblem {_WORK}",
        {
            "flag_values": np.arange(len(STATUS_MEANINGS), dtype=np.int8),
            "flag_meanings": " ".join(STATUS_MEANINGS),
        },
    ),
)


def remembered(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names among these of quantities that a method carries from step to step."""
    found = set(names)
    return tuple(name for name in _MEMORY if name in found)


def coordinates(group: str) -> tuple[str, ...]:
    """Return the names of the coordinates of a group."""
    named = {TRAJECTORY: ("time", "dof", "body", "direction", "axis"), STATS: ("step", "subproblem")}
    return named.get(group, ())


def build_tree(groups: Groups, attributes: Mapping[str, Any]) -> "xr.DataTree":
    """Return variables and root attributes as the tree that users get."""
    import xarray as xr  # takes half a second, and most of this module needs none

    datasets = {"/": xr.Dataset(attrs=dict(attributes))}
    for group, variables in groups.items():
        dataset = xr.Dataset({name: xr.Variable(*variable) for name, variable in variables.items()})
        datasets[f"/{group}"] = dataset.set_coords([name for name in coordinates(group) if name in dataset])
    return xr.DataTree.from_dict(datasets)


def dataset_of(run: "xr.DataTree", group: str) -> "xr.Dataset":
    """Return a group of a run with its coordinates; for a member of an ensemble, only the rows that it has reached.

    Raises
    ------
    InputError
        If the group has not been recorded.
    """
    if group not in run.children:
        raise InputError(f"the run has no group {group}: it was left out when the run was recorded.")
    found = run.children[group].to_dataset()
    if MEMBER not in run.coords or MEMBER in found.dims or group == POSED:
        return found
    rows = reached(run.children[TRAJECTORY].variables["position"].values)
    if rows == run.children[TRAJECTORY].sizes["time"]:
        return found
    return found.isel({"time": slice(rows)} if group == TRAJECTORY else {"step": slice(max(rows - 1, 0))})


def reached(position: np.ndarray) -> int:
    """Return the number of rows that a member of an ensemble has reached; positions of later rows are nan."""
    return int(np.count_nonzero(~np.isnan(position).all(axis=-1)))
