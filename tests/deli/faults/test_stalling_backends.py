"""Backends that stall or end their process: what was computed before is kept, and other cases of a study go on."""

import os
import shutil
import signal
import sys
import threading
import time
from pathlib import Path

import lies
import numpy as np
import pytest
import tomli_w
from lies import ENDING, LIES, RAISING
from running import RUN_FAILED, deli_process

import deli
import solvers
from deli.integrators.bridge import Bridge
from deli.running import crew, session

PATIENCE = 120.0  # that guards against a test that hangs
SPHERE = {"scene": {"name": "spring_sphere", "start": "smooth"}, "step_size": 0.1, "skip": False}


def choice(backend, honest):
    return {"default": "native", "projection": {"backend": backend, "polish": False, "options": {"honest": honest}}}


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A folder that offers all backends of `lies` to any process that has it on its path."""
    folder = tmp_path_factory.mktemp("package")
    shutil.copy(Path(lies.__file__), folder / "lies.py")
    info = folder / "lies-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lies\nVersion: 1.0\n")
    names = (*LIES, *RAISING, *ENDING)
    (info / "entry_points.txt").write_text("\n".join(["[deli.solvers]", *(f"{n} = lies:offered.{n}" for n in names)]))
    return folder


@pytest.fixture
def environment(package):
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(package), os.environ.get("PYTHONPATH", "")])}


@pytest.fixture(scope="module")
def honest_rows():
    scene = deli.scenes.spring_sphere(start="smooth")
    return deli.simulate(scene, deli.GVI(), step_size=0.1, steps=60, skip=False, solvers="native")


def assert_right(run, honest, rows):
    found, expected = run["trajectory"], honest["trajectory"]
    assert found.sizes["time"] == rows
    for name in ("position", "momentum", "hamiltonian", "gap_min"):
        np.testing.assert_allclose(found[name], expected[name][:rows], rtol=0, atol=1e-12, err_msg=name)


def wait_for(what):
    deadline = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def simulate(function, **keywords):
    """Run with a backend that is honest for 30 solves and calls `function` then."""
    solvers.register("acting", lies.acting("acting", function))
    try:
        scene = deli.scenes.spring_sphere(start="smooth")
        keywords = {"step_size": 0.1, "steps": 60, "skip": False, "solvers": choice("acting", 30), **keywords}
        if "workers" in keywords:
            return deli.simulate_ensemble([scene] * 3, deli.GVI(), **keywords)
        return deli.simulate(scene, deli.GVI(), **keywords)
    finally:
        solvers.unregister("acting")


class TestStall:
    """Backends that send their own process the signals while they stall."""

    @pytest.mark.parametrize(("number", "times"), [(signal.SIGINT, 2), (signal.SIGTERM, 1)])
    def test_a_signal_breaks_off_the_step_and_keeps_all_rows(self, folder, honest_rows, monkeypatch, number, times):
        """A second signal at once, a single one after some time."""
        monkeypatch.setattr(session, "STEP_SECONDS", 0.2 if times == 1 else PATIENCE)

        def stall():
            for _ in range(times):
                os.kill(os.getpid(), number)
            lies.stall()

        outcome = f"interrupted by {number.name} after step 30, in the middle of the next"
        with pytest.raises(deli.Interrupted, match=f"{outcome}; 31 rows are in run.nc.partial: resume") as stop:
            simulate(stall, output="run.nc")
        run = deli.open_run("run.nc.partial")
        assert run.attrs["outcome"] == stop.value.run.attrs["outcome"] == outcome
        assert_right(run, honest_rows, 31)
        assert [path.name for path in folder.iterdir()] == ["run.nc.partial"]

    def test_a_late_end_of_the_step_is_an_end(self, honest_rows, monkeypatch):
        monkeypatch.setattr(session, "STEP_SECONDS", PATIENCE)
        called = []

        def dawdle():
            if not called:
                called.append(os.kill(os.getpid(), signal.SIGTERM))
                time.sleep(0.3)

        with pytest.raises(deli.Interrupted, match=r"interrupted by SIGTERM after step \d+; the rows are in") as stop:
            simulate(dawdle)
        rows = stop.value.run["trajectory"].sizes["time"]
        assert rows > 31
        assert_right(stop.value.run, honest_rows, rows)

    @pytest.mark.parametrize("times", [1, 2])
    def test_an_ensemble_leaves_a_stalled_member_to_itself(self, honest_rows, monkeypatch, times):
        monkeypatch.setattr(crew, "PATIENCE_SECONDS", 0.2 if times == 1 else PATIENCE)
        over = threading.Event()

        def stall():
            for _ in range(times):
                signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
                time.sleep(0.2)
            over.wait()

        try:
            with pytest.raises(deli.Interrupted, match="interrupted by SIGINT with 0 of 3 members complete") as stop:
                simulate(stall, workers=1)
            run = stop.value.run
            stalled = "interrupted after step 30, in the middle of the next"
            assert run["outcome"].values.tolist() == [stalled, *["interrupted before step 1"] * 2]
            position = run["trajectory"]["position"].values
            np.testing.assert_allclose(position[0, :31], honest_rows["trajectory"]["position"][:31], atol=1e-12)
            assert np.isnan(position[0, 31:]).all()
            assert np.isnan(position[1:]).all()
        finally:
            over.set()


def test_a_function_that_a_signal_ends_before_its_first_line_has_not_answered(monkeypatch):
    """Exceptions cannot pass through compiled code, which would take what it finds in its arrays for the answer."""

    def interrupted(*_):
        raise KeyboardInterrupt

    seen = []
    monkeypatch.setattr(sys, "unraisablehook", seen.append)
    scene = deli.scenes.spring_sphere(start="smooth")
    monkeypatch.setattr(Bridge, "_answer_program", interrupted)
    stepper = deli.GVI().stepper(scene, 0.1, "daqp", False)
    with pytest.raises(KeyboardInterrupt):
        stepper.step(scene.position, scene.momentum)
    assert [report.exc_type for report in seen] == [KeyboardInterrupt]


STATES = {
    "stall": "timed out",
    "crash": "killed",
    "noise": "failed",
    "exit_at_once": "killed",
    "nothing": "failed",
    "error": "failed",
    "leave": "failed",
}


@pytest.mark.parametrize(
    "faults", [pytest.param(("noise", "crash")), pytest.param(tuple(STATES), marks=pytest.mark.long)]
)
def test_a_study_records_what_becomes_of_each_case(folder, environment, honest_rows, faults):
    cases = [{"label": name, "solvers": choice(name, 30)} for name in faults]
    cases.append({"label": "honest", "solvers": choice("stall", 1000)})
    table = {
        "base": {**SPHERE, "steps": 60},
        "cases": cases,
        "limits": {"time": 4.0 if "stall" in faults else 60.0},
        "workers": 1,
    }
    (folder / "study.toml").write_text(tomli_w.dumps(table))
    process = deli_process("study", "study.toml", cwd=folder, env=environment)
    try:
        told, said = process.communicate(timeout=5 * PATIENCE)
    finally:
        process.kill()
    assert process.returncode == RUN_FAILED, said
    count = len(faults)
    assert f"{count} of {count + 1} runs in study are not done. --retry-failed runs them again." in said
    assert "Traceback" not in said
    found = deli.open_study("study")
    states, outcomes = (dict(zip(found.case.values, found[name].values, strict=True)) for name in ("state", "outcome"))
    assert states == {**{name: STATES[name] for name in faults}, "honest": "done"}
    assert outcomes.get("stall", "timed out: limit 4 s") == "timed out: limit 4 s"
    assert outcomes["crash"] == "killed: by SIGSEGV"
    assert outcomes.get("exit_at_once", "killed: exit status 3") == "killed: exit status 3"
    assert_right(found.deli.run(case="honest"), honest_rows, 61)
    for name in faults:
        run = found.deli.run(case=name)
        killed = STATES[name] == "killed"
        assert_right(run, honest_rows, run["trajectory"].sizes["time"] if killed else 31)
        if name == "stall":
            assert run.attrs["outcome"] == "interrupted by SIGTERM after step 30, in the middle of the next"
        elif not killed:
            assert outcomes[name].startswith(f"failed in step 31 (from time 3): projection: backend {name!r} r")
        (line,) = (line for line in told.splitlines() if f"case = {name} " in line)
        assert f"] {STATES[name]} in " in line
        assert outcomes[name].removeprefix(f"{STATES[name]}: ") in line


@pytest.mark.long
class TestRun:
    def begin(self, folder, environment, backend, honest, steps=60):
        (folder / "run.toml").write_text(tomli_w.dumps({**SPHERE, "steps": steps, "solvers": choice(backend, honest)}))
        return deli_process("run", "run.toml", "--quiet", cwd=folder, env=environment)

    @pytest.mark.parametrize(("number", "times"), [(signal.SIGINT, 2), (signal.SIGTERM, 1)])
    def test_a_signal_ends_a_stalled_step_with_all_rows_kept(self, folder, environment, honest_rows, number, times):
        process = self.begin(folder, environment, "stall", 30)
        try:
            wait_for((folder / "run.nc.partial").exists)
            time.sleep(1.0)
            for _ in range(times):
                process.send_signal(number)
                time.sleep(0.3)
            _, said = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
        assert process.returncode == RUN_FAILED
        outcome = f"interrupted by {number.name} after step 30, in the middle of the next"
        assert said == f"deli: {outcome}; 31 rows are in run.nc.partial: resume to continue.\n"
        assert_right(deli.open_run("run.nc.partial"), honest_rows, 31)

    @pytest.mark.parametrize(
        ("backend", "number", "code"),
        [
            ("exit_at_once", None, 3),
            ("crash", None, -signal.SIGSEGV),
            ("stall_in_c", signal.SIGINT, -signal.SIGQUIT),
        ],
    )
    def test_committed_rows_are_in_the_file_when_the_process_is_gone(self, folder, environment, backend, number, code):
        """A stall inside a library in C hears of no signal that Python handles; one that the system handles ends it."""
        steps = 60_000
        process = self.begin(folder, environment, backend, steps, 2 * steps)
        try:
            if number is not None:
                rows = wait_for_rows(folder / "run.nc.partial")
                for _ in range(3):
                    process.send_signal(number)
                    time.sleep(0.5)
                assert process.poll() is None
                assert len(deli.open_run("run.nc.partial")["trajectory"]["time"]) == rows
                process.send_signal(signal.SIGQUIT)
            process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
        assert process.returncode == code
        assert not (folder / "run.nc").exists()
        run = deli.open_run("run.nc.partial")
        rows = run["trajectory"].sizes["time"]
        assert 256 <= rows <= steps + 1
        assert "complete" not in run.attrs["outcome"]
        scene = deli.scenes.spring_sphere(start="smooth")
        honest = {"default": "native", "projection": {"backend": "daqp", "polish": False}}
        full = deli.simulate(scene, deli.GVI(), step_size=0.1, steps=rows, skip=False, solvers=honest)
        for name in ("position", "momentum", "hamiltonian", "gap_min"):
            np.testing.assert_array_equal(run["trajectory"][name], full["trajectory"][name][:rows])


def wait_for_rows(path):
    """Wait until a file of rows grows no more."""
    seen = [0, 0]
    deadline = time.monotonic() + PATIENCE
    while seen[-1] == 0 or seen[-1] != seen[-2]:
        assert time.monotonic() < deadline
        time.sleep(3.0)
        seen.append(deli.open_run(path)["trajectory"].sizes["time"] if path.exists() else 0)
    return seen[-1]
