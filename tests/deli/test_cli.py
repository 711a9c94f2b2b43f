"""``deli run``: what it prints, what it refuses, and its exit status."""

import os
import signal
import subprocess
import sys
import time

import pytest
import xarray as xr
from running import DONE, INPUT_AT_FAULT, RUN_FAILED, SHORT, call, deli_process, refused

import deli
from deli.errors import StepError

pytestmark = pytest.mark.usefixtures("folder")


class TestRun:
    def test_a_scene(self, folder):
        result = call("run", "newtons_cradle", *SHORT)
        assert result.exit_code == DONE, result.output
        run = deli.open_run(folder / "newtons_cradle.nc")
        assert run["trajectory"].sizes["time"] == 21
        for word in ("complete", "energy error", "smallest gap", "position", "Recorded in newtons_cradle.nc"):
            assert word in result.stdout

    def test_a_config(self, folder):
        (folder / "fall.toml").write_text('steps = 10\nscene = "point_mass"\n[record]\noutput = "ball.nc"\nevery = 5\n')
        assert call("run", "fall.toml").exit_code == DONE
        assert deli.open_run("ball.nc")["trajectory"].sizes["time"] == 3
        assert call("run", "fall.toml", "-o", "other.nc", "--set", "record.every=2", "--quiet").stdout == ""
        assert deli.open_run("other.nc")["trajectory"].sizes["time"] == 6

    def test_a_picture(self, folder):
        assert call("run", "point_mass", *SHORT, "--plot", "ball.png").exit_code == DONE
        assert (folder / "ball.png").stat().st_size > 10_000

    def test_dry_run_computes_and_writes_nothing(self, folder, at_step):
        at_step(1, lambda take: pytest.fail("a step was taken"))
        result = call("run", "pogo_stick", "--dry-run", "--set", "solvers=osqp")
        assert result.exit_code == DONE
        for word in ("pogo_stick", "osqp", "10,001", "pogo_stick.nc"):
            assert word in result.stdout
        assert not list(folder.iterdir())

    def test_output_that_exists(self, folder):
        assert call("run", "point_mass", *SHORT).exit_code == DONE
        refused(call("run", "point_mass", *SHORT), "point_mass.nc exists", "--overwrite")
        assert call("run", "point_mass", *SHORT, "--overwrite").exit_code == DONE
        result = call("run", "point_mass", *SHORT, "--resume", "--dry-run")
        assert "nothing to do" in result.stdout
        assert call("run", "point_mass", *SHORT, "--resume").exit_code == DONE

    def test_what_is_refused(self, folder):
        refused(call("run", "pogo_stck"), "neither a file nor a scene", "did you mean 'pogo_stick'")
        refused(call("run", "no.toml"), "no.toml cannot be read")
        refused(call("run", "point_mass", "--set", "scene.masss=2"), "scene.masss", "did you mean 'mass'")
        refused(call("run", "point_mass", "--set", "step_size=nan"), "step_size is nan")
        refused(call("run", "point_mass", "--set", "solvers=clarabell"), "did you mean 'clarabel'")
        refused(call("run", "point_mass", "-o", "no/run.nc"), "no does not exist")
        refused(call("run", "point_mass", "--plot", "run.bmp"), "'.bmp'")
        assert not list(folder.iterdir())

    def test_usage_errors(self):
        assert call("run").exit_code == INPUT_AT_FAULT
        assert call("run", "point_mass", "--nonsense").exit_code == INPUT_AT_FAULT
        assert call("nonsense").exit_code == INPUT_AT_FAULT

    def test_a_failed_run(self, folder, at_step):
        at_step(6, lambda take: StepError("position: [/bold] the solver gave up"))
        result = call("run", "point_mass", *SHORT, "--plot", "ball.png")
        assert result.exit_code == RUN_FAILED
        assert "failed in step 6" in result.stderr
        assert "6 rows are in point_mass.nc" in result.stderr
        assert "[/bold]" in result.stdout
        assert deli.open_run("point_mass.nc")["trajectory"].sizes["time"] == 6
        assert (folder / "ball.png").exists()

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_an_interrupted_run_resumes(self, folder, number):
        arguments = ["run", "newtons_cradle", "--set", "steps=600000", "--set", "record.every=100"]
        process = deli_process(*arguments, cwd=folder)
        try:
            deadline = time.monotonic() + 60
            while not (folder / "newtons_cradle.nc.partial").exists():
                assert process.poll() is None, process.communicate()
                assert time.monotonic() < deadline
                time.sleep(0.02)
            time.sleep(0.5)
            process.send_signal(number)
            _, errors = process.communicate(timeout=60)
        finally:
            process.kill()
        assert process.returncode == RUN_FAILED, errors
        assert f"interrupted by {number.name}" in errors
        assert "resume to continue" in errors
        assert "Traceback" not in errors
        count = deli.open_run(folder / "newtons_cradle.nc.partial")["trajectory"].sizes["time"]
        assert 1 < count < 3001
        assert call(*arguments, "--resume").exit_code == DONE
        assert call(*arguments, "-o", "full.nc").exit_code == DONE
        resumed, full = deli.open_run("newtons_cradle.nc"), deli.open_run("full.nc")
        xr.testing.assert_identical(resumed["trajectory"].to_dataset(), full["trajectory"].to_dataset())


def test_running_out_of_memory_is_one_message(folder, monkeypatch):
    def too_much(*arguments, **keywords):
        raise MemoryError

    monkeypatch.setattr("deli.simulation.run_plan", too_much)
    ended = call("run", "point_mass", *SHORT)
    assert ended.exit_code == RUN_FAILED
    assert ended.stderr == "deli: memory ran out; close other programs, or take fewer bodies, rows or workers.\n"


class TestPlainOutput:
    def test_no_control_characters_without_a_terminal(self, folder):
        process = deli_process("run", "point_mass", "--set", "steps=3000", cwd=folder)
        output, errors = process.communicate(timeout=120)
        assert process.returncode == DONE, errors
        assert all(line.startswith("deli: compiling") for line in errors.splitlines())
        assert "complete" in output
        assert not [character for character in output if ord(character) < 32 and character != "\n"]

    @pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
    def test_a_bar_on_a_terminal(self, folder):
        import pty

        ours, theirs = pty.openpty()
        arguments = ["run", "point_mass", "--set", "steps=3000"]
        command = [sys.executable, "-m", "deli", *arguments]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs, cwd=folder)
        os.close(theirs)
        shown = b""
        try:
            while piece := os.read(ours, 4096):
                shown += piece
        except OSError:  # how Linux says that the other end is closed
            pass
        finally:
            os.close(ours)
        assert process.wait(timeout=60) == DONE
        for words in (b"point_mass", b"steps/s, energy error", b"100%"):
            assert words in shown

    def test_help_imports_nothing_heavy(self):
        code = (
            "import sys; from typer.testing import CliRunner; from deli.cli import app; "
            "result = CliRunner().invoke(app, ['--help']); assert result.exit_code == 0, result.output; "
            "print(*{'xarray', 'netCDF4', 'matplotlib', 'pydantic', 'cvxpy'} & set(sys.modules))"
        )
        output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert output.stdout.strip() == ""

    @pytest.mark.parametrize(
        "command",
        ["run", "study", "report", "plot", "animate", "replay", "figures", "check", "scenes", "methods", "backends"],
    )
    def test_every_command_has_help(self, command):
        result = call(command, "--help")
        assert result.exit_code == DONE
        assert command in call("--help").stdout

    def test_version(self):
        assert call("--version").stdout == f"deli {deli.__version__}\n"
