"""Recorded subproblems solved again: what is verified, what it costs, and how backends compare."""

import matplotlib
import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from running import call, refused

import deli
import solvers
from deli.plotting.profiles import _style
from deli.replaying.profiles import charged_times, performance_profile, ratios, shifted_geometric_mean
from deli.replaying.replay import LIBRARY
from solvers import Answer, Backend, SolverError, Status

RESIDUALS = ("primal_residual", "dual_residual", "complementarity")
TOLERANCE = 1e-9


def again(path=None, **keywords):
    """Replay, with a limit that no load of the machine reaches."""
    return deli.replay(path, **{"repeat": 1, "limit": 1e4, **keywords})


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A file with some 60 subproblems of all three kinds."""
    path = tmp_path_factory.mktemp("replay") / "run.nc"
    keywords = {"skip": False, "subproblems": True, "output": path}
    deli.simulate(deli.scenes.newtons_cradle(balls=3), deli.GVI(), step_size=0.02, steps=15, **keywords)
    return path


@pytest.fixture
def registered():
    """Register backends for one test."""
    names = []

    def add(name, factory):
        solvers.register(name, factory)
        names.append(name)

    yield add
    for name in names:
        solvers.unregister(name)


class Liar(Backend):
    """Says that it solved the problem, and answers zero."""

    name = "liar"

    def __init__(self, program, tolerance, options):
        self.program = program

    def update(self):
        pass

    def solve(self):
        program = self.program
        return Answer(np.full(program.variables, 7.0), np.zeros(program.rows), Status.SOLVED, 1, "trust me")


class Refusing(Liar):
    """Refuses every problem."""

    name = "refusing"

    def solve(self):
        raise SolverError("not this one")


def check_verdicts(data, tolerance=TOLERANCE):
    """What is verified has residuals within the tolerance and is near the solution."""
    verified = data["verified"].values
    worst = np.fmax.reduce([data[name].values for name in RESIDUALS])
    assert (worst[verified] <= tolerance).all()
    status = data["status"].attrs["flag_meanings"].split()
    np.testing.assert_array_equal(verified, data["status"].values == status.index("solved"))
    # A gap of yᵀs leaves |z − z*|² <= 2 yᵀs; sums over rows, and scales of terms, are of order one.
    rows = data["rows"].values[:, None] + 1
    assert (data["error"].values <= 10 * np.sqrt(rows * tolerance))[verified].all()
    assert np.isfinite(data["reference_residual"]).all()
    assert (data["time"].values[verified] >= data["solver_time"].values[verified]).all()


@pytest.fixture(scope="module")
def of_library():
    return again(backends=["native", "daqp", "clarabel"])


class TestLibrary:
    def test_the_backends_of_the_default_chain_solve_it_all(self, of_library):
        check_verdicts(of_library)
        assert of_library["verified"].sel(backend=["native", "daqp"]).all()
        assert of_library["error"].sel(backend=["native", "daqp"]).max() < 1e-13
        assert of_library["recorded_error"].max() < 1e-12

    def test_it_holds_every_kind_of_problem_and_scene(self, of_library):
        assert set(of_library["subproblem"].values) == {0, 1, 2}
        for name in ("newtons_cradle", "spring_sphere smooth", "spring_sphere mixed", "disc_pile", "lennard_jones"):
            assert name in of_library["origin"].values
        for words in ("rods", "packed corner", "redundant", "grazing", "mass ratio 1e8"):
            assert any(words in origin for origin in of_library["origin"].values), words
        assert LIBRARY.stat().st_size < 1_000_000

    @pytest.mark.long
    @pytest.mark.parametrize("polish", [True, False])
    def test_every_backend_solves_nearly_all(self, polish):
        data = again(polish=polish)
        check_verdicts(data)
        assert (data["verified"].mean("problem") > 0.9).all()


class TestRun:
    @pytest.mark.parametrize("polish", [True, False])
    def test_every_backend_is_verified(self, recorded, polish):
        data = again(recorded, polish=polish)
        assert data["backend"].values.tolist() == solvers.available()
        check_verdicts(data)
        share = data["verified"].mean("problem")
        # Unpolished, QOCO gives up on some problems with equations.
        assert (share == 1.0).all() if polish else ((share == 1.0).sum() >= 8 and share.min() > 0.8), share
        assert (data["origin"] == "newtons_cradle").all()
        run = deli.open_run(recorded)["subproblems"]
        for name in ("subproblem", "step", "solve", "variables", "rows", "equalities"):
            np.testing.assert_array_equal(data[name], run[name])

    def test_polish_makes_answers_exact(self, recorded):
        loose = {"backends": ["clarabel", "osqp"], "tolerance": 1e-6}
        rough, polished = (again(recorded, polish=polish, **loose) for polish in (False, True))
        assert polished["error"].max() < 1e-13
        assert rough["error"].max() > 1e-12
        check_verdicts(rough, 1e-6)

    def test_a_chain_replays_as_one(self, recorded):
        data = again(recorded, backends=["auto"])
        assert data["verified"].all()
        assert {name.split()[0] for name in data.attrs["backend_versions"].split(", ")} == {"native", "daqp", "piqp"}

    @pytest.mark.parametrize("backend", ["auto", "daqp"])
    def test_many_rows_are_handed_over_sparse(self, tmp_path, backend):
        path, scene = tmp_path / "run.nc", deli.scenes.disc_pile(rows=8, columns=8)
        deli.simulate(scene, deli.GVI(), step_size=0.01, steps=1, subproblems=1, output=path)
        data = again(path, backends=[backend])
        assert data["rows"] > 150
        assert data["verified"].all()
        assert data["error"] < 1e-12


class TestFailures:
    def test_a_liar_claims_and_is_not_verified(self, recorded, registered):
        registered("liar", Liar)
        data = again(recorded, backends=["liar", "daqp"], polish=False)
        liar, honest = data.sel(backend="liar"), data.sel(backend="daqp")
        assert liar["claimed"].all()
        assert not liar["verified"].any()
        assert (liar["error"] > 1.0).all()
        assert honest["verified"].all()
        assert (charged_times(data)[:, 0] == 1e4).all()
        np.testing.assert_allclose(shifted_geometric_mean(charged_times(data))[0], 1e4, rtol=1e-9)
        assert (performance_profile(data).sel(backend="liar") == 0.0).all()

    def test_a_liar_stands_out_in_the_table(self, recorded, registered):
        registered("liar", Liar)
        result = call("replay", recorded, "--backends", "liar,daqp", "--no-polish", "--repeat", 1, "--limit", 1e4)
        assert result.exit_code == 0, result.output
        (row,) = (line for line in result.stdout.splitlines() if line.startswith("│ liar") and "%" in line)
        count = deli.open_run(recorded)["subproblems"].sizes["problem"]
        assert [cell.strip() for cell in row.split("│")[2:5]] == ["100 %", "0.0 %", str(count)]
        assert f"{count - 3} more" in result.stdout

    def test_a_backend_that_refuses_has_no_answer(self, recorded, registered):
        registered("refusing", Refusing)
        data = again(recorded, backends=["refusing"])
        status = data["status"].attrs["flag_meanings"].split()
        assert (data["status"] == status.index("no_answer")).all()
        assert not data["claimed"].any()
        assert data["error"].isnull().all()

    def test_what_takes_longer_than_the_limit_is_not_solved(self, recorded):
        data = again(recorded, backends=["daqp"], limit=1e-9)
        assert data["claimed"].all()
        assert not data["verified"].any()

    @pytest.mark.parametrize(
        ("keywords", "words"),
        [
            ({"backends": ["nonsense"]}, "unknown backend 'nonsense'"),
            ({"backends": []}, "backends is empty"),
            ({"tolerance": 0.0}, "tolerance of 'daqp' is 0.0"),
            ({"repeat": 0}, "repeat is 0"),
            ({"limit": 0.0}, "limit is 0.0"),
        ],
    )
    def test_wrong_arguments_are_refused(self, recorded, keywords, words):
        with pytest.raises(deli.InputError, match=words):
            deli.replay(recorded, **{"backends": ["daqp"], **keywords})


class TestProfiles:
    """Laws of performance profiles, on arbitrary times."""

    tables = st.tuples(st.integers(1, 30), st.integers(1, 6)).flatmap(
        lambda shape: st.tuples(arrays.arrays(float, shape, elements=st.floats(1e-6, 10.0)), arrays.arrays(bool, shape))
    )

    @staticmethod
    def data(times, verified):
        dims = ("problem", "backend")
        names = [f"solver{k}" for k in range(times.shape[1])]
        values = {"time": (dims, times), "verified": (dims, verified)}
        return xr.Dataset(values, coords={"backend": names}, attrs={"limit": 10.0})

    @given(tables)
    def test_profiles_rise_from_wins_to_successes(self, table):
        _, verified = table
        data = self.data(*table)
        found, profile = ratios(data), performance_profile(data)
        solved = verified.any(axis=1)
        assert (found >= 1.0).all()
        assert (found[solved].min(axis=1) == 1.0).all()
        assert np.isinf(found[~verified]).all()
        assert np.isfinite(found[verified]).all()
        share = profile.values
        assert profile["ratio"][0] == 1.0
        assert (np.diff(profile["ratio"]) > 0).all()
        assert (np.diff(share, axis=1) >= 0).all()
        assert share.min() >= 0.0
        assert share.max() <= 1.0
        np.testing.assert_array_equal(share[:, -1], verified.mean(axis=0))
        np.testing.assert_array_equal(share[:, 0], (found == 1.0).mean(axis=0))
        assert share[:, 0].sum() >= solved.mean() * (1.0 - 1e-12)

    @given(tables)
    def test_means_lie_between_the_extremes_and_failures_cost(self, table):
        times, verified = table
        data = self.data(*table)
        charged = charged_times(data)
        mean = shifted_geometric_mean(charged)
        assert (mean >= charged.min(axis=0) * (1 - 1e-9) - 1e-15).all()
        assert (mean <= charged.max(axis=0) * (1 + 1e-9) + 1e-15).all()
        fewer = shifted_geometric_mean(charged_times(self.data(times, np.zeros_like(verified))))
        assert (fewer >= mean * (1 - 1e-12)).all()
        np.testing.assert_allclose(shifted_geometric_mean(charged[::-1]), mean, rtol=1e-9)

    def test_a_known_profile(self):
        data = self.data(np.array([[1.0, 2.0], [4.0, 1.0], [3.0, 3.0]]), np.array([[1, 1], [1, 1], [1, 0]], dtype=bool))
        profile = performance_profile(data)
        assert profile["ratio"].values.tolist() == [1.0, 2.0, 4.0]
        np.testing.assert_allclose(profile.values, np.array([[2, 2, 3], [1, 2, 2]]) / 3)


class TestCommand:
    def test_results_are_printed_kept_and_drawn(self, recorded, folder):
        arguments = [
            "-b",
            "daqp,native",
            "-b",
            "clarabel",
            "--repeat",
            1,
            "--limit",
            1e4,
            "-o",
            "out.nc",
            "--plot",
            "out.png",
        ]
        result = call("replay", recorded, *arguments)
        assert result.exit_code == 0, result.output
        for words in ("verified", "worst cases, by index", "Recorded in out.nc", "Drawn in out.png", "clarabel"):
            assert words in result.stdout
        data = xr.open_dataset("out.nc")
        assert data["backend"].values.tolist() == ["daqp", "native", "clarabel"]
        assert data["time"].attrs["units"] == "s"
        assert data["verified"].all()
        assert (folder / "out.png").stat().st_size > 10_000
        refused(call("replay", recorded, *arguments), "out.nc exists", "--overwrite")
        assert call("replay", recorded, *arguments, "--overwrite", "-q").stdout == ""

    def test_input_at_fault(self, recorded, folder):
        deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=2, output="plain.nc")
        refused(call("replay", "plain.nc"), "plain.nc holds no subproblems", "record.subproblems = true")
        refused(call("replay", "nothing.nc"), "nothing.nc does not exist")
        refused(call("replay", recorded, "-b", "nonsense"), "unknown backend 'nonsense'")
        refused(call("replay", recorded, "--plot", "out.bmp"), "'.bmp'")
        refused(call("replay", recorded, "--tolerance", 2), "tolerance")
        (folder / "junk.nc").write_bytes(b"junk")
        refused(call("replay", "junk.nc"), "junk.nc cannot be read")


@pytest.fixture(scope="module")
def data(recorded):
    return again(recorded, backends=["native", "daqp", "clarabel"])


class TestPlot:
    def test_a_profile_is_drawn_on_given_axes(self, data):
        figure = matplotlib.figure.Figure()
        axes = figure.subplots()
        assert deli.plotting.performance_profile(data, axes) is axes
        lines = {line.get_label(): line for line in axes.get_lines()}
        assert list(lines) == ["native", "daqp", "clarabel"]
        for index, line in enumerate(lines.values()):
            share = performance_profile(data).isel(backend=index).values
            np.testing.assert_array_equal(line.get_ydata()[:-1], share)
        assert axes.get_xscale() == "log"
        assert "fastest" in axes.get_xlabel()

    def test_a_profile_brings_its_own_figure(self, data):
        assert deli.plotting.performance_profile(data).figure is not None

    def test_styles_of_all_backends_differ(self):
        styles = [_style(index) for index in range(16)]
        assert len({(style["color"], str(style["linestyle"])) for style in styles}) == 16
