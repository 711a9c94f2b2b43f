"""The shape of ``[[plots]]`` in a study file as pydantic models."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from deli.config.models import Table


class _Plot(Table):
    """The entries of every plot: a title, labels by axis to which it is restricted, and an axis with a panel a label.

    `METRICS` are the keys that name metrics; the other keys name axes.
    """

    METRICS: ClassVar[tuple[str, ...]] = ()
    title: str
    where: dict[str, Any] = Field(default_factory=dict)
    panels: str | None = None


class Pareto(_Plot):
    """Cases as points in two metrics, with the Pareto front."""

    METRICS = ("x", "y")
    kind: Literal["pareto"] = "pareto"
    x: str
    y: str
    by: str | None = None


class WorkPrecision(_Plot):
    """Error against cost along an axis."""

    METRICS = ("cost", "error")
    kind: Literal["work_precision"] = "work_precision"
    cost: str
    error: str
    along: str
    by: str | None = None


class HeatMap(_Plot):
    """A metric over two axes, with incomplete cases crossed out."""

    METRICS = ("value",)
    kind: Literal["heat_map"] = "heat_map"
    x: str
    y: str
    value: str


class Profile(_Plot):
    """Share of problems done within a factor of the least cost, one line a label of an axis (Dolan and Moré 2002)."""

    METRICS = ("cost",)
    kind: Literal["profile"] = "profile"
    cost: str
    by: str


class EnergyTraces(_Plot):
    """Energy error over time of the cases along an axis, at the first label of all other axes."""

    kind: Literal["energy_traces"] = "energy_traces"
    by: str


Plot = Annotated[Pareto | WorkPrecision | HeatMap | Profile | EnergyTraces, Field(discriminator="kind")]
