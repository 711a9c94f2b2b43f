"""What a run contains, in memory and in its file."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

import deli
from deli.recording import seal
from deli.recording.schema import Schema

SCENES = {1: deli.scenes.pogo_stick, 2: deli.scenes.newtons_cradle, 3: deli.scenes.lennard_jones}
ALWAYS = {
    "trajectory": {
        "position": ("time", "dof"),
        "momentum": ("time", "dof"),
        "hamiltonian": ("time",),
        "kinetic_energy": ("time",),
        "potential_energy": ("time",),
        "linear_momentum": ("time", "axis"),
        "gap_min": ("time",),
        "equality_residual": ("time",),
        "smooth_contacts": ("time",),
        "reflected_contacts": ("time",),
    },
    "solver_stats": dict.fromkeys(
        (
            "solves",
            "skipped",
            "iterations",
            "rows",
            "fallbacks",
            "claimed",
            "verified",
            "solve_time",
            "overhead_time",
            "primal_residual",
            "dual_residual",
            "complementarity",
            "status",
        ),
        ("step", "subproblem"),
    ),
}


@pytest.fixture(scope="module", params=SCENES)
def recorded(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("schema") / "run.nc"
    scene = SCENES[request.param]()
    return scene, deli.simulate(scene, deli.GVI(scheme="verlet"), step_size=0.01, steps=20, output=path), path


def test_variables_and_dimensions(recorded):
    scene, run, _ = recorded
    angular = {1: {}, 2: {"angular_momentum": ("time",)}, 3: {"angular_momentum": ("time", "axis")}}[scene.dimension]
    for group, expected in ALWAYS.items():
        extra = angular if group == "trajectory" else {}
        assert {name: values.dims for name, values in run[group].data_vars.items()} == expected | extra
    assert run["trajectory"].sizes == {"time": 21, "dof": scene.dof, "axis": scene.dimension}
    assert list(run["solver_stats"]["subproblem"].values) == ["reflection", "position", "projection"]


def test_every_variable_has_units_and_a_long_name(recorded):
    _, run, path = recorded
    for tree in (run, xr.open_datatree(path)):
        for group in ("/", "trajectory", "solver_stats"):
            for name, variable in tree[group].to_dataset(inherit=False).variables.items():
                assert variable.attrs["units"], name
                assert variable.attrs["long_name"], name


def test_units_are_symbols(recorded):
    _, run, _ = recorded
    units = {name: values.attrs["units"] for name, values in run["trajectory"].data_vars.items()}
    assert units["position"] == units["gap_min"] == "L"
    assert units["momentum"] == units["linear_momentum"] == "M L T-1"
    assert units["hamiltonian"] == "M L2 T-2"
    assert run["trajectory"]["time"].attrs["units"] == "T"
    assert run["solver_stats"]["solve_time"].attrs["units"] == "s"


def test_status_has_flags(recorded):
    _, run, path = recorded
    for tree in (run, xr.open_datatree(path)):
        status = tree["solver_stats"]["status"]
        assert status.dtype == np.int8
        meanings = status.attrs["flag_meanings"].split()
        assert meanings == ["skipped", "solved", "inaccurate", "failed", "not_used"]
        np.testing.assert_array_equal(status.attrs["flag_values"], range(5))
        assert set(np.unique(status)) <= set(range(5))


def test_diagnostics_follow_from_the_states(recorded):
    scene, run, _ = recorded
    trajectory = run["trajectory"]
    for q, p, row in zip(trajectory["position"].values, trajectory["momentum"].values, range(21), strict=True):
        kinetic = sum(p**2 / scene.mass) / 2
        assert trajectory["kinetic_energy"][row] == pytest.approx(kinetic, rel=1e-14, abs=1e-14)
        assert trajectory["potential_energy"][row] == pytest.approx(float(scene.potential.energy(q)), rel=1e-13)
        assert trajectory["gap_min"][row] == pytest.approx(scene.unilateral.value(q).min(), abs=1e-14)
        residual = np.abs(scene.bilateral.value(q)).max() if scene.bilateral.rows else np.nan
        assert trajectory["equality_residual"][row] == pytest.approx(residual, abs=1e-14, nan_ok=True)
        total = p.reshape(-1, scene.dimension).sum(axis=0)
        np.testing.assert_allclose(trajectory["linear_momentum"][row], total, atol=1e-14)
    total = trajectory["kinetic_energy"] + trajectory["potential_energy"]
    np.testing.assert_allclose(trajectory["hamiltonian"], total, rtol=1e-14)


def test_memory_and_file_are_identical(recorded):
    scene, run, path = recorded
    xr.testing.assert_identical(run, deli.open_run(path))
    in_memory = deli.simulate(scene, deli.GVI(scheme="verlet"), step_size=0.01, steps=20)
    clocks = ["solve_time", "overhead_time"]
    for group, drop in (("trajectory", []), ("solver_stats", clocks)):
        one, other = (tree[group].to_dataset() for tree in (run, in_memory))
        xr.testing.assert_identical(one.drop_vars(drop), other.drop_vars(drop))
        assert {name: values.dtype for name, values in one.variables.items()} == {
            name: values.dtype for name, values in other.variables.items()
        }
    assert {key for key in run.attrs if run.attrs[key] != in_memory.attrs[key]} <= {"start", "end", "wall_time"}
    assert list(run.attrs) == list(in_memory.attrs)


def test_other_readers_see_the_same(recorded):
    _, run, path = recorded
    for group in ("trajectory", "solver_stats"):
        plain = xr.open_datatree(path)[group].to_dataset()
        xr.testing.assert_identical(plain, run[group].to_dataset())


def test_a_run_can_be_saved_again(recorded, tmp_path):
    _, run, _ = recorded
    run.to_netcdf(tmp_path / "copy.nc")
    xr.testing.assert_identical(xr.open_datatree(tmp_path / "copy.nc"), run)


def test_provenance(recorded):
    scene, run, _ = recorded
    attributes = run.attrs
    assert attributes["outcome"] == "complete"
    assert attributes["Conventions"] == "deli-2"
    assert scene.name in attributes["title"]
    assert attributes["deli_version"] == deli.__version__
    for key in (
        "cvxpy_version",
        "numpy_version",
        "python_version",
        "machine",
        "config",
        "backend_versions",
        "units_note",
        "citation",
    ):
        assert attributes[key]
    assert attributes["start"] <= attributes["end"]
    assert attributes["wall_time"] > 0


def test_provenance_names_no_user_or_host(recorded):
    import getpass
    import platform

    _, run, _ = recorded
    words = set(run.attrs["machine"].replace(",", " ").replace("-", " ").split())
    assert not words & {getpass.getuser(), platform.node()}


@pytest.mark.parametrize(
    ("scene", "linear", "angular"),
    [
        (deli.scenes.point_mass(), "none", "none"),
        (deli.scenes.newtons_cradle(), "none", "none"),
        (deli.scenes.spring_sphere(), "none", "z"),
        (deli.scenes.lennard_jones(), "none", "x y z"),
        (deli.Scene(mass=1.0, position=[[0.0, 1.0]], momentum=[[1.0, 2.0]], dimension=2), "x y", "z"),
    ],
)
def test_conserved_momenta_are_named(scene, linear, angular):
    run = deli.simulate(scene, deli.GVI(scheme="verlet"), step_size=0.01, steps=1)
    assert run.attrs["conserved_linear_momentum"] == linear
    assert run.attrs["conserved_angular_momentum"] == angular


def test_gaps_are_nan_without_constraints():
    scene = deli.Scene(mass=1.0, position=[0.0], momentum=[1.0])
    run = deli.simulate(scene, deli.GVI(), step_size=0.5, steps=4)
    assert np.isnan(run["trajectory"]["gap_min"]).all()
    assert np.isnan(run["trajectory"]["equality_residual"]).all()
    np.testing.assert_allclose(run["trajectory"]["position"][:, 0], [0, 0.5, 1, 1.5, 2])


def test_schema_names_every_dimension():
    for dimension in (1, 2, 3):
        schema = Schema(dof=2 * dimension, dimension=dimension)
        for group, variables in schema.groups.items():
            assert len({variable.name for variable in variables}) == len(variables)
            constants = schema.constants()[group]
            for variable in variables:
                if not variable.grows:
                    assert constants[variable.name].shape == tuple(schema.sizes[name] for name in variable.dims)


def test_a_file_of_a_version_that_named_no_citation_opens(tmp_path):
    path = tmp_path / "run.nc"
    deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=2, output=path)
    with netCDF4.Dataset(path, "a") as file:
        file.delncattr("citation")
    seal.seal(path)
    assert "citation" not in deli.open_run(path).attrs
