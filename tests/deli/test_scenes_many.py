"""Scenes of many bodies: hard rods, a gas, a pile, a chain on a cylinder, a granular chain."""

import math
import time
import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from deli import InputError, Scene, scenes
from deli.figures.exact import passing_points
from deli.mechanics.schemes import get_scheme
from deli.mechanics.symmetry import linear_momentum
from deli.mechanics.tables import PAIR, table_values
from deli.plotting import shapes

SETTINGS = settings(max_examples=25, deadline=None)
NAMES = ["chain_on_cylinder", "disc_pile", "granular_chain", "hard_rods", "hard_sphere_gas"]
every_scene = pytest.mark.parametrize("name", NAMES)

SECONDS = 20.0
"""Generous: a few seconds are used."""


def from_event_to_event(scene, t):
    """Positions and velocities of hard_rods at time t, collision by collision."""
    n, size = scene.bodies, scene.parameters["size"]
    length = n * size / scene.parameters["filled"]
    ring = scene.parameters["boundary"] == "ring"
    q, v = scene.position.copy(), scene.momentum / scene.mass
    while True:
        after = q[0] + length if ring else length + 0.5 * size
        gaps = np.diff(q, append=after) - size
        speeds = np.diff(v, append=v[0] if ring else 0.0)
        if not ring:
            gaps, speeds = np.append(gaps, q[0] - 0.5 * size), np.append(speeds, v[0])
        until = np.where(speeds < -1e-13, gaps / np.minimum(speeds, -1e-13) * -1.0, np.inf)
        event = int(np.argmin(until))
        if until[event] >= t:
            return q + t * v, v
        q, t = q + until[event] * v, t - until[event]
        if event < n - 1 or (ring and event == n - 1):
            one, other = event, (event + 1) % n
            v[one], v[other] = v[other], v[one]
        else:
            end = n - 1 if event == n - 1 else 0
            v[end] = -v[end]


def contact_table(scene):
    """All contacts of a scene that are closed at the start, and their values."""
    return scene.unilateral.neighbours(scene.position, 1e-9)


@every_scene
def test_a_scene_starts_admissible(name):
    scene = scenes.get(name)()
    assert isinstance(scene, Scene)
    assert scene.name == name
    assert name in scenes.available()
    assert scene.unilateral.value(scene.position).min() >= -1e-15
    np.testing.assert_allclose(scene.bilateral.value(scene.position), 0.0, atol=1e-15)
    rate = scene.bilateral.jacobian(scene.position) @ (scene.momentum / scene.mass)
    np.testing.assert_allclose(rate, 0.0, atol=1e-15)


@every_scene
def test_a_scene_is_made_again_from_what_it_records(name):
    scene = scenes.get(name)()
    recorded = tomllib.loads(tomli_w.dumps(scene.parameters))
    assert recorded == scene.parameters
    assert same(scenes.get(name)(**recorded), scene)


@every_scene
def test_every_number_is_a_keyword_that_changes_the_scene(name):
    build = scenes.get(name)
    scene = build()
    numbers = {key: value for key, value in scene.parameters.items() if not isinstance(value, str | list)}
    assert len(numbers) >= 5
    for key, value in numbers.items():
        changed = build(**{key: value + 1 if isinstance(value, int) else 1.03 * value + 0.001})
        assert not same(changed, scene), key


def same(one, other):
    off = one.position + 0.01 * np.sin(np.arange(one.dof))
    return (
        one.dof == other.dof
        and all(np.array_equal(getattr(one, key), getattr(other, key)) for key in ("mass", "position", "momentum"))
        and np.array_equal(one.potential.gradient(off), other.potential.gradient(off))
        and np.array_equal(one.unilateral.value(off), other.unilateral.value(off))
        and np.array_equal(one.bilateral.value(off), other.bilateral.value(off))
    )


@every_scene
def test_defaults_run_a_whole_number_of_steps(name):
    defaults = scenes.defaults(name)
    get_scheme(defaults["scheme"])
    steps = defaults["duration"] / defaults["step_size"]
    assert round(steps) == pytest.approx(steps, rel=1e-12)


