"""A process that opens, checks, draws and continues recorded runs, as users do, whatever state the files are in.

An order is a line of JSON: what to do, with which file, and the whole file that it was made of. An answer is one, too:
``refused`` and why, ``same`` as the whole file, ``other``, or ``failed`` and how, where deli raises what it should not.
"""

import json
import shutil
import sys
import traceback
import warnings
from functools import cache
from pathlib import Path

import xarray as xr
from typer.testing import CliRunner

import deli
from deli.cli import app
from deli.errors import InputError

BALLS, STEP_SIZE, STEPS = 3, 0.02, 40
CLOCKS = ["solve_time", "overhead_time"]


def simulate(output, steps=STEPS, **options):
    scene = deli.scenes.newtons_cradle(balls=BALLS)
    return deli.simulate(
        scene, deli.GVI(), step_size=STEP_SIZE, steps=steps, output=output, skip=False, subproblems=True, **options
    )


def numbers(run):
    """Everything that was recorded and does not depend on the clock."""
    return [
        run[group].to_dataset().drop_vars(CLOCKS, errors="ignore")
        for group in ("trajectory", "solver_stats", "subproblems")
    ]


def same(one, other):
    return all(mine.identical(theirs) for mine, theirs in zip(numbers(one), numbers(other), strict=True))


@cache
def whole(path):
    return deli.open_run(path)


def look(path, before):
    return "same" if same(deli.open_run(path), whole(before)) else "other"


def command(*arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exit_code == 2 and result.stderr.startswith("deli: ") and result.stderr.count("\n") == 1:
        raise InputError(result.stderr.strip())
    if result.exit_code:
        raise RuntimeError(f"exit status {result.exit_code}: {result.output}") from result.exception


def check(path, before):
    command("check", path)
    return look(path, before)


def plot(path, before):
    found = look(path, before)
    if found == "other":
        command("plot", path, "-o", "picture.png")
    return found


def animate(path, before):
    found = look(path, before)
    if found == "other":
        command("animate", path, "-o", "film.gif", "--overwrite", "--every", "40", "--dpi", "20", "-q")
    return found


def replay(path, before):
    mine, its = (deli.load_subproblem(file, -1) for file in (path, before))
    return "same" if all((one.value == two.value).all() for one, two in pairs(mine, its)) else "other"


def pairs(mine, its):
    return zip(mine.parameters() + mine.variables(), its.parameters() + its.variables(), strict=True)


def resume(path, before):
    """Continue a partial file; where that is refused, the file must be as it was."""
    place = Path("resumed.nc.partial")
    shutil.copyfile(path, place)
    found = place.read_bytes()
    try:
        run = simulate("resumed.nc", resume=True)
    except InputError:
        assert place.read_bytes() == found
        raise
    finally:
        for path in (place, Path("resumed.nc")):
            path.unlink(missing_ok=True)
    return "same" if same(run, whole(before)) else "other"


def answer(what, path, before):
    try:
        return [globals()[what](path, before), ""]
    except InputError as error:
        return ["refused", str(error)]
    except Exception:
        return ["failed", traceback.format_exc()]


if __name__ == "__main__":
    warnings.simplefilter("error")
    xr.set_options(keep_attrs=True)
    for line in sys.stdin.read().splitlines():
        print(json.dumps(answer(*json.loads(line))), flush=True)
