"""Studies that run: what is run again and why, and what one case's end does to the others."""

import json

import numpy as np
import psutil
import pytest
import xarray as xr
from running import DONE, RUN_FAILED, assert_same, call, refused
from study_cases import (
    BALL,
    CRADLE,
    ENDLESS,
    SEEDS,
    Watch,
    assert_same_runs,
    interrupt,
    is_worker,
    kill_workers,
    recorded,
    run,
    study,
)

import deli
from deli.studies import measuring, planning
from deli.studies.running import plan_study

MASSES = {"axes": {"scene.mass": [1.0, 2.0, 3.0]}}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What an undisturbed study of `SEEDS` records."""
    folder = tmp_path_factory.mktemp("whole")
    assert run(folder, SEEDS).states == {"done": 2}
    return recorded(folder)


def whys(folder, table, **options):
    return [decision.why for decision in plan_study(study(folder, **table), folder / "out", **options)]


def test_a_finished_study_reruns_nothing_and_a_changed_one_what_has_changed(folder, monkeypatch):
    assert whys(folder, MASSES) == ["missing"] * 3
    first = run(folder, MASSES)
    assert first.states == {"done": 3}
    written = {path: path.stat().st_mtime_ns for path in (folder / "out" / "cases").iterdir()}

    watch = Watch()
    assert run(folder, MASSES, watcher=watch).states == {"done": 3}
    assert watch.log == []
    assert {path: path.stat().st_mtime_ns for path in (folder / "out" / "cases").iterdir()} == written

    missing = folder / "out" / "cases" / f"{study(folder, **MASSES).cases[1].digest}.nc"
    missing.unlink()
    assert whys(folder, MASSES) == ["done", "missing", "done"]
    watch = Watch()
    run(folder, MASSES, watcher=watch)
    assert watch.begun == {"mass = 2.0": "missing"}

    longer = {**MASSES, "base": {**BALL, "steps": 30}}
    assert whys(folder, longer) == ["config changed: steps was 20 and is 30"] * 3
    monkeypatch.setattr(planning, "__version__", "9.9")
    assert whys(folder, MASSES) == [f"deli was {deli.__version__} and is 9.9"] * 3


def test_a_run_is_that_of_its_config_alone(folder):
    table = {"base": {**CRADLE, "steps": 500}, "axes": {"scene.perturbation": [{"seed": 3, "momentum": 1e-3}]}}
    run(folder, table)
    (case,) = study(folder, **table).cases
    alone = folder / "out" / "cases" / f"{case.digest}.toml"
    assert call("run", alone, "-o", "alone.nc", "--quiet").exit_code == DONE
    assert_same(deli.open_run("alone.nc"), deli.open_run(alone.with_suffix(".nc")))


def test_metrics_are_measured_anew_where_their_definition_changed(folder, monkeypatch):
    run(folder, MASSES)
    monkeypatch.setattr(planning, "definition", lambda: "another")
    decisions = plan_study(study(folder, **MASSES), folder / "out")
    assert {(decision.action, decision.why) for decision in decisions} == {
        ("measure", "the definition of metrics has changed")
    }
    monkeypatch.undo()
    path = folder / "out" / "cases" / f"{decisions[0].case.digest}.nc"
    kept = measuring.measured(path)
    old = json.loads(path.with_suffix(".json").read_text())
    path.with_suffix(".json").write_text(json.dumps({**old, "definition": "old", "metrics": {"steps": 1.0}}))
    before = path.stat().st_mtime_ns
    watch = Watch()
    run(folder, MASSES, watcher=watch)
    assert watch.begun == {"mass = 1.0": "the definition of metrics has changed"}
    assert measuring.measured(path).metrics == pytest.approx(kept.metrics, nan_ok=True)
    assert path.stat().st_mtime_ns == before


def test_a_failing_case_stops_no_other(folder):
    """Substituted into the midpoint rule, a mass in a sphere gains energy until no step can be computed."""
    table = {
        "base": {"scene": {"name": "spring_sphere", "start": "mixed"}, "step_size": 0.5, "duration": 100.0},
        "cases": [
            {"label": "direct", "method": {"name": "direct", "constraint": "midpoint"}},
            {"label": "gvi", "method": {"name": "gvi"}},
        ],
    }
    (folder / "fails.toml").write_text(_toml(table))
    result = call("study", "fails.toml", "-o", "out", "--workers", "1")
    assert result.exit_code == RUN_FAILED, result.output
    assert "failed in step" in result.stdout
    assert result.stderr == "deli: 1 of 2 runs in out are not done. --retry-failed runs them again.\n"
    for arguments in ((), ("-q",), ("-q", "--retry-failed"), ("--retry-failed",)):  # told once, however it is called
        again = call("study", "fails.toml", "-o", "out", "--workers", "1", *arguments)
        assert again.output.count("failed in step") == 1
        assert ("case = direct: failed: failed in step" in again.stderr) == (arguments != ("--retry-failed",))
    found = deli.open_study("out")
    assert found.state.sel(case=["direct", "gvi"]).values.tolist() == ["failed", "done"]
    assert found.outcome.sel(case="direct").item().startswith("failed in step")
    assert found.outcome.sel(case="gvi") == "complete"
    assert np.isnan(found.energy_band.sel(case="direct"))
    assert found.energy_band.sel(case="gvi") > 0
    assert found.deli.run(case="direct")["trajectory"].sizes["time"] > 1
    assert whys(folder, table) == ["failed", "done"]
    assert whys(folder, table, retry_failed=True) == ["failed before, --retry-failed", "done"]


def test_a_killed_case_stops_no_other_and_is_continued_when_told_to(folder, whole):
    first = run(folder, SEEDS, watcher=Watch(kill_workers))
    assert first.states == {"killed": 1, "done": 1}
    (record,) = [record for record in first.runs.values() if record["state"] == "killed"]
    assert "SIGKILL" in record["reason"]
    assert run(folder, SEEDS).states == {"killed": 1, "done": 1}
    watch = Watch()
    assert run(folder, SEEDS, retry_failed=True, watcher=watch).states == {"done": 2}
    assert list(watch.begun.values()) == ["killed before, --retry-failed"]
    assert_same_runs(recorded(folder), whole)


def test_limits_end_the_case_that_exceeds_them(folder):
    short, large = (
        {"label": "short"},
        {"label": "large", "scene": {"name": "hard_rods", "rods": 600_000}, "record.every": 200},
    )
    endless = {"label": "endless", "steps": ENDLESS, "record.every": 1_000_000}
    table = {"cases": [endless, large, short], "limits": {"time": 6.0, "memory": "450 MB"}}
    result = run(folder, table, workers=2)
    found = deli.open_study(folder / "out")
    assert found.state.values.tolist() == ["timed out", "out of memory", "done"], found.outcome.values
    assert found.outcome.values[0] == "timed out: limit 6 s"
    assert "limit 450 MB" in found.outcome.values[1]
    assert result.states["done"] == 1
    assert found.deli.run(case="endless").attrs["outcome"].startswith("interrupted by SIGTERM")
    assert whys(folder, table) == ["timed out", "out of memory", "done"]


def test_what_cases_load_is_loaded_once_whatever_the_limit(folder):
    """A worker that were replaced for the libraries it holds would load them again for every case."""
    workers = set()

    class Count(Watch):
        def ended(self, decision, record):
            super().ended(decision, record)
            workers.update(child.pid for child in psutil.Process().children() if is_worker(child))

    table = {
        "base": {**CRADLE, "steps": 20, "skip": False},
        "axes": {"solvers.default.backend": ["native", "clarabel", "osqp"], "solvers.default.tolerance": [1e-8, 1e-9]},
        "limits": {"memory": "1500 MB"},
    }
    assert run(folder, table, watcher=Count()).states == {"done": 6}
    assert len(workers) == 1


def test_an_interrupted_study_is_continued_to_the_bit(folder, whole):
    first = run(folder, SEEDS, watcher=Watch(interrupt))
    assert first.stopped == "SIGINT"
    assert first.states == {"interrupted": 1, "waiting": 1}
    assert whys(folder, SEEDS) == ["unfinished", "missing"]
    partial = next((folder / "out" / "cases").glob("*.partial"))
    assert 1 < deli.open_run(partial)["trajectory"].sizes["time"] < 301
    assert run(folder, SEEDS).states == {"done": 2}
    assert_same_runs(recorded(folder), whole)


def test_dry_run_writes_nothing(folder):
    (folder / "masses.toml").write_text(_toml(MASSES))
    result = call("study", "masses.toml", "--dry-run")
    assert result.exit_code == DONE
    for words in ("mass = 2.0", "missing", "3 of 3 runs to do: 3 missing"):
        assert words in result.stdout
    assert [path.name for path in folder.iterdir()] == ["masses.toml"]


def test_lines_where_there_is_no_terminal(folder):
    (folder / "masses.toml").write_text(_toml(MASSES))
    result = call("study", "masses.toml")
    assert result.exit_code == DONE, result.output
    for words in ("[1/3] done in", "(missing)", "about", "left", "3 runs: 3 done; in masses"):
        assert words in result.stdout
    assert "nothing to do: all 3 runs are recorded" in call("study", "masses.toml").stdout
    assert call("study", "masses.toml", "--quiet").stdout == ""


def test_folders_that_are_no_study_s(folder):
    (folder / "masses.toml").write_text(_toml(MASSES))
    refused(call("study", "masses.toml", "-o", "."), "holds other files than a study's")
    refused(call("study", "masses.toml", "-o", "masses.toml"), "masses.toml is a file")
    refused(call("study", "masses.toml", "--workers", "2", "--scheduler", "tcp://x:1"), "both given")
    with pytest.raises(deli.InputError, match="holds no study"):
        deli.open_study(folder)


def test_a_study_opens_as_one_dataset(folder):
    table = {
        "axes": {"scene.mass": [1.0, 2.0], "step_size": [0.01, 0.02]},
        "zip": [
            {"name": "fall", "labels": ["low", "high"], "values": {"scene.position": [1.0, 2.0], "steps": [20, 30]}}
        ],
        "exclude": [{"mass": 2.0, "fall": "high"}],
        "reference": {"exact": True},
    }
    run(folder, table)
    found = deli.open_study(folder / "out")
    assert dict(found.sizes) == {"mass": 2, "step_size": 2, "fall": 2}
    assert found.position.dims == ("fall",)
    assert found.state.sel(mass=2.0, fall="high").values.tolist() == ["excluded", "excluded"]
    assert found.outcome.sel(mass=2.0, fall="high").values.tolist() == ["", ""]
    assert np.isnan(found.steps.sel(mass=2.0, fall="high")).all()
    case = found.sel(mass=1.0, fall="high")
    assert case.steps.values.tolist() == [30, 30]
    assert (case.trajectory_error < 1e-12).all()
    assert case.energy_band.attrs == found.energy_band.attrs
    assert found.energy_band.attrs["units"] == "M L2 T-2"
    one = case.deli.run(step_size=0.02)
    assert one["trajectory"].time.values[-1] == pytest.approx(0.6)
    xr.testing.assert_identical(
        deli.metrics.measure(one).steps.drop_attrs(),
        found.sel(mass=1.0, fall="high", step_size=0.02)
        .steps.drop_vars(["mass", "fall", "step_size", "position"])
        .drop_attrs(),
    )
    for labels, words in [
        ({"mass": 1.0}, "name one step_size of: 0.01, 0.02"),
        ({"mass": 3.0, "step_size": 0.01, "fall": "low"}, "mass is 3.0; allowed: 1.0, 2.0"),
        ({"mass": 2.0, "step_size": 0.01, "fall": "high"}, "the study excludes mass = 2.0"),
        ({"mass": 2.0, "step_size": 0.01, "fall": "low", "weight": 1}, "'weight' is no axis"),
    ]:
        with pytest.raises(deli.InputError, match=words):
            found.deli.run(**labels)


def _toml(table):
    import tomli_w

    return tomli_w.dumps({"base": BALL, **table})


def test_references_run_first_and_are_no_cases(folder):
    base = {"scene": "newtons_cradle", "step_size": 0.1, "duration": 0.2}
    table = {"base": base, "axes": {"step_size": [0.01, 0.02]}, "reference": {"step_size": 0.001}}
    watch = Watch()
    result = run(folder, table, workers=2, watcher=watch)
    assert result.states == {"done": 3}
    assert next(iter(watch.begun)).startswith("reference")
    found = deli.open_study(folder / "out")
    assert dict(found.sizes) == {"step_size": 2}
    fine, coarse = found.trajectory_error.values
    assert 0 < 2 * fine < coarse