@SETTINGS
@given(
    rods=st.integers(2, 8),
    boundary=st.sampled_from(["walls", "ring"]),
    filled=st.floats(0.05, 0.95),
    size=st.floats(0.1, 3.0),
    seed=st.integers(0, 99),
    t=st.floats(0.0, 10.0),
)
def test_exact_hard_rods_are_those_from_event_to_event(rods, boundary, filled, size, seed, t):
    scene = scenes.hard_rods(rods=rods, boundary=boundary, filled=filled, size=size, seed=seed)
    start, position = passing_points(scene, np.array([0.0, t]))
    expected, velocities = from_event_to_event(scene, t)
    kept = np.abs if boundary == "walls" else np.asarray
    np.testing.assert_allclose(position, expected, atol=1e-10)
    np.testing.assert_allclose(np.sort(kept(velocities)), np.sort(kept(scene.momentum / scene.mass)), atol=1e-12)
    assert scene.unilateral.value(position).min() >= -1e-12
    np.testing.assert_allclose(start, scene.position, atol=1e-13)


def test_points_do_not_pass_in_another_scene():
    with pytest.raises(InputError, match="'passing_points' belongs to scene hard_rods; found point_mass"):
        passing_points(scenes.point_mass(), np.zeros(1))


@pytest.mark.parametrize("boundary", ["walls", "ring"])
def test_hard_rods_fill_their_share_of_the_line(boundary):
    scene = scenes.hard_rods(rods=4, boundary=boundary, size=2.0, filled=0.25, jitter=0.0)
    np.testing.assert_allclose(scene.position, [4.0, 12.0, 20.0, 28.0])
    gaps = {"walls": [6.0, 6.0, 6.0, 3.0, 3.0], "ring": [6.0, 6.0, 6.0, 6.0]}[boundary]
    np.testing.assert_allclose(scene.unilateral.value(scene.position), gaps)
    assert scene.symmetry.linear == (boundary == "ring",)


def test_hard_rods_start_can_be_given():
    scene = scenes.hard_rods(rods=3, position=[0.5, 2.0, 4.0], momentum=[1.0, 0.0, -1.0])
    np.testing.assert_array_equal(scene.position, [0.5, 2.0, 4.0])
    np.testing.assert_array_equal(scene.momentum, [1.0, 0.0, -1.0])


@SETTINGS
@given(
    spheres=st.integers(4, 150),
    boundary=st.sampled_from(["periodic", "walls"]),
    filled=st.floats(0.01, 0.23),
    jitter=st.floats(0.0, 0.99),
    radius=st.floats(0.1, 10.0),
    seed=st.integers(0, 9),
)
def test_spheres_of_a_gas_do_not_overlap(spheres, boundary, filled, jitter, radius, seed):
    scene = scenes.hard_sphere_gas(
        spheres=spheres, boundary=boundary, filled=filled, jitter=jitter, radius=radius, seed=seed
    )
    assert scene.unilateral.value(scene.position).min() > 0.0
    np.testing.assert_allclose(linear_momentum(scene, scene.momentum), 0.0, atol=1e-12)


@pytest.mark.parametrize("boundary", ["periodic", "walls"])
@pytest.mark.parametrize("spheres", [100, 125, 500, 1000])
def test_a_gas_can_be_dense(boundary, spheres):
    scene = scenes.hard_sphere_gas(spheres=spheres, boundary=boundary, filled=0.45, mass=2.0, temperature=3.0)
    assert scene.unilateral.neighbours(scene.position, 0.0).kind.size == scene.unilateral.rows
    side = (spheres * 4.0 / 3.0 * math.pi / 0.45) ** (1.0 / 3.0)
    if boundary == "periodic":
        np.testing.assert_allclose(scene.unilateral.neighbours(scene.position, 0.0).period, side)
    else:
        x = scene.position
        assert 1.0 <= x.min() < x.max() <= side - 1.0
    temperature = (scene.momentum**2 / scene.mass).sum() / (3 * (spheres - 1))
    assert temperature == pytest.approx(3.0, rel=4.0 / math.sqrt(1.5 * spheres))
    assert scene.symmetry.linear == (boundary == "periodic",) * 3


