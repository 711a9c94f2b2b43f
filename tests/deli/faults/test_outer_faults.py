"""Disks, folders, signals, other processes, clocks, old files: a run says what happened, and goes on later."""

import contextlib
import datetime
import os
import random
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import netCDF4
import pytest
from fault_cases import STUDY, command, recorded, require_right_end, require_right_rows, require_said
from running import DONE, INPUT_AT_FAULT, RUN_FAILED, assert_same, call, refused

import deli
from deli.recording import netcdf, provenance

SEED = 20120506
STEPS = 2_000


def run_of(steps, **settings):
    scene, method = deli.scenes.newtons_cradle(balls=3), deli.GVI()
    return deli.simulate(scene, method, step_size=0.01, steps=steps, output="run.nc", **settings)


def wait_for(what):
    deadline = time.monotonic() + 120
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.002)


@pytest.fixture
def disk(tmp_path):
    """A small disk, and a way to mount it anew; the current folder is on it."""
    place = tmp_path / "disk"
    place.mkdir()

    def mount(options):
        return subprocess.run(["mount", "-t", "tmpfs", "-o", options, "deli-test", place], capture_output=True)

    if shutil.which("mount") is None or mount("size=1m").returncode != 0:
        pytest.skip("mounting a disk of its own takes root")
    before = os.getcwd()
    os.chdir(place)
    yield lambda options: subprocess.run(["mount", "-o", f"remount,{options}", place], check=True)
    os.chdir(before)
    subprocess.run(["umount", place], check=True)


class TestDiskFull:
    @pytest.mark.parametrize("count", [pytest.param(4, id="some"), pytest.param(60, id="many", marks=pytest.mark.long)])
    def test_a_file_that_may_not_grow(self, nest, folder, whole, count):
        """Wherever it happens, rows committed before are right, and the run goes on from them."""
        full, source, path, partial = whole(STEPS), random.Random(SEED), Path("run.nc"), Path("run.nc.partial")
        for _ in range(count):
            size = source.randrange(20_000, 1_200_000)
            print(f"seed {SEED}: at most {size} bytes")
            ended = nest.call(*command(STEPS, "--resume"), file_size=size, block_rows=100)
            if ended.status == DONE:
                require_right_end(path, full)
                path.unlink()
                continue
            require_said(ended, RUN_FAILED, "run.nc.partial", "Is the disk full", "safe")
            assert not path.exists()
            if partial.exists():
                require_right_rows(partial, full)
        assert nest.call(*command(STEPS, "--resume")).status == DONE
        require_right_end(path, full)

    def test_a_disk_that_is_full(self, nest, disk, whole):
        full, path, partial = whole(STEPS), Path("run.nc"), Path("run.nc.partial")
        ended = nest.call(*command(STEPS), block_rows=100)
        require_said(ended, RUN_FAILED, "No space left", "safe")
        assert 1 <= require_right_rows(partial, full) < STEPS
        assert os.listdir() == ["run.nc.partial"]
        require_said(nest.call(*command(STEPS, "--resume"), block_rows=100), INPUT_AT_FAULT, "MB are free")
        require_right_rows(partial, full)
        disk("size=16m")
        assert nest.call(*command(STEPS, "--resume"), block_rows=100).status == DONE
        require_right_end(path, full)
        with pytest.raises(OSError, match="No space"):
            Path("filling").write_bytes(bytes(16_000_000))
        require_said(nest.call("animate", "run.nc", "--dpi", "60", "-q"), RUN_FAILED, "run.gif could not be written")
        assert sorted(os.listdir()) == ["filling", "run.nc"]
        Path("run.png").write_bytes(b"")
        require_said(
            nest.call("plot", "run.nc", "-o", "run.png", "--overwrite"),
            RUN_FAILED,
            "run.png could not be written",
            "No space",
        )
        assert sorted(os.listdir()) == ["filling", "run.nc", "run.png"]
        assert Path("run.png").stat().st_size == 0

    @pytest.mark.long
    def test_a_study_whose_disk_is_full(self, nest, disk):
        disk("size=3m")  # room for the rows of both runs, and not for their ends
        Path("study.toml").write_text(STUDY)
        ended = nest.call("study", "study.toml", "-o", "out", "-q")
        assert ended.status == RUN_FAILED, ended
        assert "Traceback" not in ended.err
        assert "Is the disk full" in ended.err
        disk("size=20m")
        assert nest.call("study", "study.toml", "-o", "out", "-q").status == DONE
        assert (deli.open_study("out").state == "done").all()
        assert nest.call("study", "study.toml", "-o", "other", "-q").status == DONE
        for found, other in zip(recorded("out").values(), recorded("other").values(), strict=True):
            assert all(one.identical(two) for one, two in zip(found, other, strict=True))


