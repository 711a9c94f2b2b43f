"""Runs that another program has written once more: they open, said to be unsealed, or what is missing is named."""

import contextlib
import logging

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from running import DONE, assert_same, call, refused

import deli
from deli.errors import InputError

STEPS = 60
GROUPS = ("trajectory", "solver_stats", "subproblems")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a run that has impacts and subproblems."""
    folder = tmp_path_factory.mktemp("rewritten")
    deli.simulate(
        deli.scenes.newtons_cradle(balls=3),
        deli.GVI(),
        step_size=0.02,
        steps=STEPS,
        skip=False,
        subproblems=True,
        output=folder / "run.nc",
    )
    return folder


def same(one, other, groups=GROUPS):
    return all(one[group].to_dataset().identical(other[group].to_dataset()) for group in groups)


def whole_file(path):
    """A run as deli opens it, and as xarray does."""
    yield deli.open_run(path)
    with xr.open_datatree(path) as found:
        yield found.load()


def compressed(run):
    return {
        f"/{group}": {str(name): {"zlib": True, "shuffle": True, "complevel": 9} for name in run[group].data_vars}
        for group in GROUPS
    }


def other_bytes(run):
    return {f"/{group}": {name: {"dtype": ">f8"} for name in names} for group, names in FLOATS.items()}


FLOATS = {"trajectory": ("position", "momentum", "time"), "solver_stats": ("solve_time",)}
WAYS = {
    "as it is": lambda run: {},
    "compressed": lambda run: {"encoding": compressed(run)},
    "other bytes": lambda run: {"encoding": other_bytes(run)},
    "marks": lambda run: {"encoding": {"/solver_stats": {"primal_residual": {"_FillValue": -1.0}}}},
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("reader", [0, 1])
def test_a_run_that_xarray_saves_again_is_the_same_run(place, tmp_path, way, reader, caplog):
    run, path = list(whole_file(place / "run.nc"))[reader], tmp_path / "again.nc"
    run.attrs |= {"note": "schön", "numbers": [1.0, 2.0], "words": ["a", "ü"]}
    run["trajectory"].attrs["note"] = "für später"
    run.to_netcdf(path, **WAYS[way](run))
    with caplog.at_level(logging.WARNING, "deli"):
        again = deli.open_run(path)
    assert same(again, deli.open_run(place / "run.nc"))
    assert again.attrs["note"] == "schön"
    assert ("is not sealed: another program wrote it" in caplog.text) == (reader == 0)
    result = call("check", path)
    assert result.exit_code == DONE, result.output
    assert ("not sealed" if reader == 0 else "there is no digest") in result.stdout
    problem, before = (deli.load_subproblem(file, 3) for file in (path, place / "run.nc"))
    assert problem.objective.value == before.objective.value


@settings(max_examples=12, deadline=None, phases=(Phase.explicit, Phase.generate))  # each reads in another process
@given(
    rows=st.slices(STEPS + 1).filter(lambda rows: rows.indices(STEPS + 1)[2] > 0),
    steps=st.slices(STEPS).filter(lambda steps: steps.indices(STEPS)[2] > 0),
)
def test_rows_that_are_left_out(tmp_path_factory, place, rows, steps):
    """The rows that are left are the recorded ones, and no metric sums up a part of the steps."""
    run, path = deli.open_run(place / "run.nc"), tmp_path_factory.mktemp("thin") / "thin.nc"
    thin = run.isel(time=rows, missing_dims="ignore").isel(step=steps, missing_dims="ignore")
    thin.to_netcdf(path)
    kept, taken = range(STEPS + 1)[rows], range(STEPS)[steps]
    if not kept:
        with pytest.raises(InputError, match="is no longer a run: trajectory has no rows"):
            deli.open_run(path)
        return
    again = deli.open_run(path)
    assert same(again, thin)
    found, whole = deli.metrics.measure(again), deli.metrics.measure(run.isel(time=slice(kept[-1] + 1)))
    reflected = float(run["trajectory"]["reflected_contacts"][: kept[-1] + 1].sum())
    all_rows, all_steps = list(kept) == list(range(kept[-1] + 1)), list(taken) == list(range(kept[-1]))
    np.testing.assert_equal(float(found["reflected_contacts"]), reflected if all_rows else np.nan)
    solves = float(run["solver_stats"]["solves"][: kept[-1]].sum())
    np.testing.assert_equal(float(found["solves"]), solves if all_steps else np.nan)
    assert found["simulated_time"] == whole["simulated_time"]


def test_a_run_of_every_tenth_row_is_checked_drawn_and_measured(place, tmp_path):
    run, path = deli.open_run(place / "run.nc"), tmp_path / "thin.nc"
    run.isel(time=slice(None, None, 10), missing_dims="ignore").to_netcdf(path)
    result = call("check", path)
    assert result.exit_code == DONE, result.output
    assert "7 rows and 60 steps" in result.stdout
    assert call("plot", path, "-o", tmp_path / "picture.png").exit_code == DONE
    figure = deli.plotting.history(deli.open_run(path))
    drawn = {line.get_label(): line for axes in figure.axes for line in axes.get_lines()}
    assert drawn["position"].get_xdata().max() == pytest.approx(0.02 * STEPS)


def test_thinned_beside_the_count_of_all_rows(place, tmp_path):
    """As tools do it that copy the root's variables: deli check finds that fewer are there."""
    path = tmp_path / "thin.nc"
    with xr.open_datatree(place / "run.nc") as run:
        run.isel(time=slice(None, None, 10), missing_dims="ignore").to_netcdf(path)
    again = deli.open_run(path)
    assert again["trajectory"].sizes["time"] == 7
    refused(call("check", path), "fails these checks: content")


