import inspect
import math
import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from deli import InputError, Scene, scenes
from deli.mechanics.energies import hamiltonian
from deli.mechanics.schemes import get_scheme
from deli.mechanics.symmetry import angular_momentum

SETTINGS = settings(max_examples=25, deadline=None)
NAMES = [
    "lennard_jones",
    "newtons_cradle",
    "nonlinear_oscillator",
    "pogo_stick",
    "point_mass",
    "quartic_wall",
    "spring_sphere",
    "wedge",
]
MANY = ["chain_on_cylinder", "disc_pile", "granular_chain", "hard_rods", "hard_sphere_gas"]
every_scene = pytest.mark.parametrize("name", NAMES)


def energy(scene):
    return hamiltonian(scene, scene.position, scene.momentum)


def same(one, other):
    """Whether two scenes start alike and feel the same forces and constraints a little off their start."""
    off = one.position + 0.01 * np.sin(np.arange(one.dof))
    return (
        one.dof == other.dof
        and all(np.array_equal(getattr(one, key), getattr(other, key)) for key in ("mass", "position", "momentum"))
        and np.array_equal(one.potential.gradient(off), other.potential.gradient(off))
        and np.array_equal(one.unilateral.value(off), other.unilateral.value(off))
        and np.array_equal(one.bilateral.value(off), other.bilateral.value(off))
    )


def test_the_registry_knows_the_scenes():
    assert sorted(scenes.available()) == sorted(NAMES + MANY)
    for name in NAMES + MANY:
        assert scenes.get(name) is getattr(scenes, name)


@every_scene
def test_a_scene_starts_admissible(name):
    scene = scenes.get(name)()
    velocity = scene.momentum / scene.mass
    assert isinstance(scene, Scene)
    assert scene.unilateral.rows > 0
    assert scene.unilateral.value(scene.position).min() >= -1e-15
    np.testing.assert_allclose(scene.bilateral.value(scene.position), 0.0, atol=1e-15)
    np.testing.assert_allclose(scene.bilateral.jacobian(scene.position) @ velocity, 0.0, atol=1e-15)


@every_scene
def test_a_scene_is_made_again_from_what_it_records(name):
    scene = scenes.get(name)()
    assert scene.name == name
    recorded = tomllib.loads(tomli_w.dumps(scene.parameters))
    assert recorded == scene.parameters
    again = scenes.get(name)(**recorded)
    assert same(again, scene)
    assert again.parameters == scene.parameters


@every_scene
def test_every_number_is_a_keyword_that_changes_the_scene(name):
    build = scenes.get(name)
    scene = build()
    numbers = {key: value for key, value in scene.parameters.items() if not isinstance(value, str | list)}
    assert len(numbers) >= 4
    for key, value in numbers.items():
        changed = build(**{key: value + 1 if isinstance(value, int) else 1.03 * value + 0.001})
        assert not same(changed, scene), key
        assert changed.parameters[key] != value


@every_scene
def test_start_can_be_given(name):
    scene = scenes.get(name)()
    if "position" not in inspect.signature(scenes.get(name)).parameters:
        assert name == "newtons_cradle"
        return
    start = {"position": scene.position.reshape(scene.bodies, -1), "momentum": 0.5 * scene.momentum}
    again = scenes.get(name)(**start)
    np.testing.assert_array_equal(again.position, scene.position)
    np.testing.assert_array_equal(again.momentum, 0.5 * scene.momentum)
    assert again.parameters["position"] == start["position"].tolist()


@every_scene
def test_defaults_are_how_the_paper_runs_it(name):
    defaults = scenes.defaults(name)
    assert set(defaults) == {"step_size", "duration", "scheme"}
    assert 0 < defaults["step_size"] < defaults["duration"]
    get_scheme(defaults["scheme"])
    defaults["scheme"] = "changed"
    assert scenes.defaults(name)["scheme"] != "changed"


@pytest.mark.parametrize(
    ("name", "step_size", "duration", "scheme"),
    [
        ("pogo_stick", 0.1, 1000.0, "verlet"),
        ("spring_sphere", 0.5, 1000.0, "midpoint"),
        ("nonlinear_oscillator", 0.1, 300.0, "midpoint"),
        ("newtons_cradle", 0.01, 60.0, "midpoint"),
        ("lennard_jones", 0.01, 2000.0, "verlet"),
    ],
)
def test_defaults_in_numbers(name, step_size, duration, scheme):
    assert scenes.defaults(name) == {"step_size": step_size, "duration": duration, "scheme": scheme}


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (scenes.point_mass(), 9.8),
        (scenes.pogo_stick(), 68.6),
        (scenes.spring_sphere(), 6.0),
        (scenes.spring_sphere(start="mixed"), 1.0 + 50.0 / 17.0 + 2.0 + 0.5 * (math.sqrt(10.0) - math.sqrt(8.0)) ** 2),
        (scenes.nonlinear_oscillator(), 1.0 + 2.0 * 1.4**2 * (1.4**2 - 1.0) ** 2),
        (scenes.quartic_wall(), 0.25),
        (scenes.quartic_wall(mass=2.0, stiffness=3.0, position=2.0, momentum=1.0), 0.25 + 12.0),
        (scenes.newtons_cradle(), -9.8 * (3.0 + 2.0 * math.cos(math.pi / 5.0))),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_initial_energy(scene, expected):
    assert energy(scene) == pytest.approx(expected, rel=1e-14)


def test_initial_energies_as_printed():
    assert round(energy(scenes.spring_sphere(start="mixed")), 1) == 6.0
    assert round(energy(scenes.nonlinear_oscillator()), 3) == 4.613


