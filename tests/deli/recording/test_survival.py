"""Files of runs that are killed, watched, damaged."""

import signal
import subprocess
import sys
import time

import netCDF4
import numpy as np
import pytest
import xarray as xr

import deli
from deli.errors import InputError
from deli.recording import contents, holding, netcdf
from deli.recording.recorder import BLOCK_ROWS, Memory, Recorder
from deli.recording.schema import Schema

STEPS = 30_000
PROGRAM = f"""
import sys, deli
deli.simulate(deli.scenes.newtons_cradle(), deli.GVI(), step_size=0.01, steps={STEPS}, output=sys.argv[1])
"""
CLOCKS = ["solve_time", "overhead_time"]


def rows(run, count=None):
    trajectory = run["trajectory"].to_dataset().isel(time=slice(count))
    stats = run["solver_stats"].to_dataset().drop_vars(CLOCKS)
    return trajectory, stats.isel(step=slice(None if count is None else count - 1))


def wait_for_rows(path, more_than):
    """Wait until a run that another process is writing has that many committed rows."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if path.exists():
            try:
                count = deli.open_run(path)["trajectory"].sizes["time"]
            except InputError:  # read in the middle of a write, or just renamed
                count = 0
            if count > more_than:
                return
        time.sleep(0.05)
    raise AssertionError(f"{path} has no more than {more_than} rows after a minute")


def test_a_killed_run_keeps_its_rows_and_resumes_to_the_bit(tmp_path):
    path = tmp_path / "run.nc"
    partial = tmp_path / "run.nc.partial"
    process = subprocess.Popen([sys.executable, "-c", PROGRAM, str(path)])
    try:
        wait_for_rows(partial, BLOCK_ROWS)
    finally:
        process.kill()
    assert process.wait() == -signal.SIGKILL
    assert not path.exists()

    scene, method = deli.scenes.newtons_cradle(), deli.GVI()
    full = deli.simulate(scene, method, step_size=0.01, steps=STEPS)
    killed = deli.open_run(partial)
    count = killed["trajectory"].sizes["time"]
    assert BLOCK_ROWS < count < STEPS
    assert killed.attrs["outcome"] == "unfinished"
    for one, other in zip(rows(killed), rows(full, count), strict=True):
        xr.testing.assert_identical(one, other)

    resumed = deli.simulate(scene, method, step_size=0.01, steps=STEPS, output=path, resume=True)
    for one, other in zip(rows(resumed), rows(full), strict=True):
        xr.testing.assert_identical(one, other)
    assert not partial.exists()


@pytest.mark.parametrize("stride", [1, 100, BLOCK_ROWS, 1000])
def test_rows_do_not_depend_on_when_they_are_flushed(stride):
    scene = deli.scenes.newtons_cradle()
    collected = []
    for flush_every in (600, stride):
        memory = Memory()
        recorder = Recorder(scene, 0.01, memory)
        stepper = deli.GVI().stepper(scene, 0.01)
        stepper.place(scene.position, scene.momentum)
        stepper.record(recorder.block)
        while recorder.rows < 600:
            if recorder.buffered == flush_every:
                recorder.flush()
            assert stepper.advance(recorder.block, 599, 1, 0.0) is None
        recorder.flush()
        collected.append(memory.collect(Schema(scene.dof, scene.dimension)))
    for group, variables in collected[0].items():
        for name, (_, values, _) in variables.items():
            if name not in CLOCKS:
                np.testing.assert_array_equal(values, collected[1][group][name][1], err_msg=name)
    assert len(collected[0]["trajectory"]["time"][1]) == 600


def test_only_committed_rows_are_read(tmp_path):
    path = tmp_path / "run.nc"
    run = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=20, output=path)
    with netCDF4.Dataset(path, "a") as dataset:
        dataset[contents.COMMITTED][...] = 11
    torn = deli.open_run(path)
    xr.testing.assert_identical(torn["trajectory"].to_dataset(), run["trajectory"].to_dataset().isel(time=slice(11)))
    assert torn["solver_stats"].sizes["step"] == 10


def test_a_run_can_be_watched_from_its_own_process(tmp_path, at_step):
    path = tmp_path / "run.nc"
    seen = []

    def watch(take):
        seen.append(deli.open_run(f"{path}.partial")["trajectory"].sizes["time"])
        return take()

    at_step(1, watch)
    deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=3, output=path)
    assert seen == [1, 1, 1]


def test_a_truncated_file_is_refused(tmp_path):
    path = tmp_path / "run.nc"
    deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=500, output=path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"run\.nc"):
        deli.open_run(path)


def test_a_file_of_other_conventions_is_refused(tmp_path):
    path = tmp_path / "run.nc"
    deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=5, output=path)
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.setncattr("Conventions", "deli-1")
    with pytest.raises(InputError, match="conventions 'deli-1'"):
        deli.open_run(path)


def test_rows_that_cannot_be_written_are_an_error(tmp_path, monkeypatch):
    path = tmp_path / "run.nc"

    def full(self, group, first, block):
        if first > 0:
            raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr(netcdf.Writer, "_append", full)
    with pytest.raises(holding.RecordingError, match="Is the disk full"):
        deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=5, output=path)
    assert not path.exists()


def test_a_file_may_be_open_several_times(tmp_path):
    """Closing one of several handles must leave the file readable by those that are left and those to come."""
    path = tmp_path / "run.nc"
    run = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=5, output=path)
    code = (
        "import sys, netCDF4, deli\n"
        "handles = [netCDF4.Dataset(sys.argv[1]) for _ in range(3)]\n"
        "for _ in range(100):\n"
        "    handles.append(netCDF4.Dataset(sys.argv[1]))\n"
        "    handles.pop(0).close()\n"
        "    run = deli.open_run(sys.argv[1])\n"
        "print(*run['solver_stats']['subproblem'].values)\n"
    )
    # A process of its own: what is wrong here ends in the library's crash.
    found = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    assert found.stdout.split() == list(run["solver_stats"]["subproblem"].values)
    with netCDF4.Dataset(path) as dataset:
        variables = [variable for group in dataset.groups.values() for variable in group.variables.values()]
        assert not [variable.name for variable in variables if variable.dtype is str]


def test_a_file_of_many_bodies_takes_little_more_than_its_rows(tmp_path):
    scene = deli.Scene(mass=1.0, position=np.zeros(20_000), momentum=np.ones(20_000))
    deli.simulate(scene, deli.GVI(), step_size=0.001, steps=4, output=tmp_path / "run.nc")
    rows = 5 * 2 * scene.dof * 8
    assert rows < (tmp_path / "run.nc").stat().st_size < 2 * rows
