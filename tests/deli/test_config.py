"""Configs: what is filled in, what is refused and in which words, what an override does."""

import dataclasses
import os

import numpy as np
import pytest

import deli
from deli.config import load, parse
from deli.config.models import method_model, scene_model
from deli.errors import InputError
from deli.integrators.registry import METHODS

POGO = """
duration = 1000.0
step_size = 0.1
[scene]
name = "pogo_stick"
stiffness = 20.0
[method]
name = "gvi"
scheme = "verlet"
energy = "numerical"
[solvers]
default = "clarabel"
reflection = { backend = "osqp", tolerance = 1e-10, options = { max_iter = 20000 } }
[record]
every = 10
output = "pogo.nc"
"""


def test_a_config_becomes_a_plan(tmp_path):
    (tmp_path / "pogo.toml").write_text(POGO)
    config = load(tmp_path / "pogo.toml")
    assert config.output == "pogo.nc"
    plan = config.plan(tmp_path / "out.nc")
    assert plan.scene.parameters["stiffness"] == 20.0
    assert plan.method == deli.GVI(scheme="verlet", energy="numerical")
    assert (plan.step_size, plan.steps, plan.every, plan.rows) == (0.1, 10_000, 10, 1001)
    assert plan.output == tmp_path / "out.nc"
    solvers = plan.config()["solvers"]
    assert solvers["reflection"] == {
        "backend": "osqp",
        "tolerance": 1e-10,
        "polish": True,
        "warm_start": False,
        "options": {"max_iter": 20000},
    }
    assert solvers["position"]["backend"] == solvers["projection"]["backend"] == "clarabel"


def test_a_warm_start_is_asked_for_in_a_config():
    config = {"scene": "pogo_stick", "solvers": {"backend": "osqp", "warm_start": True}}
    assert parse(config).plan().config()["solvers"]["position"]["warm_start"] is True


@pytest.mark.parametrize("name", deli.scenes.available())
def test_a_scene_alone_runs_as_in_the_paper(name):
    plan = parse({"scene": name}).plan()
    paper = deli.scenes.defaults(name)
    assert plan.step_size == paper["step_size"]
    assert plan.steps * plan.step_size == pytest.approx(paper["duration"], rel=1e-12)
    assert plan.method == deli.GVI(scheme=paper["scheme"])
    np.testing.assert_array_equal(plan.scene.position, deli.scenes.get(name)().position)


@pytest.mark.parametrize("name", deli.scenes.available())
def test_recorded_parameters_are_a_config(name):
    scene = deli.scenes.get(name)()
    plan = parse({"scene": {"name": name, **scene.parameters}}).plan()
    np.testing.assert_array_equal(plan.scene.position, scene.position)
    np.testing.assert_array_equal(plan.scene.momentum, scene.momentum)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, r"scene is missing; .*one of: lennard_jones"),
        ({"scene": {"balls": 3}}, r"scene\.name is None; allowed: lennard_jones"),
        ({"scene": "pogostick"}, r"scene\.name is 'pogostick'; did you mean 'pogo_stick'\? allowed: lennard_jones"),
        (
            {"scene": {"name": "pogo_stick", "stifness": 3.0}},
            r"scene\.stifness is an unknown key; did you mean 'stiffness'\? allowed: name, mass",
        ),
        ({"scene": {"name": "newtons_cradle", "balls": 2.5}}, r"scene\.balls is 2\.5; allowed: a valid integer"),
        ({"scene": {"name": "newtons_cradle", "balls": True}}, r"scene\.balls is True; allowed: a valid integer"),
        ({"scene": {"name": "newtons_cradle", "angle": "1"}}, r"scene\.angle is '1'; allowed: a valid number"),
        ({"scene": {"name": "newtons_cradle", "mass": ["a"]}}, r"scene\.mass is .*'a'.*a number or a list of numbers"),
        ({"scene": {"name": "newtons_cradle", "mass": [1.0, float("nan")]}}, r"scene\.mass\.1 is nan"),
        ({"scene": {"name": "spring_sphere", "start": "rough"}}, r"scene: start of spring_sphere: found 'rough'"),
        ({"scene": "point_mass", "method": "gvo"}, r"method\.name is 'gvo'; did you mean 'gvi'\? allowed: gvi, "),
        (
            {"scene": "point_mass", "method": {"name": "gvi", "scheme": "midpont"}},
            r"method\.scheme is 'midpont'; did you mean 'midpoint'\? allowed: midpoint, verlet",
        ),
        (
            {"scene": "point_mass", "method": {"name": "discrete_smooth", "reflection": "moreau"}},
            r"method\.reflection is an unknown key; allowed: name, scheme",
        ),
        (
            {"scene": "point_mass", "method": {"name": "gvi", "order": "slowest"}},
            r"method\.order is 'slowest'; .*allowed: index, fastest",
        ),
        (
            {"scene": "point_mass", "method": {"name": "gvi", "order": "fastest"}},
            r"method: GVI: order 'fastest' is for reflection 'sequential', .*; reflection is 'generalized'",
        ),
        (
            {"scene": "point_mass", "solvers": "clarabell"},
            r"solvers\.default\.backend is 'clarabell'; did you mean 'clarabel'\? allowed: auto, clarabel",
        ),
        (
            {"scene": "point_mass", "solvers": {"projection": {"backend": "os.system"}}},
            r"solvers\.projection\.backend is 'os\.system'",
        ),
        (
            {"scene": "point_mass", "solvers": {"reflecton": "daqp"}},
            r"solvers\.reflecton is an unknown key; did you mean 'reflection'\? allowed: default, reflection",
        ),
        (
            {"scene": "point_mass", "solvers": {"position": {"tolerance": 2.0}}},
            r"solvers\.position\.tolerance is 2\.0; allowed: less than 1",
        ),
        ({"scene": "point_mass", "step_size": 0.0}, r"step_size is 0\.0; allowed: greater than 0"),
        ({"scene": "point_mass", "step_size": float("nan")}, r"step_size is nan; allowed: finite numbers"),
        ({"scene": "point_mass", "stepsize": 0.1}, r"stepsize is an unknown key; did you mean 'step_size'\?"),
        ({"scene": "point_mass", "steps": 10, "duration": 1.0}, r"steps is 10 and duration is 1\.0; give one"),
        ({"scene": "point_mass", "steps": 10.0}, r"steps is 10\.0; allowed: a valid integer"),
        ({"scene": "point_mass", "record": {"every": 0}}, r"record\.every is 0; allowed: greater than or equal to 1"),
        ({"scene": "point_mass", "record": {"evry": 1}}, r"record\.evry is an unknown key; did you mean 'every'\?"),
        ({"scene": "point_mass", "skip": "no"}, r"skip is 'no'; allowed: a valid boolean"),
        ({"scene": "point_mass", "step_size": 0.03, "duration": 1.0}, r"nearest allowed values are 0\.99"),
    ],
)
def test_refusals_name_the_key_what_was_found_and_what_is_allowed(table, message):
    with pytest.raises(InputError, match=message):
        parse(table).plan()