class TestFolders:
    def test_read_only(self, nest, disk):
        Path("study.toml").write_text(STUDY)
        os.mkdir("out")
        run_of(5)
        disk("ro")
        require_said(nest.call(*command(5, "--overwrite")), INPUT_AT_FAULT, "no permission to write")
        require_said(nest.call("study", "study.toml", "-o", "out", "-q"), INPUT_AT_FAULT, "out cannot be")
        require_said(nest.call("animate", "run.nc", "-q"), INPUT_AT_FAULT, "not writable")
        disk("rw")
        assert nest.call(*command(5, "--resume")).status == DONE

    def test_read_only_while_it_runs(self, nest, disk, whole):
        """What is open for writing keeps a disk from being made read-only; what is opened next fails."""
        full = whole(STEPS)
        require_said(nest.call(*command(STEPS), block_rows=100), RUN_FAILED, "safe")
        disk("ro,size=16m")
        require_said(nest.call(*command(STEPS, "--resume")), INPUT_AT_FAULT, "no permission to write")
        disk("rw")
        assert nest.call(*command(STEPS, "--resume")).status == DONE
        require_right_end("run.nc", full)

    @pytest.mark.parametrize("how", ["removed", "moved"])
    def test_vanishing_while_it_runs(self, nest, folder, whole, how):
        full, place = whole(STEPS), Path("place")
        place.mkdir()
        arguments = [*command(10**7, "--resume"), "-o", "place/run.nc"]
        pid = nest.start(*arguments, block_rows=100)
        wait_for(Path("place/run.nc.partial").exists)
        if how == "removed":
            while place.exists():
                shutil.rmtree(place, ignore_errors=True)
        else:
            place.rename("moved")
        require_said(nest.end(pid), RUN_FAILED, "place/run.nc.partial", "No such file", "the folder gone?")
        if how == "moved":
            with contextlib.suppress(AssertionError):
                assert require_right_rows("moved/run.nc.partial", full) >= 1
            assert deli.open_run("moved/run.nc.partial")["trajectory"].sizes["time"] >= 1


class TestTwoProcesses:
    @pytest.mark.parametrize("count", [pytest.param(3, id="some"), pytest.param(40, id="many", marks=pytest.mark.long)])
    @pytest.mark.parametrize("option", ["--quiet", "--resume", "--overwrite"])
    def test_two_runs_of_one_output(self, nest, folder, whole, count, option):
        """One of them says that it cannot, or both have come one after the other; the file is right."""
        full, source = whole(STEPS), random.Random(f"{SEED} {option}")
        for _ in range(count):
            wait = source.uniform(0.0, 0.2)
            print(f"seed {SEED}: the second after {wait:.6f} s")
            one = nest.start(*command(STEPS, option), block_rows=100)
            time.sleep(wait)
            ends = [nest.end(pid) for pid in (nest.start(*command(STEPS, option), block_rows=100), one)]
            assert DONE in [end.status for end in ends], ends
            for end in ends:
                if end.status != DONE:
                    require_said(end, end.status, "run.nc")
                    assert end.status in (RUN_FAILED, INPUT_AT_FAULT)
                    assert re.search("another run|exists|unfinished run|if a run is writing it", end.err), end
            require_right_end("run.nc", full)
            Path("run.nc").unlink()

    def test_a_run_that_is_written_is_neither_resumed_nor_replaced(self, nest, folder):
        pid = nest.start(*command(10**7), block_rows=100)
        partial = Path("run.nc.partial")
        wait_for(partial.exists)
        for option in ("--resume", "--overwrite"):
            require_said(nest.call(*command(10**7, option)), INPUT_AT_FAULT, "is another run writing it?")
        os.kill(pid, signal.SIGTERM)
        require_said(nest.end(pid), RUN_FAILED, "interrupted by SIGTERM", "resume to continue")
        assert deli.open_run(partial)["trajectory"].sizes["time"] > 1