def test_variables_that_were_added_come_along(place, tmp_path):
    run, path = deli.open_run(place / "run.nc"), tmp_path / "more.nc"
    speed = np.linalg.norm(run["trajectory"]["momentum"].values, axis=1)
    run["trajectory"]["speed"] = xr.DataArray(speed, dims="time", attrs={"units": "L T-1"})
    run["analysis"] = xr.DataTree(xr.Dataset({"x": 1.0}))
    run.to_netcdf(path)
    again = deli.open_run(path)
    np.testing.assert_array_equal(again["trajectory"]["speed"], speed)
    assert again["trajectory"]["speed"].attrs == {"units": "L T-1"}
    again["trajectory"] = xr.DataTree(again["trajectory"].to_dataset().drop_vars("speed"))
    assert_same(again, deli.open_run(place / "run.nc"))


def without(group, name):
    def change(run):
        run[group] = xr.DataTree(run[group].to_dataset().drop_vars(name))

    return change


def drop(group):
    return lambda run: run.__delitem__(group)


def encode(group, name, **how):
    return {"encoding": {f"/{group}": {name: how}}}


def value(group, name, index, number):
    def change(run):
        values = run[group][name].values.copy()
        values[index] = number
        run[group] = xr.DataTree(run[group].to_dataset().assign_coords({name: run[group][name].copy(data=values)}))

    return change


def attribute(name):
    return lambda run: run.attrs.pop(name)


NOTHING = lambda run: None  # noqa: E731
REFUSED = {
    "no statistics": (drop("solver_stats"), {}, "not a run recorded by deli: it has no solver_stats"),
    "no trajectory": (drop("trajectory"), {}, "not a run recorded by deli: it has no trajectory"),
    "no energy": (without("trajectory", "kinetic_energy"), {}, "trajectory/kinetic_energy is missing"),
    "no times": (without("trajectory", "time"), {}, "trajectory/time is missing"),
    "no config": (attribute("config"), {}, "attribute config is None"),
    "no conventions": (attribute("Conventions"), {}, "follows the conventions None"),
    "half the digits": (NOTHING, encode("trajectory", "position", dtype="f4"), "position is of the type float32"),
    "packed": (
        NOTHING,
        encode("trajectory", "hamiltonian", scale_factor=0.5, dtype="f8"),
        "hamiltonian is packed, by its attribute scale_factor",
    ),
    "another order": (value("trajectory", "time", 3, 0.0), {}, "trajectory/time is 0.0 in row 3"),
    "steps in another order": (value("solver_stats", "step", 3, 1), {}, "solver_stats/step is 1 at place 3"),
    "other bodies": (value("trajectory", "body", 0, 2), {}, "trajectory/body is [2, 0"),
    "other words": (value("trajectory", "direction", 0, "z"), {}, "trajectory/direction is ['z', 'y'"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_run_any_more_is_named(place, tmp_path, name):
    change, how, words = REFUSED[name]
    run, path = deli.open_run(place / "run.nc"), tmp_path / "less.nc"
    change(run)
    run.to_netcdf(path, **how)
    with pytest.raises(InputError) as error:
        deli.open_run(path)
    assert words in str(error.value)
    assert "damaged" not in str(error.value)
    for command in (("check", path), ("plot", path, "-o", tmp_path / "picture.png")):
        refused(call(*command), words)


def test_numbers_that_do_not_follow_from_the_states_are_found(place, tmp_path):
    run, path = deli.open_run(place / "run.nc"), tmp_path / "other.nc"
    run["trajectory"]["hamiltonian"][5] += 1e-6
    run.to_netcdf(path)
    refused(call("check", path), "fails these checks: hamiltonian")


def test_an_unfinished_run_is_counted_or_refused(place, tmp_path):
    """Rows go on from what deli has counted itself."""
    path = tmp_path / "run.nc"
    deli.open_run(place / "run.nc").to_netcdf(f"{path}.partial")
    with pytest.raises(InputError, match="not a run recorded by deli: it has no committed_rows"):
        deli.open_run(f"{path}.partial")


def test_words_of_any_length_take_no_more_room_than_the_file_could_mean(place, tmp_path):
    path = tmp_path / "long.nc"
    deli.open_run(place / "run.nc").to_netcdf(path)
    with netCDF4.Dataset(path, "a") as data, contextlib.suppress(RuntimeError):
        data["trajectory"].createDimension("many", 2**33)
        data["trajectory"].createVariable("words", str, ("many",), chunksizes=[1024])
    with pytest.raises(InputError, match="trajectory/words has the shape"):
        deli.open_run(path)
