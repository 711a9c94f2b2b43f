"""A commit can be cut off between any two writes of the HDF5 library: rows committed before are right, and it goes on.

The library writes what it has cached in an order of its own, which these tests replay: at each of its writes the file
is what a process that is killed there would leave.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from fault_cases import require_right_end, require_right_rows, undisturbed
from fault_writes import CALLS, states

import deli
from deli.recording import chunks, contents, netcdf
from deli.recording.netcdf import Writer
from deli.recording.reading import read_unfinished
from deli.recording.schema import STATS, TRAJECTORY, Schema
from deli.subproblems.stats import STATUS_MEANINGS

SUPERBLOCK = 48
SCHEMA = Schema(2, 2)
ATTRIBUTES = deli.simulate(deli.scenes.wedge(), deli.GVI(), step_size=0.01, steps=1).attrs


def block(group, begin, end):
    """Rows that tell which they are."""
    found = {}
    for variable in SCHEMA.groups[group]:
        if variable.grows:
            shape = (end - begin, *(SCHEMA.sizes[dimension] for dimension in variable.dims[1:]))
            rows = np.arange(begin, end).reshape(-1, *[1] * (len(shape) - 1))
            rows = rows % len(STATUS_MEANINGS) if variable.name == "status" else rows
            found[variable.name] = np.broadcast_to(rows, shape).astype(variable.dtype)
    return found


def write(writer, begin, end):
    writer.write(begin, block(TRAJECTORY, begin, end), block(STATS, max(begin - 1, 0), end - 1))


def require_rows(path, rows):
    """Every row says which it is."""
    run = deli.open_run(path)
    for group, count in ((TRAJECTORY, rows), (STATS, rows - 1)):
        expected = block(group, 0, count)
        for name, values in expected.items():
            np.testing.assert_array_equal(run[group][name].values, values)


@pytest.fixture
def writer(tmp_path):
    found = Writer(tmp_path / "run.nc.partial", SCHEMA, ATTRIBUTES)
    yield found
    found.abandon()


def test_a_file_appears_with_its_first_rows(writer):
    assert not writer.path.exists()
    write(writer, 0, 1)
    require_rows(writer.path, 1)
    assert os.listdir(writer.path.parent) == [writer.path.name]


def test_no_tree_of_chunks_is_ever_split(writer):
    for begin in range(0, 40_000, 8_000):
        write(writer, begin, begin + 8_000)
        require_rows(writer.path, begin + 8_000)
        with netCDF4.Dataset(writer.path.name, memory=writer.path.read_bytes()) as dataset:
            for group in (TRAJECTORY, STATS):
                for variable in dataset[group].variables.values():
                    if variable.chunking() != "contiguous":
                        assert len(variable) <= chunks.MOST_CHUNKS * variable.chunking()[0]


def test_a_commit_that_lacks_the_library_s_last_write_is_continued(writer, tmp_path):
    """The last write says how long the file is; without it there seems to be nothing where the new rows are."""
    write(writer, 0, 100)
    before = writer.path.read_bytes()
    write(writer, 100, 600)
    torn = tmp_path / "torn.nc.partial"
    torn.write_bytes(before[:SUPERBLOCK] + writer.path.read_bytes()[SUPERBLOCK:])
    with netCDF4.Dataset(torn, "a") as dataset:
        dataset[contents.COMMITTED][...] = 100
    require_rows(torn, 100)
    again = Writer(torn, SCHEMA, ATTRIBUTES, read_unfinished(torn))
    write(again, 100, 1200)
    require_rows(again.close({"outcome": "complete"}, tmp_path / "torn.nc"), 1200)


def test_closing_changes_nothing_in_the_file_that_is_closed(writer, monkeypatch):
    write(writer, 0, 300)
    before, seen = writer.path.read_bytes(), []

    def replace(source, target):
        seen.append(writer.path.read_bytes())
        os.rename(source, target)

    monkeypatch.setattr(netcdf.os, "replace", replace)
    final = writer.close({"outcome": "complete", "end": "now", "backend_versions": "many"}, writer.path.with_suffix(""))
    assert seen[0] == before
    assert deli.open_run(final).attrs["outcome"] == "complete"
    require_rows(final, 300)


PROGRAM = """
import sys, deli
from deli.recording import chunks
from deli.running import session
session.BLOCK_ROWS, session.FLUSH_SECONDS, session.REFRESH_SECONDS, chunks.MOST_CHUNKS = 200, 0.0, 0.0, 1
deli.simulate(deli.scenes.newtons_cradle(balls=3), deli.GVI(), step_size=0.01, steps=700, output=sys.argv[1])
"""


@pytest.mark.long
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace, which tells of each write, is not installed")
def test_a_run_is_cut_off_at_every_write(folder):
    log = folder / "writes.log"
    strace = ["strace", "-f", "-s", "10000000", "-xx", "-o", log, "-e", f"trace={CALLS}"]
    subprocess.run([*strace, sys.executable, "-c", PROGRAM, folder / "run.nc"], check=True)
    require_right_end("run.nc", full := undisturbed(700))
    count = 0
    for content in states(log, folder / "run.nc.partial"):
        count += 1
        partial = Path("cut.nc.partial")
        partial.write_bytes(content)
        require_right_rows(partial, full)
        scene, method = deli.scenes.newtons_cradle(balls=3), deli.GVI()
        deli.simulate(scene, method, step_size=0.01, steps=700, output="cut.nc", resume=True)
        require_right_end("cut.nc", full)
        Path("cut.nc").unlink()
    print(f"{count} states")
    assert count > 100
