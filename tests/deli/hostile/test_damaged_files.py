"""Runs whose files are damaged: refused with one message, or what was recorded; never a crash, never other numbers."""

import os
import random
import shutil
from collections import Counter

import netCDF4
import numpy as np
import pytest
import xarray as xr
from file_damage import damaged, use
from file_victim import STEPS, look, numbers, same, simulate
from running import call, refused

import deli
from deli.errors import InputError
from deli.recording import apart, netcdf, seal
from deli.recording.superblock import stated_length

READERS = ("look", "check", "plot", "animate", "replay")


def unseal(path):
    os.truncate(path, path.stat().st_size - seal.LENGTH)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A finished file; the same without its seal, as another program leaves it; and what a killed run leaves."""
    folder = tmp_path_factory.mktemp("whole")
    simulate(folder / "sealed.nc")
    shutil.copyfile(folder / "sealed.nc", folder / "unsealed.nc")
    unseal(folder / "unsealed.nc")
    deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=3, output=folder / "small.nc")
    writing = netcdf.Writer.close
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(netcdf.Writer, "close", lambda self, attributes, rename: writing(self, {}, None))
        simulate(folder / "killed.nc")
    unseal(folder / "killed.nc.partial")
    return folder


FUZZED = {
    "sealed.nc": ((30, 2000), READERS, ("refused",)),
    "unsealed.nc": ((6, 300), READERS, ("refused", "same", "other")),
    "killed.nc.partial": ((6, 300), ("resume", "look", "check"), ("refused", "same")),
}
"""Of each file: how often it is damaged, in short and in full, what is done with it, and what may come of that."""


@pytest.mark.parametrize("full", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_damaged_file_is_refused_or_is_what_it_was(files, tmp_path, full):
    """Where another program has been at a file and numbers differ, `deli check` must find it."""
    rng = random.Random(1)
    orders, laws = [], []
    for name, (counts, whats, _) in FUZZED.items():
        content = (files / name).read_bytes()
        for number in range(counts[full]):
            path, what = tmp_path / f"{number}-{name}", whats[number % len(whats)]
            data, damage = damaged(content, rng)
            path.write_bytes(data)
            orders.append([what, str(path), str(files / "sealed.nc")])
            taken = name == "sealed.nc" and seal.intact(path) is None  # what was damaged is the seal
            may = set(FUZZED["unsealed.nc" if taken else name][2]) - ({"other"} if what == "check" else set())
            laws.append((may | {"same"} if data == content else may, damage))
    answers = use(orders, tmp_path)
    for order, (may, damage), (found, why) in zip(orders, laws, answers, strict=True):
        assert found in may, (order, damage, why)
    assert {found for found, _ in answers} >= {"refused", "same"}
    print(Counter((order[0], found) for order, (found, _) in zip(orders, answers, strict=True)))


@pytest.mark.parametrize(
    ("name", "stride"),
    [("sealed.nc", 211), ("killed.nc.partial", 211), pytest.param("small.nc", 1, marks=pytest.mark.long)],
)
def test_a_file_cut_off_at_any_byte_is_refused(files, tmp_path, name, stride):
    path = tmp_path / name
    shutil.copyfile(files / name, path)
    for length in range(stated_length(path) - 1, 63, -stride):
        os.truncate(path, length)
        with pytest.raises(InputError, match="was cut off"):
            deli.open_run(path)
    for length in range(63, -1, -(21 if stride > 1 else 1)):
        os.truncate(path, length)
        with pytest.raises(InputError, match="cannot be read"):
            deli.open_run(path)


def test_a_cut_seal_leaves_a_run_that_can_be_read(files, tmp_path):
    content = (files / "sealed.nc").read_bytes()
    for missing in (1, seal.LENGTH - 1):
        (tmp_path / "cut.nc").write_bytes(content[:-missing])
        assert look(tmp_path / "cut.nc", files / "sealed.nc") == "same"


def test_resuming_a_file_that_was_cut_off_is_refused_and_keeps_it(files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = (files / "killed.nc.partial").read_bytes()
    (tmp_path / "cut.nc.partial").write_bytes(content[:100_000])
    with pytest.raises(InputError, match=r"cut\.nc\.partial is damaged: it was cut off.*--overwrite starts anew"):
        simulate("cut.nc", resume=True)
    assert (tmp_path / "cut.nc.partial").read_bytes() == content[:100_000]
    assert same(simulate("cut.nc", overwrite=True), deli.open_run(files / "sealed.nc"))


def test_numbers_that_change_silently_are_found_by_checksums(files, tmp_path):
    content = (files / "killed.nc.partial").read_bytes()
    position = deli.open_run(files / "sealed.nc")["trajectory"]["position"].values[7]
    assert content.count(position.tobytes()) == 1
    flipped = bytearray(content)
    flipped[content.index(position.tobytes())] ^= 1
    (tmp_path / "flipped.nc.partial").write_bytes(flipped)
    with pytest.raises(InputError, match="checksums of trajectory/position differ"):
        deli.open_run(tmp_path / "flipped.nc.partial")
    (tmp_path / "flipped.nc").write_bytes(flipped)  # as another program may have changed it on purpose
    assert same(deli.open_run(tmp_path / "flipped.nc"), deli.open_run(files / "sealed.nc")) is False
    result = call("check", tmp_path / "flipped.nc")
    refused(result, "fails these checks", "content")
    assert "checksums differ: trajectory/position" in result.stdout


def rename(group, old, new="another"):
    return lambda data: data[group].renameVariable(old, new)


def put(name, value):
    def change(data):
        data[name][...] = value

    return change


def say(name, value):
    return lambda data: data.setncattr(name, value)


def retype(group, name, dtype, dims=None):
    def change(data):
        dimensions = data[group][name].dimensions
        data[group].renameVariable(name, "before")
        data[group].createVariable(name, dtype, dimensions if dims is None else dims)

    return change


CRAFTED = {
    "negative count": (put("committed_rows", -5), "committed_rows is -5"),
    "huge count": (put("committed_rows", 2**62), "committed_rows is 4611686018427387904"),
    "one row too many": (put("committed_rows", STEPS + 2), "committed_rows is 42, but there are 41 along time"),
    "negative problems": (put("committed_subproblems", -1), "committed_subproblems is -1"),
    "huge problems": (put("committed_subproblems", 2**62), "committed_subproblems is 4611686018427387904"),
    "other conventions": (say("Conventions", "deli-1"), "conventions 'deli-1'"),
    "no title": (lambda data: data.delncattr("title"), "attribute title is None"),
    "a number for an outcome": (say("outcome", 3), "attribute outcome is 3"),
    "a number for a citation": (say("citation", 3), "attribute citation is 3"),
    "other axes": (say("conserved_linear_momentum", "q"), "conserved_linear_momentum is 'q'"),
    "other components": (say("undecided_momenta", "q_x"), "undecided_momenta is 'q_x'"),
    "no positions": (rename("trajectory", "position"), "trajectory/position is missing"),
    "no steps": (rename("solver_stats", "step"), "solver_stats/step is missing"),
    "no status": (rename("solver_stats", "status"), "solver_stats/status is missing"),
    "no bounds": (rename("subproblems", "bounds"), "subproblems/bounds is missing"),
    "no group": (lambda data: data.renameGroup("solver_stats", "another"), "not a run recorded by deli"),
    "numbers as text": (retype("trajectory", "gap_min", str), "trajectory/gap_min is missing, or of a type"),
    "floats": (retype("trajectory", "momentum", "f4"), "trajectory/momentum is of the type float32, not float64"),
    "other shape": (retype("trajectory", "momentum", "f8", ("dof", "time")), "has the dimensions dof, time"),
    "scalar": (retype("trajectory", "momentum", "f8", ()), "has the dimensions -, not time, dof"),
    "nan for a time": (lambda data: put("time", np.nan)(data["trajectory"]), "trajectory/time is nan in row 0"),
    "time stands still": (lambda data: put("time", 1.0)(data["trajectory"]), "trajectory/time is 1.0 in row 1"),
    "steps are jumbled": (lambda data: put("step", 1)(data["solver_stats"]), "does not count from 0"),
    "unknown status": (lambda data: put("status", 9)(data["solver_stats"]), "status is 9 to 9"),
    "dofs are jumbled": (lambda data: put("dof", 0)(data["trajectory"]), "trajectory/dof is [0, 0"),
    "letters that are none": (lambda data: put("direction", b"\xff")(data["trajectory"]), "not letters"),
    "other words": (lambda data: put("subproblem", b"x")(data["solver_stats"]), "solver_stats/subproblem is ['xxx"),
    "columns out of range": (lambda data: put("column", 10**6)(data["subproblems"]), "column names variables"),
    "negative columns": (lambda data: put("column", -7)(data["subproblems"]), "column names variables"),
    "negative sizes": (lambda data: put("rows", -1)(data["subproblems"]), "subproblems/rows counts -1"),
    "huge sizes": (lambda data: put("variables", 2**62)(data["subproblems"]), "subproblems/variables counts"),
    "too many equations": (lambda data: put("equalities", 99)(data["subproblems"]), "equalities has more"),
    "unknown kinds": (lambda data: put("subproblem", 7)(data["subproblems"]), "subproblem names others"),
    "rows that do not add up": (lambda data: put("row_entries", 0)(data["subproblems"]), "row_entries does not add up"),
    "negative left out": (lambda data: put("left_out", -1)(data["subproblems"]), "left_out is -1"),
}


@pytest.mark.parametrize("name", CRAFTED)
def test_a_file_that_netcdf_finds_in_order_and_no_run_has_written(files, tmp_path, name):
    """Also where it has been sealed: a seal says that bytes are the same, not that they make sense."""
    change, words = CRAFTED[name]
    path = tmp_path / "crafted.nc"
    shutil.copyfile(files / "sealed.nc", path)
    with netCDF4.Dataset(path, "a") as data:
        data.set_auto_maskandscale(False)
        data.set_auto_chartostring(False)
        change(data)
    seal.seal(path)
    with pytest.raises(InputError) as error:
        deli.open_run(path)
    assert words in str(error.value)
    assert str(path) in str(error.value)
    refused(call("check", path), words)
    refused(call("plot", path, "-o", tmp_path / "p.png"), words)


CONFIGS = {
    "no TOML": "what = = 3",
    "no scene": "step_size = 0.1\n",
    "no step size": '[scene]\nname = "newtons_cradle"\n[method]\nname = "gvi"\n[solvers]\n',
    "nested": "a = " + "[" * 100_000,
    "dotted": ".".join(["a"] * 100_000) + " = 1",
    "huge": "x" * 20_000_000,
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long) if name == "dotted" else name for name in CONFIGS]
)
def test_a_config_that_is_none_is_refused_within_limits(files, tmp_path, name):
    path = tmp_path / "config.nc"
    shutil.copyfile(files / "unsealed.nc", path)
    with netCDF4.Dataset(path, "a") as data:
        data.setncattr("config", CONFIGS[name])
    refused(call("check", path), "its attribute config")


def test_a_config_of_another_system_is_refused_where_it_is_drawn(files, tmp_path):
    path = tmp_path / "other.nc"
    shutil.copyfile(files / "unsealed.nc", path)
    config = deli.open_run(path).attrs["config"]
    for old, new in (("balls = 3", "balls = 4"), ("balls = 3", "balls = -1"), ("balls = 3", "spheres = 3")):
        assert old in config
        with netCDF4.Dataset(path, "a") as data:
            data.setncattr("config", config.replace(old, new))
        refused(call("plot", path, "-o", tmp_path / "p.png"), "the run's attribute config makes")


def test_a_dimension_beyond_the_file_takes_no_memory(files, tmp_path):
    path = tmp_path / "wide.nc"
    shutil.copyfile(files / "unsealed.nc", path)
    with netCDF4.Dataset(path, "a") as data:
        data["trajectory"].renameVariable("gap_min", "before")
        data["trajectory"].createDimension("wide", 2**40)
        data["trajectory"].createVariable("gap_min", "f8", ("wide",), chunksizes=[1024], fill_value=False)
    with pytest.raises(InputError, match=r"trajectory/gap_min has the shape .*, which takes 8,796,093,022,208 bytes"):
        deli.open_run(path)


@pytest.mark.parametrize(
    ("code", "how"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "SIGSEGV"),
        ("from deli.recording import apart; apart.SECONDS = 1; apart._limit(0)\nwhile True: pass", "SIGXCPU|SIGKILL"),
        ("from deli.recording import apart; apart._limit(0); bytes(1 << 31)", "exit status 1"),
        ("print('{}')", "exit status 0"),
    ],
)
def test_what_kills_the_process_that_reads_is_refused(files, monkeypatch, code, how):
    monkeypatch.setattr(apart, "_CODE", "import sys; sys.path[:] = {path!r}\n" + code.replace("{}", "{{}}"))
    with pytest.raises(InputError, match=rf"unsealed\.nc is damaged: the process that read it died \(({how})\)"):
        deli.open_run(files / "unsealed.nc")


def test_what_is_no_file_is_refused(files, tmp_path):
    os.mkfifo(tmp_path / "pipe.nc")
    (tmp_path / "away.nc").symlink_to(tmp_path / "nowhere.nc")
    (tmp_path / "round.nc").symlink_to(tmp_path / "round.nc")
    for name, words in (("pipe.nc", "it is not a file"), ("away.nc", "does not exist"), ("round.nc", "does not exist")):
        refused(call("plot", tmp_path / name), name, words)
    (tmp_path / "link.nc").symlink_to(files / "sealed.nc")
    assert look(tmp_path / "link.nc", files / "sealed.nc") == "same"


def test_other_readers_see_no_seal_and_other_writers_drop_it(files, tmp_path):
    path = tmp_path / "sealed.nc"
    shutil.copyfile(files / "sealed.nc", path)
    run = deli.open_run(path)
    with netCDF4.Dataset(path) as data, xr.open_datatree(path) as tree:
        np.testing.assert_array_equal(data["trajectory"]["position"][:], run["trajectory"]["position"])
        assert tree["trajectory"].to_dataset().identical(run["trajectory"].to_dataset())
    assert seal.intact(path) is True
    with netCDF4.Dataset(path, "a"):
        pass
    assert seal.intact(path) is None
    assert same(deli.open_run(path), run)
    result = call("check", path)
    assert result.exit_code == 0, result.output
    assert "the checksums of all rows agree; there is no digest" in result.stdout


def test_a_file_is_sealed_before_it_gets_its_name(tmp_path, monkeypatch):
    moved, replace = [], os.replace

    def watch(source, target):
        moved.append((target, seal.intact(source)))
        replace(source, target)

    monkeypatch.setattr(netcdf.os, "replace", watch)
    simulate(tmp_path / "run.nc")
    assert moved[-1] == (tmp_path / "run.nc", True)


def test_reading_apart_gives_all_that_reading_here_does(files):
    """Attributes too, of every type."""
    here, there = (deli.open_run(files / name) for name in ("sealed.nc", "unsealed.nc"))
    xr.testing.assert_identical(here, there)
    for one, other in zip(numbers(here), numbers(there), strict=True):
        for name, values in one.variables.items():
            assert values.dtype == other[name].dtype
            assert {key: type(value) for key, value in values.attrs.items()} == {
                key: type(value) for key, value in other[name].attrs.items()
            }