@SETTINGS
@given(top=st.floats(1.0, 9.0), bottom=st.floats(0.0, 0.9))
def test_pogo_stick_energy_is_the_paper_s(top, bottom):
    scene = scenes.pogo_stick(position=[top, bottom], momentum=[1.0, -2.0])
    assert energy(scene) == pytest.approx(2.5 + 9.8 * (top + bottom) + 5.0 * (abs(top - bottom) - 5.0) ** 2, rel=1e-13)
    np.testing.assert_array_equal(scene.unilateral.value(scene.position), [bottom])


def test_the_wall_of_quartic_wall_can_be_moved():
    np.testing.assert_array_equal(scenes.quartic_wall().unilateral.value(np.array([0.5])), [0.5])
    scene = scenes.quartic_wall(wall=-2.0)
    np.testing.assert_array_equal(scene.unilateral.value(np.array([0.5])), [2.5])
    with pytest.raises(InputError, match="quartic_wall"):
        scenes.quartic_wall(stiffness="hard")


@pytest.mark.parametrize(
    ("start", "first", "gaps"), [("smooth", (4, -3), (0, 0)), ("mixed", (4, -1), (5 - 17**0.5, 0))]
)
def test_spring_sphere_starts_of_the_paper(start, first, gaps):
    scene = scenes.spring_sphere(start=start)
    x, p = scene.position.reshape(2, 2), scene.momentum.reshape(2, 2)
    np.testing.assert_allclose(x, [first, (3, -4)], rtol=1e-15)
    np.testing.assert_allclose(scene.unilateral.value(scene.position), gaps, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(p, axis=1), 1.0, rtol=1e-15)
    np.testing.assert_allclose((x * p).sum(axis=1), 0.0, atol=1e-15)
    assert (np.cross(np.pad(x, ((0, 0), (0, 1))), np.pad(p, ((0, 0), (0, 1))))[:, 2] > 0).all()


def test_spring_sphere_starts_scale_with_the_radius():
    scene = scenes.spring_sphere(radius=2.0)
    np.testing.assert_allclose(scene.unilateral.value(scene.position), 0.0, atol=1e-15)


def test_nonlinear_oscillator_turns_counterclockwise():
    scene = scenes.nonlinear_oscillator()
    np.testing.assert_array_equal(scene.position, [0.0, -1.4, 0.0, 1.4])
    assert angular_momentum(scene, scene.position, scene.momentum) == 2.8
    np.testing.assert_allclose(scene.unilateral.value(scene.position), [0.8])


@SETTINGS
@given(
    balls=st.integers(1, 9),
    pulled=st.integers(0, 9),
    angle=st.floats(-1.5, 0.0),
    radius=st.floats(0.01, 3.0),
    length=st.floats(0.1, 5.0),
)
def test_cradle_balls_touch_their_neighbours_except_where_the_row_is_parted(balls, pulled, angle, radius, length):
    if pulled > balls:
        with pytest.raises(InputError, match=rf"pulled of newtons_cradle: found {pulled}; there are {balls} balls"):
            scenes.newtons_cradle(balls=balls, pulled=pulled)
        return
    scene = scenes.newtons_cradle(balls=balls, pulled=pulled, angle=angle, radius=radius, length=length)
    scale = scene.length_scale
    gaps = scene.unilateral.value(scene.position)
    assert gaps.shape == (balls - 1,)
    np.testing.assert_allclose(np.delete(gaps, pulled - 1) if 0 < pulled < balls else gaps, 0.0, atol=1e-14 * scale)
    if 0 < pulled < balls and angle < -0.1:
        assert gaps[pulled - 1] > 1e-3 * min(radius, length)
    np.testing.assert_allclose(scene.bilateral.value(scene.position), 0.0, atol=1e-14 * scale)
    np.testing.assert_array_equal(scene.momentum, 0.0)


def test_a_cradle_pulled_to_the_right_would_overlap():
    with pytest.raises(
        InputError, match=r"unilateral constraint 1 \(gap body 1 - body 2\) has value -0\.\d+ at the start"
    ):
        scenes.newtons_cradle(angle=math.pi / 5.0)


def test_lennard_jones_chain_of_the_paper():
    scene = scenes.lennard_jones()
    assert (scene.dof, scene.unilateral.rows, scene.bilateral.rows) == (18, 15 + 6, 5)
    x = scene.position.reshape(6, 3)
    np.testing.assert_allclose(np.linalg.norm(np.diff(x, axis=0), axis=1), 1.0, rtol=1e-15)
    gaps = scene.unilateral.value(scene.position)
    np.testing.assert_allclose(gaps[0], np.linalg.norm(x[0] - x[1]) - 0.6, rtol=1e-15)
    np.testing.assert_allclose(gaps[15:], 4.7 - np.linalg.norm(x, axis=1), rtol=1e-15)
    assert gaps.min() > 0.1
    assert np.abs(angular_momentum(scene, scene.position, scene.momentum)).min() > 0.1


@SETTINGS
@given(
    spheres=st.integers(2, 9),
    turn=st.floats(0.8, 3.0),
    rise=st.floats(-0.6, -0.15) | st.floats(0.15, 0.6),  # a flatter helix may come round to its own spheres
    masses=st.lists(st.floats(0.1, 10.0), min_size=9, max_size=9),
)
def test_lennard_jones_momenta_stretch_no_rod(spheres, turn, rise, masses):
    scene = scenes.lennard_jones(
        spheres=spheres, turn=turn, rise=rise, mass=masses[:spheres], radius=0.01, container=50.0
    )
    velocity = scene.momentum / scene.mass
    rate = scene.bilateral.jacobian(scene.position) @ velocity
    np.testing.assert_allclose(rate, 0.0, atol=1e-12 * np.linalg.norm(velocity))
    assert np.linalg.norm(velocity) > 0.1
