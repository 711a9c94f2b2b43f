"""A figure's config: what it shows, the runs it is made of, and how they are drawn."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from deli import config
from deli.config.models import Table, say, unknown
from deli.config.overrides import expand, override
from deli.config.reading import read_toml, refuse_unusable
from deli.errors import InputError
from deli.figures.exact import SOLUTIONS
from deli.recording.provenance import flatten
from deli.shipped import FOLDER

CONFIGS = FOLDER / "paper"
"""The configs of the paper's figures."""

Quantity = Literal["position", "radius", "energy", "energy_change", "angular_momentum", "swinging_share"]
Color = Literal["blue", "red", "green", "purple", "orange", "black"]
Style = Literal["solid", "dashed", "dotted"]


class PanelTable(Table):
    """Quantities over time on axes of their own; of all runs unless some are named."""

    quantities: Annotated[list[Quantity], Field(min_length=1)]
    runs: list[str] | None = None
    limits: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None


class ViewTable(Table):
    """The bodies in space: where they are at some times, or all of their paths where no times are given."""

    times: Annotated[list[float], Field(min_length=1)] | None = None


class DrawnRunTable(Table):
    """One run: a deli config on top of what all runs share, and how it is drawn.

    With a `solution` nothing is integrated: a closed form is evaluated at the times that the config would record.
    """

    label: str
    color: Color = "blue"
    style: Style = "solid"
    solution: str | None = None
    config: dict[str, Any] = Field(default_factory=dict)


class FigureTable(Table):
    """Everything in a figure's config.

    `claim` is what the paper says that the figure shows, `notes` what it leaves open and what was chosen, `config` what
    the runs share, `quick` what ``--quick`` changes in each.
    """

    title: str
    claim: str
    notes: str = ""
    panels: list[PanelTable] = Field(default_factory=list)
    view: ViewTable | None = None
    config: dict[str, Any] = Field(default_factory=dict)
    runs: Annotated[dict[Annotated[str, Field(pattern=r"^\w+$")], DrawnRunTable], Field(min_length=1)]
    quick: dict[str, Any] = Field(default_factory=dict)


@dataclass(frozen=True)
class FigureConfig:
    """A checked figure's config.

    Attributes
    ----------
    name : str
        The figure's number in the paper.
    text : str
        The config as it was read.
    table : FigureTable
        What it says.
    """

    name: str
    text: str
    table: FigureTable

    def run_config(self, run: str, *, quick: bool = False) -> config.Config:
        """Return the deli config of one of the runs.

        Raises
        ------
        InputError
            For whatever `deli.config.parse` refuses.
        """
        layers = [self.table.config, self.table.runs[run].config, *([self.table.quick] if quick else [])]
        merged: dict[str, Any] = {}
        for layer in layers:
            for key, value in flatten(expand(layer)).items():
                override(merged, key.split("."), value)
        try:
            return config.parse(merged)
        except InputError as error:
            raise InputError(f"figure {self.name}, run {run!r}: {error}") from error


def load(path: Path) -> FigureConfig:
    """Read a figure's config.

    Raises
    ------
    InputError
        If the file cannot be read or is not TOML, or for a key or value that is not allowed, naming the key's path,
        what was found and what is allowed. Configs of runs are checked by `FigureConfig.run_config`.
    """
    text, found = read_toml(path)
    try:
        return FigureConfig(path.stem, text, _checked(found))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def load_folder(folder: Path, names: Iterable[str] = ()) -> list[FigureConfig]:
    """Read the configs of the named figures in a folder, or of all.

    Raises
    ------
    InputError
        If there is no such figure, and for whatever `load` refuses.
    """
    known = {path.stem: path for path in sorted(folder.glob("*.toml"))}
    if not known:
        raise InputError(f"{folder} holds no figure configs (*.toml); name another folder with --configs.")
    chosen = list(dict.fromkeys(names)) or list(known)
    for name in chosen:
        if name not in known:
            raise InputError(unknown("figure", name, known))
    return [load(known[name]) for name in chosen]


def _checked(found: Mapping[str, Any]) -> FigureTable:
    refuse_unusable(found)
    try:
        table = FigureTable.model_validate(found)
    except ValidationError as error:
        raise InputError("; ".join(say(entry, FigureTable) for entry in error.errors())) from error
    if bool(table.panels) == (table.view is not None):
        raise InputError("expected either panels over time ([[panels]]) or a view of the bodies ([view]).")
    if table.view is not None and len(table.runs) > 1:
        raise InputError(f"[view] shows one run; found {', '.join(table.runs)}.")
    for index, panel in enumerate(table.panels):
        for run in panel.runs or ():
            if run not in table.runs:
                raise InputError(unknown(f"panels.{index}.runs", run, table.runs))
    shown = {quantity for panel in table.panels for quantity in panel.quantities}
    for name, run_table in table.runs.items():
        if run_table.solution is None:
            continue
        if run_table.solution not in SOLUTIONS:
            raise InputError(unknown(f"runs.{name}.solution", run_table.solution, SOLUTIONS))
        if shown != {"position"}:
            raise InputError(f"runs.{name}.solution gives positions only; show them in [[panels]], and nothing else.")
    return table
