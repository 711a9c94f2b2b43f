"""The command line."""

from typing import Annotated

import typer

from deli.commands.animate import animate
from deli.commands.bench import bench
from deli.commands.check import check
from deli.commands.figures import figures
from deli.commands.listing import backends, methods, scenes
from deli.commands.plot import plot
from deli.commands.replay import replay
from deli.commands.report import report
from deli.commands.run import run
from deli.commands.study import study

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (run, study, report, plot, animate, replay, figures, check, scenes, methods, backends, bench):
    app.command()(command)


def _show_version(wanted: bool) -> None:
    if wanted:
        from deli import __version__

        typer.echo(f"deli {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Simulate mechanical systems with contact, record runs, and compare methods and solvers."""


def main() -> None:
    """Run the `deli` command."""
    app()
