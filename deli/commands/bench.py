"""``deli bench``: the time and memory that deli takes on this machine."""

from pathlib import Path
from typing import Annotated

import typer

from deli.bench import PARTS
from deli.commands.console import console, guarded
from deli.errors import InputError

DEFAULT = Path("deli-bench.json")


@guarded
def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help=f"Parts to measure: {', '.join(PARTS)} (default: all)."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few and short measurements: under a minute in all.")] = False,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="File of the results; parts that are not measured stay unchanged.")
    ] = DEFAULT,
    against: Annotated[
        Path | None,
        typer.Option("--against", help="Results to show beside the new ones (default: those in the output)."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress bar.")] = False,
) -> None:
    """Measure the time and memory that deli takes on this machine, beside earlier results.

    - `steps`: microseconds a step of each scene, with the compiled solver and with others
    - `skip`: the cost of a step with `skip = false`, over the cost with `skip = true`
    - `backends`: a re-solve by the compiled path, by the solver alone, and by `problem.solve()`
    - `scaling`: time and memory by number of bodies, their parts, and the errors
    - `ensemble`: many runs at once, over the ideal of all cores
    - `import`: `import deli`, `deli --help`, and a first run

    Times are medians; close other programs for reproducible times. Ratios are new over earlier.
    """
    unknown = [name for name in names or () if name not in PARTS]
    if unknown:
        raise InputError(f"{unknown[0]!r} is not a part of the benchmark; allowed: {', '.join(PARTS)}.")
    if output.suffix.lower() != ".json":
        raise InputError(f"output {output}: found the suffix {output.suffix!r}; results are JSON, allowed: .json.")
    if not output.parent.is_dir():
        raise InputError(f"{output} cannot be written: there is no folder {output.parent}.")

    from deli.bench import registry, store
    from deli.bench.report import print_part
    from deli.bench.runner import measure

    results = store.read(output) if output.exists() else {}
    before = dict(results) if against is None else store.read(against)
    for name in dict.fromkeys(names or PARTS):
        part = registry.get(name)
        results[name] = store.entry(measure(part, quick, shown=not quiet), quick)
        print_part(console(), part, results[name], before.get(name))
        store.write(output, results)
    console().print(f"Stored in {output}", soft_wrap=True)