def test_all_faults_are_named_at_once():
    with pytest.raises(InputError, match=r"step_size is -1\.0.*skip is 3"):
        parse({"scene": "point_mass", "step_size": -1.0, "skip": 3})


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("step_size=0.05", ("step_size",), 0.05),
        ("scene.stiffness = 30.0", ("scene", "stiffness"), 30.0),
        ("scene.position=[5.0, 0.5]", ("scene", "position"), [5.0, 0.5]),
        ("method.scheme=midpoint", ("method", "scheme"), "midpoint"),
        ('method.scheme="midpoint"', ("method", "scheme"), "midpoint"),
        ("skip=false", ("skip",), False),
        ("record.output=runs/pogo-2.nc", ("record", "output"), "runs/pogo-2.nc"),
        ("solvers.default=daqp", ("solvers", "default", "backend"), "daqp"),
        ("solvers.reflection.tolerance=1e-8", ("solvers", "reflection", "tolerance"), 1e-8),
        ("solvers=daqp", ("solvers", "default", "backend"), "daqp"),
        ("method=discrete_smooth", ("method", "name"), "discrete_smooth"),
    ],
)
def test_overrides(tmp_path, override, path, value):
    (tmp_path / "pogo.toml").write_text(POGO.replace('energy = "numerical"\n', ""))
    found = load(tmp_path / "pogo.toml", [override]).table
    for key in path:
        found = found[key]
    assert found == value


def test_steps_replace_duration_and_the_other_way_round(tmp_path):
    (tmp_path / "pogo.toml").write_text(POGO)
    assert load(tmp_path / "pogo.toml", ["steps=7"]).plan().steps == 7
    assert load(tmp_path / "pogo.toml", ["steps=7", "duration=0.5"]).plan().steps == 5


def test_another_scene_does_not_inherit_parameters(tmp_path):
    (tmp_path / "pogo.toml").write_text(POGO)
    table = load(tmp_path / "pogo.toml", ["scene=newtons_cradle", "scene.balls=3"]).table
    assert table["scene"] == {"name": "newtons_cradle", "balls": 3}


def test_a_choice_without_a_backend_refines_the_default():
    config = parse({"scene": "point_mass", "solvers": "osqp"}, ["solvers.position.tolerance=1e-10"])
    assert config.plan().config()["solvers"]["position"]["backend"] == "osqp"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("step_size", "expected key=value"),
        ("=3", "expected key=value"),
        ("scene..balls=3", "expected key=value"),
        ("step_size.size=3", r"step_size is 0\.1, not a table"),
        ("skip=[1,", "neither a TOML value nor a bare word"),
        ("skip=true\nstep_size=3", "more than one value"),
        ("scene.name=__import__('os')", "neither a TOML value nor a bare word"),
    ],
)
def test_refused_overrides(tmp_path, override, message):
    (tmp_path / "pogo.toml").write_text(POGO)
    with pytest.raises(InputError, match=message):
        load(tmp_path / "pogo.toml", [override])


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "no.toml")
    (tmp_path / "bad.toml").write_text("step_size = = 3")
    with pytest.raises(InputError, match=r"bad\.toml is not valid TOML"):
        load(tmp_path / "bad.toml")
    (tmp_path / "binary.toml").write_bytes(os.urandom(8) + b"\xff\xfe")
    with pytest.raises(InputError, match=r"binary\.toml"):
        load(tmp_path / "binary.toml")


def test_the_input_table_is_not_changed():
    table = {"scene": {"name": "point_mass"}, "solvers": {"default": "daqp"}}
    parse(table, ["scene.mass=2.0", "solvers.default=osqp"])
    assert table == {"scene": {"name": "point_mass"}, "solvers": {"default": "daqp"}}


def test_models_cover_scenes_and_methods():
    for name in deli.scenes.available():
        assert set(deli.scenes.get(name)().parameters) < set(scene_model(deli.scenes.get(name)).model_fields)
    for method in METHODS.values():
        fields = {field.name: field.default for field in dataclasses.fields(method)}
        assert set(method_model(method).model_fields) == {"name", *fields}
        assert {key for key, default in fields.items() if isinstance(default, str)} <= set(method.CHOICES)
