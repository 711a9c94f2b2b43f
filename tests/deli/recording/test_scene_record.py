"""The scene in a run's attributes: any number of it that changes is noticed and named, and no other scene goes on."""

import dataclasses
import logging
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import H, assert_same

import deli
from deli.errors import InputError
from deli.recording.provenance import SOFTWARE

BODIES = 4
POTENTIALS = [
    (deli.Gravity, {"acceleration": [0.5, -9.8]}),
    (deli.Springs, {"pairs": [(0, 1), (2, 3)], "stiffness": [2.0, 3.0], "rest_length": [0.5, 0.25]}),
    (deli.LennardJones, {"epsilon": [0.5, 0.75], "sigma": [0.8, 0.9], "pairs": [(0, 2), (1, 3)]}),
    (deli.RadialPowers, {"coefficients": [1.0, 2.0], "exponents": [2.0, 4.0], "bodies": [0, 1], "centre": [0.1, 0.2]}),
]
UNILATERAL = [
    (deli.Planes, {"normals": [[0.0, 1.0], [0.0, 2.0]], "offsets": [-5.0, -6.0], "bodies": [0, 1]}),
    (deli.SpheresApart, {"pairs": [(0, 1), (2, 3)], "distance": [0.4, 0.5], "period": [20.0, 30.0]}),
    (deli.SpheresInside, {"radius": [40.0, 50.0], "centre": [0.1, 0.2], "bodies": [0, 1]}),
    (deli.SpheresOutside, {"radius": [0.1, 0.2], "centre": [-9.0, -8.0], "bodies": [0, 1]}),
]
BILATERAL = [
    (deli.Rods, {"pairs": [(0, 1), (2, 3)], "length": [1.0, 1.0]}),
    (deli.AnchoredRods, {"pivots": [[1.0, 1.0], [1.0, 1.0]], "length": [2**0.5, 2**0.5], "bodies": [0, 2]}),
]
SIDES = {"potential": POTENTIALS, "unilateral": UNILATERAL, "bilateral": BILATERAL}
STATE = {
    "mass": [1.0, 2.0, 3.0, 4.0],
    "position": [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]],
    "momentum": [[0.0, 0.0]] * BODIES,
}
PLACES = [(name, None, None) for name in STATE] + [
    (side, number, field)
    for side, families in SIDES.items()
    for number, (_, fields) in enumerate(families)
    for field in fields
]


def build(change=None, state=STATE, sides=SIDES):
    """A scene of every family; `change` maps a place to the array that stands there instead."""
    change = change or {}
    arrays = {name: change.get((name, None, None), value) for name, value in state.items()}
    families = {
        side: [
            kind(**{field: change.get((side, number, field), value) for field, value in fields.items()})
            for number, (kind, fields) in enumerate(listed)
        ]
        for side, listed in sides.items()
    }
    return deli.Scene(**arrays, **families, dimension=2)


def record_of(scene, **arguments):
    return deli.simulate(scene, deli.GVI(), step_size=1e-3, steps=1, **arguments).attrs


@pytest.fixture(scope="module")
def recorded():
    """Attributes of a run of the scene of every family."""
    return record_of(build())


def original(place):
    side, number, field = place
    return np.array(STATE[side] if number is None else SIDES[side][number][1][field])


def test_every_family_of_deli_is_among_those_changed():
    from deli.mechanics.family import Family

    public = {getattr(deli, name) for name in deli.__all__}
    families = {one for one in public if isinstance(one, type) and issubclass(one, Family)}
    listed = {kind for families in SIDES.values() for kind, _ in families}
    assert listed | {deli.Potential, deli.Constraints} == families
    for kind in listed:
        fields = {field.name for field in dataclasses.fields(kind) if field.init} - {"layout"}
        assert fields == next(set(given) for listed in SIDES.values() for one, given in listed if one is kind)


@given(place=st.sampled_from(PLACES), data=st.data())
def test_any_number_that_changes_is_noticed_and_named(recorded, place, data):
    from deli.mechanics.content import scene_digest
    from deli.recording.scene_record import differing

    values = original(place)
    entry = data.draw(st.integers(0, values.size - 1))
    if values.dtype.kind == "f":
        values.flat[entry] = np.nextafter(values.flat[entry], data.draw(st.sampled_from([-np.inf, np.inf])))
    else:
        pair = np.unravel_index(entry, values.shape)[0] if values.ndim == 2 else slice(None)
        values[pair] = values[pair][::-1]  # the same bodies in another order
    changed = build({place: values.tolist()})
    assert scene_digest(changed) != recorded["scene_digest"]
    side, number, field = place
    kind = "" if number is None else type(getattr(changed, side).families[number]).__name__
    named = side if number is None else f"{field} of {kind} ({side} {number})"
    assert [found.split(" is ")[0] for found in differing(recorded, changed)] == [named]


