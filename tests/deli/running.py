"""What tests of runs share: running the command line, comparing runs."""

import subprocess
import sys

import xarray as xr
from typer.testing import CliRunner

from deli.cli import app

CLOCKS = ["solve_time", "overhead_time"]
H = 0.01
DONE, RUN_FAILED, INPUT_AT_FAULT = 0, 1, 2
SHORT = ["--set", "steps=20"]


def groups(run):
    """Everything of a run that does not depend on the clock."""
    stats = run["solver_stats"].to_dataset().drop_vars(CLOCKS)
    return run["trajectory"].to_dataset(), stats


def assert_same(one, other):
    for a, b in zip(groups(one), groups(other), strict=True):
        xr.testing.assert_identical(a, b)


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def refused(result, *words):
    assert result.exit_code == INPUT_AT_FAULT, result.output
    assert result.stderr.startswith("deli: ")
    assert result.stderr.count("\n") == 1
    for word in words:
        assert word in result.stderr


def deli_process(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "deli", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options
    )
