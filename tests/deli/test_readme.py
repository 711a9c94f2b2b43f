"""What the README tells a reader to type works as written."""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from deli.config import load
from deli.studies import expansion

ROOT = Path(__file__).parents[2]


def run_code(blocks):
    for block in blocks:
        exec(compile(block, "documented code", "exec"), {"__name__": "documented"})


def test_the_readme_s_python_runs_in_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(blocks) >= 5
    run_code(blocks)
    assert (tmp_path / "cradle.nc").exists()
    plt.close("all")


@pytest.mark.parametrize("path", sorted((ROOT / "studies/configs").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_configs_are_accepted(path, tmp_path):
    plan = load(str(path), []).plan(tmp_path / "out.nc")
    assert plan.steps > 0


@pytest.mark.parametrize("path", sorted((ROOT / "studies").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_studies_are_accepted(path):
    assert expansion.load(path).cases
