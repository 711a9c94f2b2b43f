"""A solver that was chosen and that nothing reached is named, with what to do; nothing is said where it is not true."""

import logging

import pytest
from typer.testing import CliRunner

import deli
from deli.cli import app
from deli.studies.findings import findings

ALL = "was never called: all 60 subproblems were answered without a solver, so its choice changed nothing"


def run(scene="point_mass", **keywords):
    return deli.simulate(deli.scenes.get(scene)(), deli.GVI(), step_size=0.01, steps=20, **keywords)


@pytest.mark.parametrize("backend", ["clarabel", "native", {"backend": "auto", "tolerance": 1e-3}])
def test_a_choice_that_changes_nothing_is_named(backend, caplog):
    name = backend if isinstance(backend, str) else backend["backend"]
    measured = deli.metrics.measure(run(solvers=backend))
    assert measured.attrs["note"].startswith(f"{name} {ALL}; with skip=False ")
    assert measured["uncalled_solvers"] == 1.0
    assert [record.levelno for record in caplog.records if ALL in record.getMessage()] == [logging.WARNING]


@pytest.mark.parametrize(
    ("scene", "keywords"),
    [
        ("point_mass", {}),
        ("point_mass", {"solvers": "clarabel", "skip": False}),
        ("newtons_cradle", {"solvers": "clarabel"}),
    ],
    ids=["nothing chosen", "nothing skipped", "called"],
)
def test_nothing_is_said_where_nothing_was_chosen_or_it_was_called(scene, keywords, caplog):
    measured = deli.metrics.measure(run(scene, **keywords))
    assert "note" not in measured.attrs
    assert measured["uncalled_solvers"] == 0.0
    assert not any("never called" in record.getMessage() for record in caplog.records)


def test_a_choice_for_one_subproblem_is_judged_by_it():
    found = run("newtons_cradle", solvers={"reflection": "daqp", "position": "clarabel"})
    (told,) = deli.metrics.uncalled_solvers(found)
    assert told.startswith("daqp was never called: all ")
    assert "subproblems of reflection were answered" in told


def test_where_nothing_was_skipped_nothing_was_posed():
    ball = deli.scenes.point_mass(position=1e3)
    found = deli.simulate(ball, deli.SolveIvp(), step_size=0.01, steps=2, solvers="daqp", skip=False)
    assert (
        deli.metrics.uncalled_note(found) == "daqp was never called: nothing was posed, so its choice changed nothing"
    )


def test_members_of_an_ensemble_are_judged_together(caplog):
    scenes = [deli.scenes.point_mass(position=1.0 + place) for place in range(2)]
    found = deli.simulate_ensemble(scenes, deli.GVI(), step_size=0.01, steps=10, solvers="daqp")
    assert deli.metrics.uncalled_solvers(found) == [f"daqp {ALL}"]
    assert sum(ALL in record.getMessage() for record in caplog.records) == 1


@pytest.mark.parametrize("skip", ["true", "false"])
def test_the_command_line_says_so(skip, tmp_path):
    options = ["--set", "solvers.default=osqp", "--set", "steps=20", "--set", f"skip={skip}"]
    ended = CliRunner().invoke(app, ["run", "point_mass", *options, "-o", str(tmp_path / "run.nc")])
    assert ended.exit_code == 0, ended.output
    assert ("osqp was never called" in ended.output) == (skip == "true")


def test_a_study_says_in_how_many_cases(tmp_path):
    (tmp_path / "study.toml").write_text("""
        base = { steps = 20, step_size = 0.01, method.name = "gvi" }
        axes = { "scene.name" = ["point_mass", "newtons_cradle"], "solvers.default.backend" = ["daqp", "osqp"] }
    """)
    options = ["-o", str(tmp_path / "out"), "--workers", "1", "-q"]
    ended = CliRunner().invoke(app, ["study", str(tmp_path / "study.toml"), *options])
    assert ended.exit_code == 0, ended.output
    told = [sentence for sentence in findings(deli.open_study(tmp_path / "out")) if "never called" in sentence]
    assert [sentence[:60] for sentence in told] == ["In 2 of 4 completed cases (point_mass 2), a chosen solver wa"]
