"""``deli figures``: the figures of the paper, from their configs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deli.commands.console import RUN_FAILED, complain, console, guarded
from deli.commands.files import CONFIG_FOLDER, FOLDER, require_kind

if TYPE_CHECKING:
    import xarray as xr

    from deli.figures import FigureConfig


@guarded
def figures(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[ID]...", help="Figures, such as 1.4a 8.2c (default: all).")
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for datasets, pictures and recorded runs.")
    ] = Path("figures"),
    quick: Annotated[bool, typer.Option("--quick", help="Make shorter runs: a first look, in seconds.")] = False,
    listing: Annotated[bool, typer.Option("--list", help="List the figures and stop.")] = False,
    configs: Annotated[
        Path | None, typer.Option("--configs", metavar="DIR", help="Folder of figure configs (default: the paper's).")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Repeat runs that are recorded in the folder already.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Remake figures of the paper: for each, a dataset ID.nc with one group a run, and a picture ID.png.

    All configs are checked before anything runs. Runs are recorded in DIR/runs, where figures share them. Recorded runs
    are not repeated, and interrupted runs are continued. Exit status: 0 done, 1 a run failed (its figure shows the
    recorded part), 2 the input is at fault.
    """
    from deli.figures import CONFIGS, Maker, load_folder
    from deli.running.interrupts import Interrupted

    if configs is not None:
        require_kind(configs, "figures", "a folder of figures' configs as --configs", CONFIG_FOLDER, FOLDER)
    chosen = load_folder(configs or CONFIGS, names or ())
    if listing:
        _print_list(chosen)
        return
    maker = Maker(output, quick=quick, overwrite=overwrite, progress=not quiet)
    for figure in chosen:
        maker.plans(figure)
    failed = []
    for figure in chosen:
        try:
            data = maker.dataset(figure)
        except Interrupted as stopped:
            complain(f"{stopped} The same command does.")
            raise typer.Exit(RUN_FAILED) from stopped
        maker.picture(figure, data)
        failed += [f"{figure.name} {name}: {run.attrs['outcome']}" for name, run in _unfinished(data)]
        if not quiet:
            _print_runs(figure, data)
            console().print(
                f"  drawn in {maker.path(figure, '.png')}, data in {maker.path(figure, '.nc')}", soft_wrap=True
            )
    if failed:
        complain("; ".join(failed))
        raise typer.Exit(RUN_FAILED)


def _print_list(figures: "list[FigureConfig]") -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table("figure", "shows", "runs")
    for figure in figures:
        labels = "\n".join(run.label for run in figure.table.runs.values())
        table.add_row(*(Text(cell) for cell in (figure.name, figure.table.title, labels)))
    console().print(table)


def _print_runs(figure: "FigureConfig", data: "xr.DataTree") -> None:
    lines = [f"{figure.name}  {figure.table.title}"]
    for run in data.children.values():
        took = f", {run.attrs['wall_time']:.3g} s" if "wall_time" in run.attrs else ""
        lines.append(f"  {run.attrs['label']}: {run.attrs['title']}{took}")
    console().print("\n".join(lines), soft_wrap=True)


def _unfinished(data: "xr.DataTree") -> "list[tuple[str, xr.DataTree]]":
    return [(name, run) for name, run in data.children.items() if run.attrs.get("outcome", "complete") != "complete"]