@given(side=st.sampled_from(list(SIDES)), data=st.data())
def test_a_family_more_or_less_or_in_another_place_is_noticed(recorded, side, data):
    from deli.mechanics.content import scene_digest
    from deli.recording.scene_record import differing

    listed = SIDES[side]
    order = data.draw(st.permutations(listed))
    chosen = order[: data.draw(st.integers(0, len(listed)))]
    scene = build(sides={**SIDES, side: chosen})
    same = chosen == listed
    assert (scene_digest(scene) == recorded["scene_digest"]) == same
    assert (differing(recorded, scene) == []) == same


def test_the_same_scene_has_the_same_digest_whoever_computes_it():
    code = (
        "import deli; from deli.mechanics.content import scene_digest\n"
        "print(scene_digest(deli.scenes.newtons_cradle(balls=3)))"
    )
    scene = deli.scenes.newtons_cradle(balls=3)
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    attributes = record_of(scene)
    assert attributes["scene_digest"] == found
    renamed = dataclasses.replace(scene, name="another", parameters={"note": "the same numbers"})
    assert record_of(renamed)["scene_digest"] == found


class TestFunctions:
    """Functions in Python are compared by their values and derivatives at some states."""

    @staticmethod
    def scene(stiffness=1.0, radius=2.0, hessian=1.0):
        potential = deli.Potential(
            lambda q: 0.5 * stiffness * q @ q,
            lambda q: stiffness * q,
            lambda q: hessian * stiffness * np.eye(q.size) if (q != [0.0, 1.0]).any() else stiffness * np.eye(q.size),
        )
        inside = deli.Constraints(lambda q: np.array([radius**2 - q @ q]), lambda q: -2.0 * q[None])
        return deli.Scene(1.0, [0.0, 1.0], [0.0, 0.0], potential, unilateral=inside, dimension=2)

    @pytest.mark.parametrize(
        ("change", "named"),
        [
            ({"stiffness": 1.0 + 1e-6}, "energy of Potential (potential 0)"),
            ({"stiffness": 1.0 + 1e-6}, "slope of Potential (potential 0)"),
            ({"hessian": 1.0 + 1e-6}, "curvature of Potential (potential 0)"),
            ({"radius": 2.0 + 1e-6}, "value of Constraints (unilateral 0)"),
        ],
    )
    def test_other_functions_are_noticed(self, tmp_path, change, named, caplog):
        path = tmp_path / "run.nc"
        digest = record_of(self.scene(), output=path)["scene_digest"]
        assert record_of(self.scene(), output=path, resume=True)["scene_digest"] == digest
        assert "goes on with Potential (potential 0), Constraints (unilateral 0): functions in Python" in caplog.text
        with pytest.raises(InputError) as refusal:
            record_of(self.scene(**change), output=path, resume=True)
        assert f"{named} at 4 states is" in str(refusal.value)
        assert record_of(self.scene(**change))["scene_digest"] != digest

    def test_rounding_is_no_other_function(self, tmp_path):
        path = tmp_path / "run.nc"
        record_of(self.scene(), output=path)
        assert record_of(self.scene(stiffness=1.0 + 4e-16), output=path, resume=True)["outcome"] == "complete"

    def test_states_where_a_function_is_not_defined(self, tmp_path):
        def energy(q):
            if abs(q[0] - 1.0) > 1e-4:
                raise ValueError("not there")
            return 0.0

        scene = deli.Scene(1.0, [1.0], [0.0], deli.Potential(energy, lambda q: np.zeros(1)))
        table = tomllib.loads(deli.simulate(scene, deli.GVI(), step_size=H, steps=1).attrs["scene"])
        found = table["potential"][0]["samples"]
        np.testing.assert_array_equal(found["energy"], [0.0, 0.0, np.nan, np.nan])

    def test_the_attribute_says_that_this_is_all(self):
        first = record_of(self.scene())["scene"].splitlines()[0]
        assert first.startswith("# Potential (potential 0), Constraints (unilateral 0): functions in Python")
        assert not record_of(build())["scene"].startswith("#")


