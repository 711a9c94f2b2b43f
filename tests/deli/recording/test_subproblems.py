"""Subproblems recorded with a run: what they hold, how many there are, and that they change nothing."""

import gc

import netCDF4
import numpy as np
import pytest
import xarray as xr
from running import assert_same, call, refused
from subproblem_cases import RUN, posed, problems, simulate

import deli
import solvers
from deli.recording import contents, netcdf
from solvers import Answer, Backend, Status


@RUN
def test_every_solve_is_there_once_with_its_rows(name):
    run = simulate(name, subproblems=True)
    stats, data = run["solver_stats"].to_dataset(), posed(run)
    assert run.attrs["outcome"] == "complete"
    assert data.sizes["problem"] > 0
    assert data["left_out"] == 0
    counted, rows = np.zeros((2, stats.sizes["step"], 3), dtype=int)
    np.add.at(counted, (data["step"].values, data["subproblem"].values), 1)
    np.add.at(rows, (data["step"].values, data["subproblem"].values), data["rows"].values)
    np.testing.assert_array_equal(counted, stats["solves"].values)
    np.testing.assert_array_equal(rows, stats["rows"].values)
    order = data[["step", "subproblem", "solve"]].to_dataframe()
    assert not order.duplicated().any()
    assert (order["solve"] < counted[data["step"].values, data["subproblem"].values]).all()


@RUN
def test_the_recorded_answer_solves_the_recorded_problem(name):
    run = simulate(name, subproblems=True)
    for metric, matrix, linear, z, bounds, y, active, equalities, one in problems(run):
        slack = matrix @ z - bounds
        size = 1.0 + np.abs(np.concatenate((bounds, y, linear))).max(initial=0.0)
        assert np.abs(metric @ z + linear - matrix.T @ y).max(initial=0.0) < 1e-12 * size
        assert np.abs(slack[:equalities]).max(initial=0.0) < 1e-12 * size
        assert slack[equalities:].min(initial=0.0) > -1e-12 * size
        assert y[equalities:].min(initial=0.0) >= -1e-12 * size
        assert np.abs(slack * y).max(initial=0.0) < 1e-12 * size
        assert active[:equalities].all()
        assert (np.abs(y[active == 0]) <= np.maximum(slack[active == 0], 1e-14)).all()
        residuals = [float(one[name]) for name in ("primal_residual", "dual_residual", "complementarity")]
        assert max(residuals) < 1e-12
        np.testing.assert_allclose(np.linalg.norm(matrix, axis=1), 1.0, rtol=0, atol=1e-12)


@RUN
def test_recording_subproblems_changes_no_bit_of_a_run(name):
    plain, recorded = simulate(name), simulate(name, subproblems=True)
    assert_same(plain, recorded)
    assert "subproblems" not in plain


def test_a_file_holds_what_memory_does_however_rows_are_thinned(tmp_path):
    run = simulate("cradle", subproblems=True)
    path = tmp_path / "run.nc"
    xr.testing.assert_identical(posed(simulate("cradle", every=7, output=path, subproblems=True)), posed(run))
    xr.testing.assert_identical(posed(deli.open_run(path)), posed(run))
    assert xr.open_datatree(path)["subproblems"].sizes["problem"] == posed(run).sizes["problem"]


@pytest.mark.parametrize("every", [1, 7])
@pytest.mark.parametrize("most", [True, 50])
def test_a_resumed_run_has_each_subproblem_once(tmp_path, at_step, every, most):
    path, keywords = tmp_path / "run.nc", {"every": every, "subproblems": most}
    full = simulate("cradle", **keywords)

    def stop(take):
        raise KeyboardInterrupt

    for number in (30, 25):
        at_step(number, stop)
        with pytest.raises(deli.Interrupted):
            simulate("cradle", output=path, resume=True, **keywords)
    at_step.restore()
    partial = posed(deli.open_run(f"{path}.partial"))
    assert 0 < partial.sizes["problem"] <= posed(full).sizes["problem"]
    resumed = simulate("cradle", output=path, resume=True, **keywords)
    assert_same(resumed, full)
    xr.testing.assert_identical(posed(resumed), posed(full))


@pytest.mark.parametrize("rows", [1, 48])
def test_a_kill_between_the_two_counters_doubles_nothing(tmp_path, at_step, monkeypatch, rows):
    path = tmp_path / "run.nc"
    full = simulate("cradle", subproblems=True)

    def stop(take):
        raise KeyboardInterrupt

    for number in (rows, 60 - rows) if rows > 1 else (60,):
        at_step(number, stop)
        with monkeypatch.context() as patch:
            if number != rows:
                patch.setattr(netcdf.Writer, "_count", killed_before_rows(netcdf.Writer._count))
            with pytest.raises((deli.Interrupted, Killed)):
                simulate("cradle", output=path, resume=True, subproblems=True)
        gc.collect()
    at_step.restore()
    partial = deli.open_run(f"{path}.partial")
    assert partial["trajectory"].sizes["time"] == rows
    assert posed(partial).sizes["problem"] > (posed(full)["step"] < rows - 1).sum()
    resumed = simulate("cradle", output=path, resume=True, subproblems=True)
    xr.testing.assert_identical(posed(resumed), posed(full))


class Killed(BaseException):
    """The end of a process, to the code that is in its way."""


def killed_before_rows(count):
    """Count subproblems, and die instead of counting the rows, unless these are all that there were before."""
    begun = []

    def counted(self, what, number):
        if what == contents.COMMITTED:
            begun.append(number)
            if len(begun) > 1:
                raise Killed
        count(self, what, number)

    return counted


