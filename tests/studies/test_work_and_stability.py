"""Studies of work against error and of stability: every file is one that ``deli study`` takes, in full and quick."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import deli
from deli.cli import app

STUDIES = Path(__file__).parents[2] / "studies"
FILES = [path for folder in ("work_precision", "stability") for path in sorted((STUDIES / folder).glob("*.toml"))]


@pytest.mark.parametrize("quick", [False, True], ids=["full", "quick"])
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_study_file_expands(path, quick, tmp_path):
    options = ["--quick"] if quick else []
    ended = CliRunner().invoke(app, ["study", str(path), "--dry-run", "-o", str(tmp_path / "out"), *options])
    assert ended.exit_code == 0, ended.output
    assert "runs to do" in ended.output
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_quick_study_ends(path, tmp_path):
    """Cases that fail are part of the answer; none is without an end."""
    ended = CliRunner().invoke(app, ["study", str(path), "--quick", "--quiet", "-o", str(tmp_path / "out")])
    assert ended.exit_code in (0, 1), ended.output
    states = deli.open_study(tmp_path / "out").state
    assert set(states.values.ravel()) <= {"done", "failed", "timed out", "excluded"}
    assert (states == "done").any()
