"""Configs and studies that users start from are accepted."""

from pathlib import Path

import pytest

from deli.config import load
from deli.studies import expansion

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("path", sorted((ROOT / "studies/configs").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_configs_are_accepted(path, tmp_path):
    plan = load(str(path), []).plan(tmp_path / "out.nc")
    assert plan.steps > 0


@pytest.mark.parametrize("path", sorted((ROOT / "studies").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_studies_are_accepted(path):
    assert expansion.load(path).cases