class TestRecorded:
    def test_numbers_of_families_are_in_the_file(self, tmp_path):
        record_of(build(), output=tmp_path / "run.nc")
        table = tomllib.loads(deli.open_run(tmp_path / "run.nc").attrs["scene"])
        assert table["mass"] == np.repeat(STATE["mass"], 2).tolist()
        for side, families in SIDES.items():
            for found, (kind, fields) in zip(table[side], families, strict=True):
                assert found.pop("kind") == kind.__name__
                assert found == {name: np.array(value).tolist() for name, value in fields.items()}

    def test_large_arrays_are_there_by_shape_and_digest(self):
        bodies = 1000
        position = np.stack([np.arange(bodies), np.zeros(bodies)], axis=1)
        pairs = np.stack([np.arange(bodies - 1), np.arange(1, bodies)], axis=1)
        springs = deli.Springs(pairs=pairs, stiffness=1.0)
        scene = deli.Scene(1.0, position, 0.0 * position, springs, dimension=2, parameters={"series": np.arange(500.0)})
        text = record_of(scene)["scene"]
        assert len(text) < 2000
        table = tomllib.loads(text)
        assert table["potential"][0]["pairs"]["shape"] == [bodies - 1, 2]
        assert table["position"]["shape"] == [2 * bodies]
        assert table["parameters"]["series"]["shape"] == [500]
        position[-1, 0] = np.nextafter(position[-1, 0], 0.0)
        moved = deli.Scene(1.0, position, 0.0 * position, springs, dimension=2)
        assert tomllib.loads(record_of(moved)["scene"])["position"]["sha256"] != table["position"]["sha256"]

    def test_parameters(self, tmp_path):
        given = {"name": "schön", "n": 3, "on": True, "x": np.float64(0.1), "list": [1, 2], "mixed": ["a", 1]}
        given |= {"table": {"deep": np.eye(2)}, "left out": None}
        scene = deli.Scene(1.0, [0.0], [1.0], parameters=given)
        record_of(scene, output=tmp_path / "run.nc")
        attributes = deli.open_run(tmp_path / "run.nc").attrs
        assert tomllib.loads(attributes["scene"])["parameters"] == {
            "name": "schön", "n": 3, "on": True, "x": 0.1, "list": [1, 2], "mixed": ["a", 1],
            "table": {"deep": [[1.0, 0.0], [0.0, 1.0]]},
        }  # fmt: skip
        with pytest.raises(InputError, match="parameter n is 3 there and 4 now"):
            record_of(
                deli.Scene(1.0, [0.0], [1.0], parameters={**given, "n": 4}), output=tmp_path / "run.nc", resume=True
            )

    @pytest.mark.parametrize("value", [print, 1j, {1: 2}, [None], "\ud800", np.array(["a"]), {"a": {"b": object()}}])
    def test_parameters_that_cannot_be_recorded(self, value):
        with pytest.raises(InputError, match=r"^parameters\.key"):
            deli.Scene(1.0, [0.0], [1.0], parameters={"key": value})

    def test_a_registered_name_with_parameters_of_ones_own(self):
        scene = deli.Scene(1.0, [0.0], [1.0], name="newtons_cradle", parameters={"stiffness": 3.0})
        attributes = record_of(scene)
        assert tomllib.loads(attributes["config"])["scene"] == {"name": "custom", "label": "newtons_cradle"}
        assert tomllib.loads(attributes["scene"])["parameters"] == {"stiffness": 3.0}

    def test_a_registered_scene_with_a_force_that_is_zero_at_the_start(self):
        plain = deli.scenes.newtons_cradle(balls=2, pulled=1)
        distance = float(np.linalg.norm(np.diff(plain.position.reshape(2, 2), axis=0)))
        springs = [*plain.potential.families, deli.Springs(pairs=[(0, 1)], stiffness=5.0, rest_length=distance)]
        attributes = record_of(dataclasses.replace(plain, potential=springs))
        assert tomllib.loads(attributes["config"])["scene"]["name"] == "custom"


def interrupted(path, at_step, **arguments):
    """Leave a partial file of two steps."""

    def stop(take):
        raise KeyboardInterrupt

    at_step(3, stop)
    with pytest.raises(deli.Interrupted):
        deli.simulate(output=path, **arguments)
    at_step.restore()