def test_another_limit_is_another_configuration(tmp_path, at_step):
    path = tmp_path / "run.nc"

    def stop(take):
        raise KeyboardInterrupt

    at_step(5, stop)
    with pytest.raises(deli.Interrupted):
        simulate("cradle", output=path, subproblems=True)
    at_step.restore()
    with pytest.raises(deli.InputError, match=r"record\.subproblems is 10000 there and 'absent' now"):
        simulate("cradle", output=path, resume=True)


def test_a_limit_keeps_the_first_and_says_how_many_it_left_out():
    full, some = posed(simulate("cradle", subproblems=True)), posed(simulate("cradle", subproblems=20))
    assert some.sizes["problem"] == 20
    assert some["left_out"] == full.sizes["problem"] - 20
    for variable in ("subproblem", "step", "solve", "rows"):
        np.testing.assert_array_equal(some[variable], full[variable][:20])
    np.testing.assert_array_equal(some["velocity"], full["velocity"][: some.sizes["variable"]])


@pytest.mark.parametrize(("name", "most"), [("cradle", 20_000), ("newton_metric", 30_000)])
def test_size_is_limited_too_and_a_resumed_run_knows(name, most, monkeypatch, tmp_path, at_step):
    monkeypatch.setattr("deli.subproblems.collector.MOST_BYTES", most)
    path, full = tmp_path / "run.nc", simulate(name, subproblems=True)
    arrays = [
        v for v in posed(full).data_vars.values() if v.dims and v.dims != ("problem",) and v.name != "row_entries"
    ]
    size = sum(array.nbytes for array in arrays) + 8 * posed(full).sizes["row"]
    assert most <= size < most + 2 * size / posed(full).sizes["problem"]
    assert posed(full)["left_out"] > 0

    def stop(take):
        raise KeyboardInterrupt

    at_step(15, stop)
    with pytest.raises(deli.Interrupted):
        simulate(name, output=path, subproblems=True)
    at_step.restore()
    assert posed(deli.open_run(f"{path}.partial"))["left_out"] == 0
    resumed = simulate(name, output=path, resume=True, subproblems=True)
    xr.testing.assert_identical(posed(resumed), posed(full))


@pytest.fixture
def giving_up():
    """A backend that answers nothing after its tenth solve."""

    class GivingUp(Backend):
        name = "giving_up"
        solved = 0

        def __init__(self, program, tolerance, options):
            self.inner = solvers.registry.factory("daqp")(program, tolerance, options)

        def update(self):
            self.inner.update()

        def solve(self):
            answer = self.inner.solve()
            GivingUp.solved += 1
            if GivingUp.solved <= 10:
                return answer
            return Answer(answer.x * np.nan, answer.y * np.nan, Status.FAILED, 0, "I give up")

    solvers.register("giving_up", GivingUp)
    yield
    solvers.unregister("giving_up")


@pytest.mark.parametrize("every", [1, 1000])
@pytest.mark.parametrize("kept", ["memory", "file"])
def test_the_problem_that_stopped_a_run_is_kept(tmp_path, giving_up, every, kept):
    output = tmp_path / "run.nc" if kept == "file" else None
    run = simulate("cradle", solvers="giving_up", every=every, subproblems=True, output=output)
    assert run.attrs["outcome"].startswith("failed in step")
    data = posed(run)
    assert data.sizes["problem"] == 11
    step = int(run.attrs["outcome"].split("failed in step ")[1].split(" ")[0])
    assert data["step"][-1] == step - 1
    assert np.isnan(data["velocity"][-int(data["variables"][-1]) :]).all()
    assert np.isnan(data["primal_residual"][-1])
    assert np.isfinite(data["primal_residual"][:-1]).all()


@pytest.mark.parametrize("value", [0, -1, 1.5, "yes", None])
def test_a_wrong_number_is_refused(value):
    with pytest.raises(deli.InputError, match="subproblems is"):
        simulate("cradle", steps=1, subproblems=value)


@pytest.mark.parametrize("value", ["0", "-1", "1.5", '"yes"'])
def test_a_config_with_a_wrong_number_is_refused(folder, value):
    result = call("run", "point_mass", "--set", f"record.subproblems={value}")
    refused(result, "record.subproblems is", "true, false")


def test_a_config_records_checks_and_runs_again(folder):
    settings = ["--set", "record.subproblems=12", "--set", "skip=false", "--set", "steps=20"]
    result = call("run", "newtons_cradle", *settings, "-o", "one.nc")
    assert result.exit_code == 0, result.output
    assert "with 12 subproblems (" in result.stdout
    run = deli.open_run("one.nc")
    (folder / "again.toml").write_text(run.attrs["config"])
    assert call("run", "again.toml", "-o", "two.nc").exit_code == 0
    xr.testing.assert_identical(posed(deli.open_run("two.nc")), posed(run))
    checked = call("check", "one.nc")
    assert checked.exit_code == 0, checked.output
    assert "12 kept" in checked.stdout


def test_a_falsified_answer_is_found_out(folder):
    simulate("cradle", steps=20, subproblems=True, output="run.nc")
    with netCDF4.Dataset("run.nc", "a") as dataset:
        dataset["subproblems"]["velocity"][3] += 1e-6
    result = call("check", "run.nc")
    assert result.exit_code == 2
    assert "subproblems" in result.stderr
