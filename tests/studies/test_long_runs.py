"""Long runs, as ``studies/long_runs/measure.py`` makes and watches them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).parents[2] / "studies" / "long_runs" / "measure.py"
QUICK = ["newtons_cradle closed_loop", "--quick"]


@pytest.mark.parametrize("selection", [QUICK, pytest.param([], marks=pytest.mark.long)], ids=["quick", "full"])
def test_long_runs_neither_drift_nor_leak_and_can_be_read_throughout(selection, tmp_path):
    figures = tmp_path / "figures.json"
    done = subprocess.run(
        [sys.executable, PROGRAM, *selection, "-o", figures], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    rows = json.loads(figures.read_text())
    assert sum(row["reads"] for row in rows) > 0
    for row in rows:
        low, high = row["energy"]
        assert row["outcome"] == "complete", row
        assert row["reads_that_differ"] == 0, row
        assert row["memory_growth_percent"] < 1.0, row
        assert low <= 0.0 <= high
        # What drifts leaves its band in proportion to time; what oscillates does not, however long. With E = H the
        # impacts of the Lennard-Jones chain let its energy walk.
        if row["run"] != "lennard_jones":
            assert abs(row["gain"]) <= max(0.5, 4.0 * row["gain_error"]), row