def springs(stiffness):
    return deli.Scene(
        mass=1.0,
        position=[[0.0, 0.0], [1.0, 0.0]],
        momentum=[[0.0, 1.0], [0.0, -1.0]],
        dimension=2,
        potential=deli.Springs(pairs=[(0, 1)], stiffness=stiffness, rest_length=1.0),  # no force at the start
    )


@pytest.mark.parametrize("finished", [False, True])
def test_no_other_scene_goes_on_and_the_file_is_kept(tmp_path, at_step, finished):
    path, run = tmp_path / "run.nc", {"method": deli.GVI(), "step_size": H, "steps": 5}
    if finished:
        deli.simulate(springs(10.0), output=path, **run)
    else:
        interrupted(path, at_step, scene=springs(10.0), **run)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(InputError, match=r"stiffness of Springs \(potential 0\) is 10.0 there and 1000.0 now"):
        deli.simulate(springs(1000.0), output=path, resume=True, **run)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before
    resumed = deli.simulate(springs(10.0), output=path, resume=True, **run)
    assert_same(resumed, deli.simulate(springs(10.0), **run))


BASE = {"step_size": H, "steps": 5, "every": 2, "method": deli.GVI(), "solvers": "daqp"}
SETTINGS = {
    "step_size": {"step_size": 2 * H},
    "steps": {"steps": 6},
    "record.every": {"every": 1},
    "record.subproblems": {"subproblems": 3},
    "skip": {"skip": False},
    "contact_tolerance": {"contact_tolerance": 1e-9},
    **{
        f"solvers.position.{key}": {"solvers": {"default": "daqp", "position": {"backend": "daqp", **change}}}
        for key, change in {
            "backend": {"backend": "piqp"},
            "tolerance": {"tolerance": 1e-8},
            "polish": {"polish": False},
            "options.iter_limit": {"options": {"iter_limit": 5000}},
        }.items()
    },
    **{
        f"method.{field}": {"method": deli.GVI(**{field: value})}
        for field, value in {
            "scheme": "verlet",
            "reflection": "sequential",
            "energy": "numerical",
            "predictor": "closed_loop",
            "linearized": True,
        }.items()
    },
    "method.order": {"method": deli.GVI(reflection="sequential", order="fastest")},
    "method.name": {"method": deli.DiscreteSmooth()},
    "solvers.reflection.warm_start": {"solvers": {"backend": "osqp", "warm_start": True}},
}


def test_every_setting_of_a_method_is_among_those_changed():
    named = {key.removeprefix("method.") for key in SETTINGS if key.startswith("method.")}
    assert named == {"name", *(field.name for field in dataclasses.fields(deli.GVI))}


@pytest.mark.parametrize("setting", SETTINGS)
def test_no_run_goes_on_with_another_setting(tmp_path, at_step, setting):
    path = tmp_path / "run.nc"
    interrupted(path, at_step, scene=springs(10.0), **BASE)
    with pytest.raises(InputError, match=f"cannot be resumed, its configuration differs: .*{setting} is "):
        deli.simulate(springs(10.0), output=path, resume=True, **{**BASE, **SETTINGS[setting]})


@pytest.mark.parametrize("key", SOFTWARE)
def test_other_software_goes_on_and_both_are_named(tmp_path, at_step, monkeypatch, caplog, key):
    from deli.recording import provenance

    path, plain = tmp_path / "run.nc", provenance.attributes
    interrupted(path, at_step, scene=springs(10.0), **BASE)
    monkeypatch.setattr(provenance, "attributes", lambda *given: plain(*given) | {key: "other 2.0"})
    with caplog.at_level(logging.WARNING, "deli"):
        run = deli.simulate(springs(10.0), output=path, resume=True, **BASE)
    before = plain({**tomllib.loads(run.attrs["config"])}, springs(10.0))[key]
    assert run.attrs[key] == f"{before}; other 2.0"
    assert f"goes on with another {key}, other 2.0 after {before}" in caplog.text


def test_a_file_that_does_not_say_which_scene_it_is_of(tmp_path, at_step):
    import netCDF4

    path = tmp_path / "run.nc"
    interrupted(path, at_step, scene=springs(10.0), **BASE)
    for change in (lambda file: file.setncattr("scene", "potential = 3"), lambda file: file.delncattr("scene")):
        with netCDF4.Dataset(f"{path}.partial", "a") as file:
            change(file)
        with pytest.raises(InputError, match="its attribute scene is missing or describes no scene"):
            deli.simulate(springs(10.0), output=path, resume=True, **BASE)
