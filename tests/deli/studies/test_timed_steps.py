"""A study with ``time_steps`` knows what its steps cost, apart from what recording them does."""

import numpy as np
from study_cases import BALL, run, study
from typer.testing import CliRunner

import deli
from deli.cli import app
from deli.studies.running import plan_study

AXES = {"axes": {"step_size": [0.01, 0.02]}, "reference": {"step_size": 0.005}}


def test_steps_are_timed_where_a_study_asks_for_it(tmp_path):
    run(tmp_path, {**AXES, "time_steps": True})
    found = deli.open_study(tmp_path / "out")
    assert found["cpu_time"].attrs == {"units": "s", "long_name": "CPU time of the steps, with nothing recorded"}
    assert (found["cpu_time"] > 0.0).all()
    assert np.isfinite(found["recording_time"]).all()


def test_a_study_that_asks_for_it_later_runs_nothing_again(tmp_path):
    run(tmp_path, AXES)
    assert "cpu_time" not in deli.open_study(tmp_path / "out")
    decisions = plan_study(study(tmp_path, **AXES, time_steps=True), tmp_path / "out")
    told = {(bool(each.case.labels), each.action, each.why) for each in decisions}
    assert told == {(True, "measure", "steps are not timed yet"), (False, "keep", "done")}  # references are not timed
    run(tmp_path, {**AXES, "time_steps": True})
    assert (deli.open_study(tmp_path / "out")["cpu_time"] > 0.0).all()
    decisions = plan_study(study(tmp_path, **AXES, time_steps=True), tmp_path / "out")
    assert {each.action for each in decisions} == {"keep"}


def test_timing_takes_every_step_and_leaves_no_file(monkeypatch, tmp_path):
    """The clock is made up: each reading of it is a second later, so that one repetition of each is enough."""
    from deli.config import parse
    from deli.studies import timing

    readings = iter(range(100))
    monkeypatch.setattr(timing.time, "process_time", lambda: float(next(readings)))
    monkeypatch.setattr(timing.tempfile, "tempdir", str(tmp_path))
    assert timing.time_run(parse(BALL).plan()) == {"cpu_time": 1.0, "recording_time": 0.0}
    assert not list(tmp_path.iterdir())


def test_plots_and_findings_are_of_the_time_of_steps(tmp_path):
    run(tmp_path, {**AXES, "time_steps": True})
    ended = CliRunner().invoke(app, ["report", str(tmp_path / "out")])
    assert ended.exit_code == 0, ended.output
    text = (tmp_path / "out" / "report.md").read_text()
    assert "CPU time of steps" in text
    assert "recording\\_time" in text or "recording_time" in text