class TestSignals:
    @pytest.mark.parametrize("count", [pytest.param(3, id="some"), pytest.param(40, id="many", marks=pytest.mark.long)])
    def test_at_any_moment_and_twice(self, nest, folder, whole, count):
        full, source, path, partial = whole(STEPS), random.Random(SEED), Path("run.nc"), Path("run.nc.partial")
        for _ in range(count):
            first, second = (source.choice((signal.SIGINT, signal.SIGTERM)) for _ in range(2))
            wait, after = source.uniform(0.0, 0.3), source.choice((None, 0.0, 0.01))
            print(f"seed {SEED}: {first.name} after {wait:.6f} s, {second.name} {after} s later")
            pid = nest.start(*command(STEPS, "--resume"), block_rows=100)
            wait_for(lambda: partial.exists() or path.exists())
            time.sleep(wait)
            os.kill(pid, first)
            if after is not None:
                time.sleep(after)
                os.kill(pid, second)
            ended = nest.end(pid)
            if path.exists():
                require_right_end(path, full)
                path.unlink()
            else:
                assert ended.status in (RUN_FAILED, -signal.SIGTERM), ended
                require_right_rows(partial, full)
            if ended.status == RUN_FAILED:
                require_said(ended, RUN_FAILED)
                assert re.search("interrupted (by SIG(INT|TERM) )?after step|stopped by SIGINT", ended.err), ended
        assert nest.call(*command(STEPS, "--resume")).status == DONE
        require_right_end(path, full)

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    @pytest.mark.parametrize("where", ["sync", "end"])
    def test_during_a_write(self, folder, monkeypatch, number, where):
        """However often they come, they wait until what is written is whole."""
        asked = []

        def ask():
            if len(asked) < 3:
                asked.append(None)
                os.kill(os.getpid(), number)

        append, copy = netcdf.Writer._append, shutil.copyfile

        def append_asked(self, *arguments):
            append(self, *arguments)
            if self.rows:
                ask()

        def copy_asked(*arguments):
            ask()
            ask()
            ask()
            return copy(*arguments)

        whole = deli.simulate(deli.scenes.newtons_cradle(balls=3), deli.GVI(), step_size=0.01, steps=50)
        if where == "sync":
            monkeypatch.setattr(netcdf.Writer, "_append", append_asked)
        else:
            monkeypatch.setattr(netcdf.shutil, "copyfile", copy_asked)
        run_of(50)
        assert len(asked) >= 2
        require_right_end("run.nc", whole)

    @pytest.mark.long
    @pytest.mark.parametrize("first", [signal.SIGINT, signal.SIGTERM])
    def test_twice_at_a_study(self, nest, folder, first):
        """Its workers end their steps and write their rows all the same."""
        Path("study.toml").write_text(STUDY.replace("20_000", "100_000"))
        command = ("study", "study.toml", "-o", "out", "--workers", "1", "-q")
        pid = nest.start(*command)
        wait_for(lambda: list(Path().glob("out/cases/*.partial")))
        for number in (first, signal.SIGINT, signal.SIGTERM):
            os.kill(pid, number)
            time.sleep(0.1)
        require_said(nest.end(pid), RUN_FAILED, f"interrupted by {first.name}", "The same command continues")
        assert (deli.open_study("out").state != "done").any()
        assert nest.call(*command).status == DONE
        assert (deli.open_study("out").state == "done").all()


class TestClocks:
    def test_a_clock_that_jumps_is_not_asked(self, folder, monkeypatch):
        """Only dates are taken from it: not when to write, nor how long something took."""
        source, whole = random.Random(SEED), run_of(600)
        os.rename("run.nc", "whole.nc")

        class Jumping(datetime.datetime):
            @classmethod
            def now(cls, tz=None):
                return datetime.datetime(source.randrange(1971, 2200), 1, 1, tzinfo=tz)

        monkeypatch.setattr(provenance, "datetime", Jumping)
        monkeypatch.setattr(time, "time", lambda: source.uniform(0.0, 1e10))
        monkeypatch.setattr(time, "time_ns", lambda: source.randrange(10**19))
        began = time.perf_counter()
        run = run_of(600)
        assert 0.0 < run.attrs["wall_time"] <= time.perf_counter() - began
        assert_same(run, whole)

    def test_nothing_of_deli_asks_it_for_anything_but_dates(self):
        root, asking = (
            Path(deli.__file__).parent,
            re.compile(r"time\.time\b|time_ns\(|datetime\.now|import time\b.*\bas"),
        )
        found = [
            f"{path.name}: {line.strip()}"
            for package in (root, root.parent / "solvers")
            for path in package.rglob("*.py")
            for line in path.read_text().splitlines()
            if asking.search(line)
        ]
        assert found == ['provenance.py: return datetime.now(UTC).isoformat(timespec="milliseconds")']


class TestOlderSchema:
    @pytest.fixture
    def older(self, folder):
        run_of(5)
        path = Path("run.nc")
        with netCDF4.Dataset(path, "a") as dataset:
            dataset.setncattr("Conventions", "deli-1")
        return path

    @pytest.mark.parametrize(
        "words", [("plot", "run.nc"), ("animate", "run.nc"), ("check", "run.nc"), command(5, "--resume")]
    )
    def test_a_finished_file_is_refused_and_kept(self, older, words):
        before = older.read_bytes()
        refused(call(*words), "follows the conventions 'deli-1'; this version of deli reads 'deli-2'")
        assert older.read_bytes() == before

    def test_an_unfinished_file_is_refused_and_kept(self, older):
        partial = older.rename("run.nc.partial")
        before = partial.read_bytes()
        refused(call(*command(5, "--resume")), "follows the conventions 'deli-1'")
        assert partial.read_bytes() == before
        assert call(*command(5, "--overwrite")).exit_code == DONE
