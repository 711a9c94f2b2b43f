import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanics_cases import CONSTRAINTS, DIMENSIONS, configurations, derivative, layout, motions, spread

from deli.errors import InputError
from deli.mechanics import pairs
from deli.mechanics.constraints import ConstraintStack, Planes
from deli.mechanics.distances import AnchoredRods, Rods, SpheresApart, SpheresInside

SETTINGS = settings(max_examples=15, deadline=None)

families = pytest.mark.parametrize("name", CONSTRAINTS)
dimensions = pytest.mark.parametrize("dimension", DIMENSIONS)


def bound(name, dimension):
    return CONSTRAINTS[name](dimension).bind(layout(dimension))


@families
@dimensions
@SETTINGS
@given(data=st.data())
def test_jacobian_is_the_derivative_of_the_value(name, dimension, data):
    constraints, q = bound(name, dimension), data.draw(configurations(dimension))
    jacobian = constraints.jacobian(q)
    assert jacobian.shape == (constraints.rows, q.size)
    assert abs(jacobian).max() > 0.1
    np.testing.assert_allclose(jacobian, derivative(constraints.value, q), rtol=1e-7, atol=1e-7)


@families
@dimensions
@SETTINGS
@given(data=st.data())
def test_values_of_a_batch_are_the_values_one_by_one(name, dimension, data):
    constraints, q = bound(name, dimension), data.draw(configurations(dimension, (2, 3)))
    together = constraints.value(q)
    assert together.shape == (2, 3, constraints.rows)
    one_by_one = [[constraints.value(row) for row in rows] for rows in q]
    np.testing.assert_allclose(together, one_by_one, rtol=1e-13, atol=1e-13)


@families
@dimensions
@SETTINGS
@given(data=st.data(), amount=st.floats(-2.0, 2.0))
def test_declared_invariances_hold(name, dimension, data, amount):
    constraints, q = bound(name, dimension), data.draw(configurations(dimension))
    value = constraints.value(q)
    for motion, declared, move in motions(constraints.invariance(), dimension):
        if declared:
            np.testing.assert_allclose(constraints.value(move(q, amount)), value, atol=1e-12, err_msg=motion)


@families
@dimensions
def test_no_invariance_is_left_undeclared(name, dimension):
    constraints = bound(name, dimension)
    q = spread(dimension) + np.random.default_rng(1).uniform(-0.4, 0.4, spread(dimension).shape)
    for motion, declared, move in motions(constraints.invariance(), dimension):
        if not declared:
            assert abs(constraints.value(move(q, 0.01)) - constraints.value(q)).max() > 1e-6, motion


@families
@dimensions
def test_constant_jacobian_is_declared_where_it_is_constant(name, dimension):
    constraints, q = bound(name, dimension), spread(dimension)
    moved = q + np.random.default_rng(2).uniform(-0.4, 0.4, q.shape)
    same = np.array_equal(constraints.jacobian(q), constraints.jacobian(moved))
    # in one dimension a distance is linear as long as the bodies do not change places
    assert same == (constraints.constant_jacobian or dimension == 1)


@families
@dimensions
def test_every_row_has_a_label(name, dimension):
    constraints = bound(name, dimension)
    assert len(set(constraints.labels())) == len(constraints.labels()) or name == "some planes"
    assert len(constraints.labels()) == constraints.rows == constraints.value(spread(dimension)).size


@families
@dimensions
def test_sparse_differences_give_the_same_numbers(name, dimension, monkeypatch):
    q = spread(dimension) + np.random.default_rng(3).uniform(-0.4, 0.4, spread(dimension).shape)
    dense = bound(name, dimension)
    monkeypatch.setattr(pairs, "LARGEST_DENSE", 0)
    sparse = bound(name, dimension)
    for method in ("value", "jacobian"):
        np.testing.assert_allclose(getattr(sparse, method)(q), getattr(dense, method)(q), rtol=1e-14, atol=1e-14)


@families
def test_arrays_of_a_family_are_read_only(name):
    arrays = {key: value for key, value in vars(bound(name, 2)).items() if isinstance(value, np.ndarray)}
    assert arrays
    for key, array in arrays.items():
        assert not array.flags.writeable, key


