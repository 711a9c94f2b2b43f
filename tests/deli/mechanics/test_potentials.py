import dataclasses
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanics_cases import DIMENSIONS, POTENTIALS, configurations, derivative, layout, motions, spread

from deli.errors import InputError
from deli.mechanics import pairs
from deli.mechanics.family import Layout
from deli.mechanics.pair_potentials import LennardJones, Springs
from deli.mechanics.potential_sum import PotentialSum
from deli.mechanics.potentials import Gravity, RadialPowers

SETTINGS = settings(max_examples=15, deadline=None)

families = pytest.mark.parametrize("name", POTENTIALS)
dimensions = pytest.mark.parametrize("dimension", DIMENSIONS)


def bound(name, dimension):
    return POTENTIALS[name](dimension).bind(layout(dimension))


@families
@dimensions
@SETTINGS
@given(data=st.data())
def test_gradient_is_the_derivative_of_the_energy(name, dimension, data):
    potential, q = bound(name, dimension), data.draw(configurations(dimension))
    gradient = potential.gradient(q)
    assert gradient.shape == q.shape
    np.testing.assert_allclose(gradient, derivative(potential.energy, q), rtol=1e-6, atol=1e-6 * abs(gradient).max())


@families
@dimensions
@SETTINGS
@given(data=st.data())
def test_hessian_is_the_symmetric_derivative_of_the_gradient(name, dimension, data):
    potential, q = bound(name, dimension), data.draw(configurations(dimension))
    hessian = potential.hessian(q)
    scale = abs(hessian).max()
    assert hessian.shape == (q.size, q.size)
    np.testing.assert_allclose(hessian, hessian.T, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(hessian, derivative(potential.gradient, q), rtol=1e-6, atol=1e-6 * scale + 1e-9)


@families
@dimensions
@SETTINGS
@given(data=st.data())
def test_energies_of_a_batch_are_the_energies_one_by_one(name, dimension, data):
    potential, q = bound(name, dimension), data.draw(configurations(dimension, (2, 3)))
    together = potential.energy(q)
    assert together.shape == (2, 3)
    one_by_one = [[potential.energy(row) for row in rows] for rows in q]
    np.testing.assert_allclose(together, one_by_one, rtol=1e-13)


@families
@dimensions
@SETTINGS
@given(data=st.data(), amount=st.floats(-2.0, 2.0))
def test_declared_invariances_hold(name, dimension, data, amount):
    potential, q = bound(name, dimension), data.draw(configurations(dimension))
    energy = potential.energy(q)
    for motion, declared, move in motions(potential.invariance(), dimension):
        if declared:
            assert potential.energy(move(q, amount)) == pytest.approx(energy, rel=1e-9, abs=1e-9), motion


@families
@dimensions
def test_no_invariance_is_left_undeclared(name, dimension):
    potential = bound(name, dimension)
    q = spread(dimension) + np.random.default_rng(1).uniform(-0.4, 0.4, spread(dimension).shape)
    for motion, declared, move in motions(potential.invariance(), dimension):
        if not declared:
            assert abs(potential.energy(move(q, 0.01)) - potential.energy(q)) > 1e-6, motion


@families
@dimensions
def test_constant_hessian_is_declared_where_it_is_constant(name, dimension):
    potential, q = bound(name, dimension), spread(dimension)
    moved = q + np.random.default_rng(2).uniform(-0.4, 0.4, q.shape)
    same = np.allclose(potential.hessian(q), potential.hessian(moved), rtol=1e-9, atol=1e-9)
    # in one dimension a linear spring is quadratic as long as its ends do not change places
    assert same == (potential.constant_hessian or (dimension == 1 and "spring" in name))


@families
def test_arrays_of_a_family_are_read_only(name):
    potential = bound(name, 2)
    arrays = {key: value for key, value in vars(potential).items() if isinstance(value, np.ndarray)}
    assert arrays
    for key, array in arrays.items():
        assert not array.flags.writeable, key


@families
@dimensions
def test_sparse_differences_give_the_same_numbers(name, dimension, monkeypatch):
    q = spread(dimension) + np.random.default_rng(3).uniform(-0.4, 0.4, spread(dimension).shape)
    dense = bound(name, dimension)
    monkeypatch.setattr(pairs, "LARGEST_DENSE", 0)
    sparse = bound(name, dimension)
    for method in ("energy", "gradient", "hessian"):
        np.testing.assert_allclose(getattr(sparse, method)(q), getattr(dense, method)(q), rtol=1e-12, atol=1e-12)


@SETTINGS
@given(data=st.data())
def test_lennard_jones_is_equation_8_10(data):
    q = data.draw(configurations(3))
    x = q.reshape(-1, 3)
    ratios = [0.9 / np.linalg.norm(x[i] - x[j]) for i, j in combinations(range(len(x)), 2)]
    expected = sum(4 * 1.2 * (ratio**12 - ratio**6) for ratio in ratios)
    assert bound("lennard-jones", 3).energy(q) == pytest.approx(expected, rel=1e-12)


@SETTINGS
@given(top=st.floats(-9, 9), bottom=st.floats(-9, 9))
def test_a_spring_in_one_dimension_keeps_the_absolute_value(top, bottom):
    spring = Springs(pairs=[(0, 1)], stiffness=10.0, rest_length=5.0).bind(Layout(1, np.ones(2), np.ones(2)))
    assert spring.energy(np.array([top, bottom])) == pytest.approx(5.0 * (abs(top - bottom) - 5.0) ** 2, rel=1e-12)


@dimensions
def test_a_spring_whose_ends_coincide_makes_no_force(dimension):
    springs = Springs(pairs=[(0, 1)], stiffness=2.0, rest_length=3.0)
    q = np.ones(2 * dimension)
    spring = springs.bind(Layout(dimension, np.ones(q.size), q))
    np.testing.assert_array_equal(spring.gradient(q), np.zeros(q.size))
    side = np.array([[2.0, -2.0], [-2.0, 2.0]])
    np.testing.assert_allclose(spring.hessian(q), np.kron(side, np.identity(dimension)))


def test_radial_powers_are_smooth_at_the_centre():
    wells = RadialPowers([1.0, -2.0, 1.0], [6.0, 4.0, 2.0]).bind(Layout(2, np.ones(2), np.zeros(2)))
    np.testing.assert_array_equal(wells.gradient(np.zeros(2)), np.zeros(2))
    np.testing.assert_array_equal(wells.hessian(np.zeros(2)), 2.0 * np.identity(2))


@SETTINGS
@given(data=st.data())
def test_a_sum_adds_up(data):
    q = data.draw(configurations(2))
    parts = [bound("gravity down", 2), bound("springs", 2), bound("wells", 2)]
    total = PotentialSum(parts).bind(layout(2))
    for method in ("energy", "gradient", "hessian"):
        expected = sum(getattr(part, method)(q) for part in parts)
        np.testing.assert_allclose(getattr(total, method)(q), expected, rtol=1e-12)


def test_the_sum_of_nothing_is_zero():
    nothing = PotentialSum().bind(layout(2))
    q = spread(2)
    assert nothing.energy(q) == 0.0
    assert nothing.energy(np.stack([q, q])).shape == (2,)
    np.testing.assert_array_equal(nothing.gradient(q), np.zeros(q.size))
    np.testing.assert_array_equal(nothing.hessian(q), np.zeros((q.size, q.size)))


def test_gravity_takes_the_masses_of_the_scene_it_is_bound_to():
    gravity = Gravity([0.0, -9.8]).bind(Layout(2, np.array([1.0, 1.0, 2.0, 2.0]), np.zeros(4)))
    np.testing.assert_allclose(gravity.gradient(np.zeros(4)), [0.0, 9.8, 0.0, 19.6])
    heavier = gravity.bind(Layout(2, np.full(4, 3.0), np.zeros(4)))
    np.testing.assert_allclose(heavier.gradient(np.zeros(4)), [0.0, 29.4, 0.0, 29.4])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Gravity([0.0, np.nan]), r"acceleration of Gravity: found nan at index 1; every entry must be finite"),
        (
            lambda: Gravity([9.8]).bind(layout(2)),
            r"acceleration of Gravity: found shape \(1,\); the scene has dimension 2",
        ),
        (lambda: Springs([(0, 0)], 1.0), r"pairs of Springs: pair 0 joins body 0 with itself"),
        (lambda: Springs([0, 1], 1.0), r"pairs of Springs: found \[0, 1\]; pass a list of pairs"),
        (lambda: Springs([(0, 1)], 1.0, -2.0), r"rest_length of Springs: found -2.0; it must be >= 0"),
        (lambda: Springs([(0, 1)], "stiff"), r"stiffness of Springs: found 'stiff' .*; pass real numbers"),
        (
            lambda: Springs([(0, 9)], 1.0).bind(layout(2)),
            r"pairs of Springs: found body 9; the scene has bodies 0 to 3",
        ),
        (
            lambda: Springs([(0, 1)], [1.0, 2.0]).bind(layout(2)),
            r"stiffness of Springs: found shape \(2,\); .*each pair",
        ),
        (lambda: RadialPowers([1.0], [2.0, 4.0]), r"RadialPowers: found coefficients of shape \(1,\) and exponents"),
        (lambda: RadialPowers([1.0], [2.0], bodies=[1, 1]), r"bodies of RadialPowers: found body 1 more than once"),
        (
            lambda: RadialPowers([1.0], [2.0], bodies=[-1]).bind(layout(2)),
            r"found body -1; the scene has bodies 0 to 3",
        ),
        (lambda: LennardJones(1.0, 0.0), r"sigma of LennardJones: found 0.0; it must be > 0"),
    ],
)
def test_bad_input_is_refused_with_what_to_do(make, message):
    with pytest.raises(InputError, match=message):
        make()


@families
def test_a_family_that_no_scene_has_bound_says_so(name):
    with pytest.raises(AttributeError, match=r"is not bound to a scene yet: pass it to deli\.Scene"):
        POTENTIALS[name](2).energy(spread(2))


def test_families_can_be_changed_by_replace():
    spring = bound("one spring", 2)
    softer = dataclasses.replace(spring, stiffness=1.0)
    assert softer.energy(spread(2)) == pytest.approx(spring.energy(spread(2)) / 10.0)
