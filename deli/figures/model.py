"""The config of a figure: its quantities, its runs, and their looks."""

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
    """Quantities over time on axes of their own, of the named runs (default: all runs)."""

    quantities: Annotated[list[Quantity], Field(min_length=1)]
    runs: list[str] | None = None
    limits: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None


class ViewTable(Table):
    """The bodies in space: their places at the given times, or their paths if no times are given."""

    times: Annotated[list[float], Field(min_length=1)] | None = None


class DrawnRunTable(Table):
    """One run: a config that is merged into the common config of all runs, and the looks of its lines.

    With a `solution`, a closed form is evaluated at the recorded times of the config, and nothing is integrated.
    """

    label: str
    color: Color = "blue"
    style: Style = "solid"
    solution: str | None = None
    config: dict[str, Any] = Field(default_factory=dict)


class FigureTable(Table):
    """The content of a figure's config.

    `claim` is the statement of the paper about the figure, `notes` lists open parameters of the paper and the values
    chosen here, `config` is common to all runs, and `quick` holds the changes of each run by ``--quick``.
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
        The content of the config.
    """

    name: str
    text: str
    table: FigureTable

    def run_config(self, run: str, *, quick: bool = False) -> config.Config:
        """Return the config of one of the runs.

        Raises
        ------
        InputError
            If `deli.config.parse` refuses the config.
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
        If the file cannot be read or is not TOML, or for a key or value that is not allowed, with the key's path, the
        value found and the values allowed. `FigureConfig.run_config` checks the configs of runs.
    """
    text, found = read_toml(path)
    try:
        return FigureConfig(path.stem, text, _checked(found))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def load_folder(folder: Path, names: Iterable[str] = ()) -> list[FigureConfig]:
    """Read the configs of the named figures in a folder, or of all figures.

    Raises
    ------
    InputError
        If there is no such figure, or `load` refuses a config.
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