def test_values_are_the_paper_s():
    q = np.array([3.0, 4.0, 0.0, 0.0, 0.0, -2.0, 1.0, 0.0])

    def value(family):
        return family.bind(layout(2)).value(q)

    np.testing.assert_allclose(value(SpheresApart([(0, 1)], 1.5)), [3.5])
    np.testing.assert_allclose(value(Rods([(1, 2)], 1.5)), [0.5])
    np.testing.assert_allclose(value(SpheresInside(6.0, bodies=[0])), [1.0])
    np.testing.assert_allclose(value(AnchoredRods([0.0, 1.0], 3.0, bodies=[2])), [0.0])
    np.testing.assert_allclose(value(Planes([0.0, 2.0], 1.0, bodies=[0, 2])), [7.0, -5.0])


def test_coincident_bodies_have_a_zero_row():
    apart = SpheresApart([(0, 1)], 1.0).bind(layout(2))
    np.testing.assert_array_equal(apart.jacobian(np.zeros(8)), np.zeros((1, 8)))


@SETTINGS
@given(data=st.data())
def test_a_stack_has_its_families_row_under_row(data):
    q = data.draw(configurations(2, (2,)))
    parts = [bound("floor", 2), bound("some apart", 2), bound("inside", 2)]
    stack = ConstraintStack(parts).bind(layout(2))
    assert stack.rows == sum(part.rows for part in parts)
    assert stack.labels() == [label for part in parts for label in part.labels()]
    np.testing.assert_array_equal(stack.value(q), np.concatenate([part.value(q) for part in parts], axis=-1))
    np.testing.assert_array_equal(stack.jacobian(q[0]), np.concatenate([part.jacobian(q[0]) for part in parts]))


def test_a_stack_of_nothing_has_no_rows():
    nothing, q = ConstraintStack().bind(layout(2)), spread(2)
    assert nothing.rows == 0
    assert nothing.labels() == []
    assert nothing.value(q).shape == (0,)
    assert nothing.value(np.stack([q, q])).shape == (2, 0)
    assert nothing.jacobian(q).shape == (0, q.size)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Planes([0.0, 0.0]).bind(layout(2)), r"normals of Planes: row 0 is zero; a normal must not be zero"),
        (
            lambda: Planes([1.0]).bind(layout(2)),
            r"normals of Planes: found shape \(1,\); pass one vector of length 2, or",
        ),
        (
            lambda: Planes([1.0, 2.0, 3.0]).bind(layout(2)),
            r"normals of Planes: found shape \(3,\); pass one vector",
        ),
        (lambda: Planes([0.0, 1.0], [1.0, 2.0]).bind(layout(2)), r"offsets of Planes: found shape \(2,\)"),
        (lambda: Planes([0.0, 1.0], bodies=[4]).bind(layout(2)), r"bodies of Planes: found body 4; .* bodies 0 to 3"),
        (lambda: SpheresApart([(0, 1)], 0.0), r"distance of SpheresApart: found 0.0; it must be > 0"),
        (lambda: SpheresApart([(0, 4)], 1.0).bind(layout(2)), r"pairs of SpheresApart: found body 4"),
        (lambda: Rods([(0, 1)], -1.0), r"length of Rods: found -1.0; it must be > 0"),
        (lambda: Rods([(0.5, 1)], 1.0), r"pairs of Rods: found \[\(0.5, 1\)\]; pass a list of pairs"),
        (lambda: SpheresInside(np.inf), r"radius of SpheresInside: found inf; every entry must be finite"),
        (
            lambda: AnchoredRods([0.0, 0.0], 1.0, bodies=1),
            r"bodies of AnchoredRods: found 1; pass a list of body numbers",
        ),
        (lambda: AnchoredRods(np.zeros((3, 2)), 1.0).bind(layout(2)), r"pivots of AnchoredRods: found shape \(3, 2\)"),
    ],
)
def test_bad_input_is_refused_with_what_to_do(make, message):
    with pytest.raises(InputError, match=message):
        make()


@families
def test_a_family_that_no_scene_has_bound_says_so(name):
    with pytest.raises(AttributeError, match=r"is not bound to a scene yet: pass it to deli\.Scene"):
        CONSTRAINTS[name](2).value(spread(2))
