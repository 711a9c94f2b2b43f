import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from deli.errors import DeliError, InputError
from deli.mechanics.constraints import Planes
from deli.mechanics.distances import AnchoredRods, Rods, SpheresApart, SpheresInside
from deli.mechanics.functions import Constraints
from deli.mechanics.pair_potentials import LennardJones, Springs
from deli.mechanics.potentials import Gravity, RadialPowers
from deli.mechanics.scene import Scene


def make(**changes):
    """Two bodies in the plane, one unit apart, above a floor."""
    given = {
        "mass": 1.0,
        "position": [[0.0, 1.0], [1.0, 1.0]],
        "momentum": [[0.0, 1.0], [0.0, -1.0]],
        "potential": [Gravity([0.0, -9.8]), Springs([(0, 1)], 2.0, 1.0)],
        "unilateral": Planes([0.0, 1.0]),
        "bilateral": [Rods([(0, 1)], 1.0)],
        "dimension": 2,
    }
    return Scene(**(given | changes))


def test_a_scene_holds_flat_read_only_float_arrays():
    position = np.array([[0, 1], [1, 1]])
    scene = make(position=position)
    position[0, 0] = 9
    np.testing.assert_array_equal(scene.position, [0.0, 1.0, 1.0, 1.0])
    for array in (scene.mass, scene.position, scene.momentum):
        assert array.shape == (4,)
        assert array.dtype == np.float64
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0
    assert (scene.dof, scene.bodies, scene.dimension, scene.name) == (4, 2, 2, "custom")
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.mass = scene.momentum


@pytest.mark.parametrize(
    ("mass", "expected"),
    [(2, [2, 2, 2, 2]), ([2, 3], [2, 2, 3, 3]), ([1, 2, 3, 4], [1, 2, 3, 4]), ([[1, 2], [3, 4]], [1, 2, 3, 4])],
)
def test_mass_is_one_number_or_one_a_body_or_one_a_degree_of_freedom(mass, expected):
    scene = make(mass=mass, bilateral=None)
    np.testing.assert_array_equal(scene.mass, expected)
    np.testing.assert_allclose(scene.potential.families[0].gradient(scene.position), scene.mass * [0, 9.8, 0, 9.8])


def test_a_scene_shows_what_it_is_made_of():
    shown = repr(make(name="rod over a floor"))
    for part in ("name='rod over a floor'", "PotentialSum([Gravity(", "ConstraintStack([Rods("):
        assert part in shown


def test_nothing_given_is_free_flight():
    scene = Scene(mass=1.0, position=0.0, momentum=2.0)
    assert scene.unilateral.rows == scene.bilateral.rows == 0
    assert scene.potential.energy(scene.position) == 0.0
    assert scene.length_scale == 1.0
    assert scene.symmetry.linear == (True,)


def test_length_scale_is_the_largest_entry_of_the_position():
    assert make(position=[[-1.0, 7.0], [-1.0, 6.0]], momentum=np.zeros(4)).length_scale == 7.0


def test_replace_checks_again():
    scene = make()
    moved = dataclasses.replace(scene, position=scene.position + 1.0, name="moved")
    np.testing.assert_array_equal(moved.position, scene.position + 1.0)
    assert (scene.name, moved.name) == ("custom", "moved")
    heavy = dataclasses.replace(scene, mass=2.0)
    assert heavy.potential.energy(scene.position) == 2.0 * scene.potential.energy(scene.position)
    with pytest.raises(InputError, match="position: unilateral constraint 0"):
        dataclasses.replace(scene, position=scene.position - 2.0)


def test_a_scene_survives_pickling():
    scene = make()
    copy = pickle.loads(pickle.dumps(scene))
    np.testing.assert_array_equal(copy.position, scene.position)
    np.testing.assert_array_equal(copy.potential.gradient(copy.position), scene.potential.gradient(scene.position))
    np.testing.assert_array_equal(copy.bilateral.jacobian(copy.position), scene.bilateral.jacobian(scene.position))


NUMBERS = st.floats(-5, 5, width=32)  # times 1e-9 they are still normal in double precision


@settings(max_examples=50, deadline=None)
@given(momentum=hnp.arrays(np.float64, 4, elements=NUMBERS), size=st.sampled_from([1e-9, 1.0, 1e9]))
def test_only_momentum_along_a_rod_is_refused(momentum, size):
    across = momentum.copy()
    across[[0, 2]] = momentum[[0, 2]].mean()
    make(momentum=size * across)
    if abs(momentum[0] - momentum[2]) > 1e-6 * abs(momentum).max():
        with pytest.raises(InputError, match=r"momentum: bilateral constraint 0 \(rod body 0 - body 1\)"):
            make(momentum=size * momentum)


@pytest.mark.parametrize("size", [1e-200, 1e150])
def test_momenta_whose_squares_are_out_of_range_are_judged_too(size):
    make(momentum=size * np.array([[1.0, 1.0], [1.0 + 1e-12, -2.0]]))
    with pytest.raises(InputError, match="momentum: bilateral constraint 0"):
        make(momentum=size * np.array([[1.0, 1.0], [1.1, -2.0]]))