@pytest.mark.parametrize(("rows", "columns"), [(1, 2), (2, 2), (5, 4), (10, 10), (31, 7)])
@pytest.mark.parametrize("radius", [0.5, 0.3])
def test_a_pile_touches_everywhere_and_carries_itself(rows, columns, radius):
    scene = scenes.disc_pile(rows=rows, columns=columns, radius=radius, mass=1.7)
    discs, wide = scene.bodies, (rows + 1) // 2
    assert discs == wide * columns + (rows - wide) * (columns - 1)
    contacts = contact_table(scene)
    values = table_values(contacts, scene.position)
    touching = values <= 1e-14 * max(rows, columns)
    assert values[touching].min() >= -1e-15 * max(rows, columns)
    contacts = type(contacts)(*(column[touching] for column in contacts[:-1]), contacts.period)
    side_by_side = wide * (columns - 1) + (rows - wide) * (columns - 2)
    pairs = side_by_side + 2 * (rows - 1) * (columns - 1)
    assert (contacts.kind == PAIR).sum() == pairs
    assert contacts.kind.size == pairs + columns + 2 * wide
    _, missing = nnls(gradients_of(contacts, scene).T, scene.potential.gradient(scene.position), maxiter=100_000)
    assert missing < 1e-9 * discs
    np.testing.assert_array_equal(scene.momentum, 0.0)


def gradients_of(rows, scene):
    """Dense gradients of a scene's contacts, one a row."""
    x = scene.position.reshape(scene.bodies, -1)
    gradients = np.zeros((rows.kind.size, *x.shape))
    for k, (kind, i, j) in enumerate(zip(rows.kind, rows.first, rows.second, strict=True)):
        direction = (x[i] - x[j]) / np.linalg.norm(x[i] - x[j]) if kind == PAIR else rows.vector[k]
        gradients[k, i] += direction
        if kind == PAIR:
            gradients[k, j] -= direction
    return gradients.reshape(rows.kind.size, -1)


@SETTINGS
@given(
    masses=st.integers(2, 60),
    arc=st.floats(0.1, 2.0),
    shift=st.floats(-0.5, 0.5),
    radius=st.floats(0.1, 5.0),
    speed=st.floats(-1.0, 1.0),
)
@example(masses=4, arc=2.0, shift=0.0, radius=1.0, speed=5e-324)
def test_a_chain_starts_on_the_cylinder_and_moves_along_it(masses, arc, shift, radius, speed):
    scene = scenes.chain_on_cylinder(masses=masses, arc=arc, shift=shift, radius=radius, speed=speed, mass=2.0)
    q, v = scene.position, scene.momentum / scene.mass
    np.testing.assert_allclose(scene.unilateral.value(q), 0.0, atol=4e-16 * max(radius, 1.0))
    np.testing.assert_allclose(scene.unilateral.jacobian(q) @ v, 0.0, atol=4e-16)
    np.testing.assert_allclose(scene.bilateral.value(q), 0.0, atol=1e-15 * max(radius, 1.0))
    np.testing.assert_allclose(scene.bilateral.jacobian(q) @ v, 0.0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(v.reshape(-1, 2), axis=1), abs(speed), atol=1e-15)
    assert q[1::2].min() > 0.0


def test_a_chain_with_its_middle_on_the_top_is_in_equilibrium():
    scene = scenes.chain_on_cylinder(shift=0.0)
    q = scene.position
    rods = scene.bilateral.jacobian(q)
    pushes = np.concatenate([scene.unilateral.jacobian(q), rods, -rods])
    assert nnls(pushes.T, scene.potential.gradient(q))[1] < 1e-12
    q = scenes.chain_on_cylinder(shift=0.1).position
    assert nnls(pushes.T, scene.potential.gradient(q))[1] < 1e-12 < abs(q - scene.position).max()


