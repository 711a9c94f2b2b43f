"""SIGKILL at random moments, and at every line of what writes a run: nothing committed is lost, and all is right."""

import itertools
import os
import random
import signal
import time
from pathlib import Path

import psutil
import pytest
from fault_cases import STUDY, command, recorded, require_right_end, require_right_rows
from PIL import Image

import deli

STEPS = 2_000
KILLED, DONE = -signal.SIGKILL, 0
HALFWAY = 1_800  # lines of the writer, of some 3,300
SEED = 20120506


def counts(default, full):
    """The number of kills: a few by default, all of them in a long test."""
    return pytest.mark.parametrize(
        "kills", [pytest.param(default, id="some"), pytest.param(full, id="all", marks=pytest.mark.long)]
    )


def moments(what, seconds):
    """Random moments within so many seconds; what is printed tells how to have a failure again."""
    source = random.Random(f"{SEED} {what}")
    for number in itertools.count():
        moment = source.uniform(0.0, seconds)
        print(f"{what}: kill {number} of seed {SEED} after {moment:.6f} s")
        yield moment


def kill(nest, pid, moment):
    """Kill a command after so many seconds; returns how it ended, which it may have done before."""
    time.sleep(moment)
    os.kill(pid, signal.SIGKILL)
    return nest.end(pid)


@counts(4, 130)
def test_a_run_is_killed_and_continued_again_and_again(nest, folder, whole, kills):
    full, path, partial = whole(STEPS), Path("run.nc"), Path("run.nc.partial")
    began = time.monotonic()
    assert nest.call(*command(STEPS), block_rows=64).status == DONE
    seconds, rows, killed = time.monotonic() - began, 0, 0
    require_right_end(path, full)
    path.unlink()
    times = moments("run", seconds)
    while killed < kills:
        ended = kill(nest, nest.start(*command(STEPS, "--resume"), block_rows=64), next(times))
        if ended.status == KILLED:
            killed += 1
        else:
            assert ended.status == DONE, ended
        if path.exists():
            require_right_end(path, full)
            path.unlink()
            rows = 0
        elif partial.exists():
            found = require_right_rows(partial, full)
            assert found >= rows
            rows = found
    assert nest.call(*command(STEPS, "--resume"), block_rows=64).status == DONE
    require_right_end(path, full)


@pytest.mark.long
@pytest.mark.parametrize("stride", [pytest.param(250, id="some"), pytest.param(1, id="every")])
@pytest.mark.parametrize("part", [0, 1], ids=["begun anew", "continued"])
def test_a_run_is_killed_at_every_line_of_what_writes_it(nest, folder, whole, part, stride):
    """Commits, one of which needs longer chunks, the beginning, the end; and a run that is continued the same."""
    full, partial, content = whole(700), Path("run.nc.partial"), None
    settings, seen = {"block_rows": 200, "most_chunks": 1}, set()
    if part:
        assert nest.call(*command(700), **settings, kill_at=HALFWAY).status == KILLED
        content = partial.read_bytes()
        assert 200 < require_right_rows(partial, full) < 700
    for number in itertools.count(1 + random.Random(SEED).randrange(stride), stride):
        if content is not None:
            partial.write_bytes(content)
        ended, rows = kill_and_continue(nest, full, number, settings)
        seen.add(rows)
        if ended:
            break
    assert number > HALFWAY or part
    assert any(200 < rows < 700 for rows in seen)
    assert len(seen) > 3


def kill_and_continue(nest, full, number, settings):
    """Kill a run at a line; returns whether it ended before, and how many rows it had committed."""
    path, partial, rows = Path("run.nc"), Path("run.nc.partial"), 0
    ended = nest.call(*command(700, "--resume"), **settings, kill_at=number)
    assert ended.status in (KILLED, DONE), ended
    if path.exists():
        rows = require_right_rows(path, full)
        assert rows == 701
    elif partial.exists():
        rows = require_right_rows(partial, full)
    assert nest.call(*command(700, "--resume"), **settings).status == DONE
    require_right_end(path, full)
    path.unlink()
    return ended.status == DONE, rows


@counts(2, 50)
def test_a_film_is_whole_or_not_there_and_the_run_untouched(nest, folder, kills):
    deli.simulate(deli.scenes.newtons_cradle(balls=3), deli.GVI(), step_size=0.01, steps=400, output="run.nc")
    command = ("animate", "run.nc", "--duration", "2", "--dpi", "40", "-q", "--overwrite")
    began = time.monotonic()
    assert nest.call(*command).status == DONE
    seconds, film = time.monotonic() - began, Path("run.gif")
    whole, run, written = film.read_bytes(), Path("run.nc").read_bytes(), Path("run.nc").stat().st_mtime_ns
    film.unlink()
    killed, times = 0, moments("animate", seconds)
    while killed < kills:
        ended = kill(nest, nest.start(*command), next(times))
        killed += ended.status == KILLED
        assert ended.status in (KILLED, DONE), ended
        assert film.exists() or ended.status == KILLED
        if film.exists():
            assert film.read_bytes() == whole
            film.unlink()
        assert Path("run.nc").read_bytes() == run
        assert Path("run.nc").stat().st_mtime_ns == written
    assert nest.call(*command).status == DONE
    with Image.open(film) as image:
        assert image.n_frames == 50
    assert sorted(os.listdir()) == ["run.gif", "run.nc"]


@pytest.mark.long
def test_a_study_is_killed_and_continued_again_and_again(nest, folder):
    """Now and then it is a worker that is killed: its case is continued when that is asked for."""
    kills, source = 20, random.Random(SEED)
    Path("study.toml").write_text(STUDY)
    began = time.monotonic()
    assert nest.call("study", "study.toml", "-o", "whole", "--workers", "1", "-q").status == DONE
    seconds = time.monotonic() - began
    full = recorded("whole")
    killed, times = 0, moments("study", seconds)
    while killed < kills:
        pid = nest.start("study", "study.toml", "-o", "out", "--workers", "1", "-q", "--retry-failed")
        time.sleep(next(times))
        workers = psutil.Process(pid).children()
        of_worker = bool(workers) and source.random() < 0.3
        (workers[0] if of_worker else psutil.Process(pid)).kill()
        ended = nest.end(pid)
        killed += of_worker or ended.status == KILLED
        _, alive = psutil.wait_procs(workers, timeout=60)
        assert not alive
        require_right_cases(full)
        if ended.status == DONE:
            require_same_study(full)
    assert nest.call("study", "study.toml", "-o", "out", "--workers", "1", "-q", "--retry-failed").status == DONE
    require_same_study(full)


def require_right_cases(full):
    """Every file of a study opens, and holds the rows that it should."""
    for path in Path("out").glob("cases/*.nc*"):
        if path.name.endswith((".nc", ".nc.partial")):
            run, (trajectory, _) = deli.open_run(path), full[path.name.removesuffix(".partial")]
            rows = run["trajectory"].sizes["time"]
            assert run["trajectory"].to_dataset().identical(trajectory.isel(time=slice(rows)))
            assert rows == trajectory.sizes["time"] or path.suffix == ".partial"


def require_same_study(full):
    """A finished study is that of the undisturbed one; it is removed."""
    found = recorded("out")
    assert list(found) == list(full)
    for name, parts in full.items():
        for mine, theirs in zip(found[name], parts, strict=True):
            assert mine.identical(theirs), name
    assert (deli.open_study("out").state == "done").all()
    os.rename("out", f"done-{time.monotonic_ns()}")