@settings(max_examples=50, deadline=None)
@given(height=st.floats(-1e-3, 1e-3))
def test_a_start_below_the_floor_by_more_than_rounding_is_refused(height):
    position = [[0.0, height], [1.0, height]]
    if height >= -1e-9:
        make(position=position, momentum=np.zeros(4))
    else:
        with pytest.raises(InputError, match="position: unilateral constraint 0"):
            make(position=position, momentum=np.zeros(4))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": 0.0}, r"mass: found 0.0; it must be > 0"),
        ({"mass": [1.0, -2.0]}, r"mass: found -2.0; it must be > 0"),
        ({"mass": [1.0, np.nan]}, r"mass: found nan at index 1; every entry must be finite"),
        (
            {"mass": [1.0, 1.0, 1.0]},
            r"mass: found shape \(3,\); pass one number, one for each of 2 bodies, .* 4 degrees",
        ),
        ({"mass": "heavy"}, r"mass: found 'heavy' .*; pass real numbers"),
        ({"mass": True}, r"mass: found True .*; pass real numbers"),
        ({"dimension": 4}, r"dimension: found 4; it must be 1, 2 or 3"),
        ({"dimension": True}, r"dimension: found True; it must be 1, 2 or 3"),
        ({"dimension": 3}, r"position: found shape \(2, 2\); in dimension 3 pass \(bodies, 3\), or a flat vector"),
        ({"position": [0.0, 1.0, 1.0]}, r"position: found shape \(3,\); in dimension 2 pass"),
        ({"position": []}, r"position: found no entries; a scene needs at least one body"),
        ({"position": [[0.0, 1.0], [1.0]]}, r"position: found rows of unequal length"),
        (
            {"position": [[0.0, 1.0], [np.inf, 1.0]]},
            r"position: found inf at index \(1, 0\); every entry must be finite",
        ),
        ({"position": [[0.0, 1j], [1.0, 1.0]]}, r"position: found .* \(type complex128\); pass real numbers"),
        ({"momentum": [0.0, 1.0]}, r"momentum: found 2 entries, position has 4; pass as many"),
        ({"momentum": [0.0, 1.0, np.nan, 0.0]}, r"momentum: found nan at index 2"),
        ({"potential": 9.8}, r"potential: found 9.8; pass a family such as deli.Potential\(energy=...\)"),
        ({"potential": [Planes([0.0, 1.0])]}, r"potential: found Planes\(.*; pass a family such as"),
        (
            {"unilateral": lambda q: q},
            r"unilateral: found <function .*; pass a family such as deli.Constraints\(value=...\)",
        ),
        ({"bilateral": [None]}, r"bilateral: found None; pass a family"),
        (
            {"potential": [RadialPowers([1.0], [-2.0], centre=[0.0, 1.0])]},
            r"potential: energy inf .* at the initial position; start where the potential is finite",
        ),
        (
            {"unilateral": [Planes([0.0, 1.0]), SpheresApart([(0, 1)], 1.25)]},
            r"position: unilateral constraint 2 \(gap body 0 - body 1\) has value -0.25 at the start; it must be >= 0 "
            r"\(within 1.4e-09\); move the bodies apart",
        ),
        (
            {"bilateral": [Rods([(0, 1)], 0.75)]},
            r"position: bilateral constraint 0 \(rod body 0 - body 1\) has value 0.25 at the start; it must be = 0 .*"
            r"move the bodies onto the constraint",
        ),
        (
            {"unilateral": [SpheresInside(0.5, bodies=[0])]},
            r"position: unilateral constraint 0 \(container gap body 0\) has value -0.5",
        ),
        (
            {"bilateral": [AnchoredRods([[0.0, 0.0]], 2.0, bodies=[0])]},
            r"position: bilateral constraint 0 \(anchored rod body 0\) has value -1 ",
        ),
        (
            {"momentum": [[1.0, 1.0], [-1.0, 1.0]]},
            r"momentum: bilateral constraint 0 \(rod body 0 - body 1\) would change at the rate -2; it must be 0 .*"
            r"remove the part of the momentum along the constraint's gradient",
        ),
        (
            {"unilateral": Constraints(value=lambda q: np.array([np.nan]), jacobian=lambda q: np.zeros((1, 4)))},
            r"value of Constraints: not finite at the initial state \(entry \(0,\) is nan\)",
        ),
        (
            {"potential": LennardJones(1.0, 1.0, pairs=[(0, 2)])},
            r"pairs of LennardJones: found body 2; .* bodies 0 to 1",
        ),
    ],
)
def test_bad_input_is_refused_with_what_was_found_and_what_to_do(changes, message):
    with pytest.raises(InputError, match=message) as caught:
        make(**changes)
    assert isinstance(caught.value, DeliError)
    assert isinstance(caught.value, ValueError)
