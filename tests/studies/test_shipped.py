"""Configs and studies that users start from: accepted, and found by name."""

from pathlib import Path

import pytest
from running import DONE, call, refused

import deli
from deli.config import load
from deli.studies import expansion, shipped
from deli.studies.shipped import studies

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("path", sorted((ROOT / "studies/configs").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_configs_are_accepted(path, tmp_path):
    plan = load(str(path), []).plan(tmp_path / "out.nc")
    assert plan.steps > 0


@pytest.mark.parametrize("path", sorted((ROOT / "studies").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_studies_are_accepted(path):
    assert expansion.load(path).cases


def test_every_study_has_a_name():
    others = {"configs", "paper"}
    found = [path for path in (ROOT / "studies").rglob("*.toml") if path.parent.name not in others]
    assert {path.resolve() for path in studies().values()} == {path.resolve() for path in found}
    assert len(found) > 20


def test_the_list_has_name_question_and_cases():
    result = call("study", "--list")
    assert result.exit_code == DONE
    rows = {
        cells[1].strip(): cells[2:4]
        for cells in (line.split("│") for line in result.stdout.splitlines())
        if len(cells) > 3
    }
    assert list(rows) == list(studies())
    for name in ("solver_tolerance", "stability/long_runs", "work_precision/solve_ivp"):
        study = expansion.load(studies()[name])
        assert [cell.strip() for cell in rows[name]] == [study.title, str(len(study.cases))]


@pytest.fixture
def away(tmp_path, monkeypatch):
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["solver_tolerance", "stability/gap", "work_precision/solve_ivp"])
def test_a_name_is_the_study_of_its_file(away, name):
    by_name, by_path = (call("study", source, "--dry-run") for source in (name, studies()[name]))
    assert by_name.exit_code == DONE
    assert by_name.stdout == by_path.stdout


def test_a_file_wins_over_a_name_and_a_folder_does_not(away):
    Path("stability/gap").mkdir(parents=True)
    assert call("study", "stability/gap", "--dry-run").stderr == ""
    Path("solver_tolerance").write_text(
        'title = "Mine"\n[base]\nscene = "point_mass"\nsteps = 2\n[axes]\nstep_size = [0.1]\n'
    )
    for quiet in (False, True):
        result = call("study", "solver_tolerance", "-o", "mine", "--dry-run", *["-q"] * quiet)
        assert result.exit_code == DONE
        assert ("solver_tolerance is a file here" in result.stderr) is not quiet
        assert quiet or "Mine" in result.stdout


def test_a_study_by_name_is_run_in_a_folder_of_its_name(away, monkeypatch):
    (away / "shipped/stability").mkdir(parents=True)
    (away / "shipped/stability/base.toml").write_text('scene = "point_mass"\nsteps = 2\n')
    (away / "shipped/stability/small.toml").write_text('base = "base.toml"\n[axes]\nstep_size = [0.1]\n')
    monkeypatch.setattr(shipped, "FOLDER", away / "shipped")
    for _ in range(2):  # the second time there is a folder of that name
        assert call("study", "stability/small", "-q", "--workers", "1").exit_code == DONE
    assert deli.open_study("small").sizes == {"step_size": 1}


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (["stabilty/gap"], ["stabilty/gap is no file", "did you mean 'stability/gap'?", "allowed: reflection"]),
        (["stability"], ["stability is no file", "stability/walls"]),
        (["no.toml"], ["no.toml cannot be read"]),
        ([], ["no study is given", "--list"]),
    ],
)
def test_studies_that_are_not_there(away, source, words):
    refused(call("study", *source), *words)
