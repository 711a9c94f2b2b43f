"""``deli study``: many runs from one file."""

from collections.abc import Container
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deli.commands.console import RUN_FAILED, complain, console, guarded
from deli.commands.files import STUDY, require_kind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from deli.studies.planning import Decision
    from deli.studies.running import Result

SHOWN_FAILURES = 20


@guarded
def study(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[STUDY]",
            help="A study file (.toml), or the name of a study that comes with deli, such as stability/gap.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder of the study (default: the file's name, here)."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", metavar="N", min=1, help="Worker processes (default: what the study says, or one a core)."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Run on a Dask scheduler, such as tcp://host:8786, instead of here."),
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the studies that come with deli and stop.")] = False,
    quick: Annotated[
        bool, typer.Option("--quick", help="A shorter form of the study, as its table [quick] says: a first look.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check everything, say what would run and why, and stop.")
    ] = False,
    retry_failed: Annotated[
        bool,
        typer.Option("--retry-failed", help="Also run again what failed, timed out, ran out of memory or was killed."),
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Run a study: a base config, and the keys that vary. Open the results with `deli.open_study(DIR)`.

    A study is named by its file, or by a name that `deli study --list` shows; a file wins over a name.

    A recorded case is not repeated, unless its config, deli or one of its backends has changed; an interrupted case is
    continued. A case that fails, exceeds the study's limits of time or memory, or is killed, keeps that outcome and
    stops no other case. Exit status: 0 all cases are done, 1 some cases are not done, 2 the input is at fault.

    A study file:

        base = "pogo.toml"              # or a table [base]

        [axes]                          # all combinations
        "solvers.default" = [
            "daqp",
            { backend = "osqp", tolerance = 1e-6, label = "loose" },
        ]
        step_size = [0.2, 0.1, 0.05]
        scene.perturbation.seed = { count = 10 }  # 0, 1, ... 9

        [[zip]]                         # keys that vary together
        name = "length"
        values = { duration = [1.0, 9.0], record.every = [1, 9] }

        [[cases]]                       # by hand: dimension "case"
        label = "soft"
        scene.stiffness = 1.0

        [[exclude]]                     # matching cases are left out
        solver = "loose"
        step_size = [0.1, 0.05]

        [reference]                     # for trajectory_error;
        step_size = 1e-4                # or exact = true

        [limits]                        # of one case
        time = 60.0
        memory = "2 GB"

        [[plots]]                       # of `deli report`
        kind = "pareto"                 # or work_precision,
        title = "Worth its time?"       # heat_map, profile,
        x = "wall_time"                 # energy_traces
        y = "energy_band"
        by = "solver"

        [quick]                         # what --quick changes
        base.duration = 1.0

    Further keys are `title`, and for comparisons of times `workers = 1` and `time_steps = true`, which adds the metrics
    `cpu_time`, of the steps alone, and `recording_time`, of their recording. The value "installed" of the axis
    `"solvers.default.backend"` stands for all installed backends.
    """
    from deli.errors import InputError
    from deli.studies.display import Board, reasons
    from deli.studies.expansion import load
    from deli.studies.planning import KEEP
    from deli.studies.running import plan_study, run_study
    from deli.studies.shipped import find, is_both

    if listing:
        _print_list()
        return
    if source is None:
        raise InputError("no study is given; name a study's file, or one of those that `deli study --list` shows.")
    if workers is not None and scheduler is not None:
        raise InputError("--workers and --scheduler are both given; a Dask scheduler has its own workers.")
    file = find(source)
    require_kind(file, "study", "a study's file (.toml)", STUDY)
    if is_both(source) and not quiet:
        complain(f"{source} is a file here and a study that comes with deli; the file is taken.")
    checked, folder = load(file, quick), output or _folder_of(source)
    decisions = plan_study(checked, folder, retry_failed=retry_failed)
    if dry_run:
        _print_plan(decisions)
    if not quiet:
        console().print(f"{checked.title}: {reasons(decisions)}", soft_wrap=True)
    if dry_run:
        return
    with nullcontext() if quiet else Board(decisions) as board:
        result = run_study(
            checked, folder, workers=workers, address=scheduler, retry_failed=retry_failed, watcher=board
        )
    if not quiet:
        console().print(f"{_counted(result)}; in {folder}", soft_wrap=True)
    told = set() if quiet else {decision.case.digest for decision in decisions if decision.action != KEEP}
    _complain_of(result, folder, told)


def _print_list() -> None:
    from rich.table import Table
    from rich.text import Text

    from deli.studies.expansion import outline
    from deli.studies.shipped import studies

    table = Table("study", "question", "cases")
    for name, path in studies().items():
        title, cases = outline(path)
        table.add_row(Text(name), Text(title), str(cases))
    console().print(table)
    console().print("Cases are counted with the solvers that are installed.")


def _folder_of(source: Path) -> Path:
    """Return the folder with the name of the study's file, in the current folder."""
    from deli.errors import InputError

    if source.stem in ("", ".", ".."):
        raise InputError(f"{source} gives no name for a folder; say which with -o.")
    return Path(source.stem)


def _print_plan(decisions: "Sequence[Decision]") -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table("case", "steps", "does", "why", "file")
    for decision in decisions:
        case = decision.case
        table.add_row(
            *(Text(cell) for cell in (case.title, f"{case.steps:,}", decision.action, decision.why, case.digest))
        )
    console().print(table)


def _counted(result: "Result") -> str:
    return f"{result.states.total()} runs: " + ", ".join(f"{count} {state}" for state, count in result.states.items())


def _complain_of(result: "Result", folder: Path, told: Container[str]) -> None:
    """Print the failed cases, except cases that were reported at their end, and the number of incomplete cases."""
    from deli.studies.states import DONE, FAILURES

    if result.stopped is not None:
        complain(f"interrupted by {result.stopped}; {_counted(result)}. The same command continues.")
        raise typer.Exit(RUN_FAILED)
    if result.states[DONE] == result.states.total():
        return
    failed = {digest: record for digest, record in result.runs.items() if record["state"] != DONE}
    for digest in [digest for digest in failed if digest not in told][:SHOWN_FAILURES]:
        record = failed[digest]
        complain(": ".join(filter(None, (result.titles[digest], record["state"], record["reason"]))))
    retry = " --retry-failed runs them again." if any(one["state"] in FAILURES for one in failed.values()) else ""
    complain(f"{len(failed)} of {result.states.total()} runs in {folder} are not done.{retry}")
    raise typer.Exit(RUN_FAILED)