@pytest.mark.parametrize("masses", ["random", "alternating"])
def test_beads_touch_and_the_first_one_strikes(masses):
    scene = scenes.granular_chain(beads=50, masses=masses, light=0.5, heavy=3.0, radius=0.3, speed=2.0)
    np.testing.assert_allclose(scene.unilateral.value(scene.position), 0.0, atol=1e-14)
    np.testing.assert_array_equal(scene.momentum / scene.mass, [2.0] + 49 * [0.0])
    assert scene.mass.min() >= 0.5
    assert scene.mass.max() <= 3.0
    assert (masses == "alternating") == (np.unique(scene.mass).size == 2)
    assert scene.symmetry.linear == (True,)
    apart = scenes.granular_chain(beads=3, gap=0.25, mass=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal(apart.mass, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(apart.unilateral.value(apart.position), [0.25, 0.0])


@pytest.mark.parametrize(
    ("name", "parameters", "bodies"),
    [
        ("hard_rods", {"rods": 100_000}, 100_000),
        ("hard_rods", {"rods": 100_000, "boundary": "ring"}, 100_000),
        ("hard_sphere_gas", {"spheres": 100_000}, 100_000),
        ("hard_sphere_gas", {"spheres": 100_000, "boundary": "walls"}, 100_000),
        ("disc_pile", {"rows": 100, "columns": 101}, 10_050),
        ("chain_on_cylinder", {"masses": 10_000}, 10_000),
        ("granular_chain", {"beads": 10_000}, 10_000),
    ],
)
def test_large_scenes_are_made_quickly(name, parameters, bodies):
    start = time.perf_counter()
    scene = scenes.get(name)(**parameters)
    assert time.perf_counter() - start < SECONDS
    assert scene.bodies == bodies


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("hard_rods", {"boundary": "open"}, r"boundary of hard_rods: found 'open'; choose one of 'walls', 'ring'"),
        ("hard_rods", {"filled": 1.0}, r"filled of hard_rods: found 1.0; it must be > 0 and < 1"),
        ("hard_rods", {"jitter": 1.0}, r"jitter of hard_rods: found 1.0; it must be >= 0 and < 1"),
        ("hard_rods", {"rods": 1}, r"rods of hard_rods: found 1; it must be >= 2"),
        (
            "hard_sphere_gas",
            {"filled": 0.7},
            r"filled of hard_sphere_gas: found 0.7, which leaves no room to place",
        ),
        ("hard_sphere_gas", {"spheres": 2, "filled": 0.2}, r"cube of side 3.47 radii; take a smaller share"),
        ("disc_pile", {"columns": 1}, r"columns of disc_pile: found 1; it must be >= 2"),
        ("chain_on_cylinder", {"arc": 3.0}, r"found arc 3.0 and shift 0.1; \|shift\| \+ arc/2 must be < pi/2"),
        ("granular_chain", {"gap": -0.1}, r"gap of granular_chain: found -0.1; it must be >= 0"),
        ("granular_chain", {"masses": "equal"}, r"masses of granular_chain: found 'equal'; choose one of 'random'"),
        ("granular_chain", {"mass": [1.0, 2.0]}, r"mass: found shape \(2,\); pass one number, one for each of 20"),
    ],
)
def test_bad_parameters_are_refused_with_what_to_do(name, parameters, message):
    with pytest.raises(InputError, match=message):
        scenes.get(name)(**parameters)


def test_shapes_of_many_bodies_and_of_an_obstacle():
    gas = scenes.hard_sphere_gas(spheres=300, radius=0.7)
    assert gas.unilateral.searched
    np.testing.assert_array_equal(shapes.radii(gas), 0.7)
    ((centre, radius),) = shapes.containers(scenes.chain_on_cylinder(radius=2.5))
    np.testing.assert_array_equal(centre, [0.0, 0.0])
    assert radius == 2.5
