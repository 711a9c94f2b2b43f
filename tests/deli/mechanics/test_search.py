import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from deli.errors import InputError
from deli.mechanics import distances
from deli.mechanics.constraints import ConstraintStack, Planes
from deli.mechanics.distances import SpheresApart, SpheresInside
from deli.mechanics.family import Layout
from deli.mechanics.scene import Scene
from deli.mechanics.tables import PAIR, PLANE, POINT

SETTINGS = settings(max_examples=60, deadline=None)

DISTANCE = 0.5


def layout_of(bodies, dimension):
    dof = bodies * dimension
    return Layout(dimension, np.ones(dof), np.zeros(dof))


@st.composite
def gases(draw):
    """Bodies in 1-D, 2-D or 3-D, some on one spot or on the box's edge, and the box: free, periodic or mixed."""
    dimension, bodies = draw(st.integers(1, 3)), draw(st.integers(1, 25))
    coordinate = st.one_of(st.floats(-4.0, 4.0), st.sampled_from([0.0, -1e-20, 2.0, -2.0, 0.5, 1.5]))
    q = draw(hnp.arrays(np.float64, bodies * dimension, elements=coordinate))
    period = draw(st.lists(st.sampled_from([0.0, 2.0, 3.7]), min_size=dimension, max_size=dimension))
    q.setflags(write=False)
    return dimension, bodies, q, period


def searched(dimension, bodies, period):
    family = SpheresApart(None, DISTANCE, period=period)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distances, "SEARCH_ABOVE", 0)
        return family.bind(layout_of(bodies, dimension))


@SETTINGS
@given(gas=gases(), reach=st.sampled_from([-1.0, -0.25, 0.0, 0.5, 1.0, 5.0]))
def test_neighbours_are_those_of_all_pairs(gas, reach):
    dimension, bodies, q, period = gas
    family = searched(dimension, bodies, period)
    listed = SpheresApart(None, DISTANCE, period=period).bind(layout_of(bodies, dimension))
    assert family.searched
    assert not listed.searched
    values, pairs = listed.value(q), np.stack(np.triu_indices(bodies, 1), axis=1)
    rows = family.neighbours(q, reach)
    found = np.stack([rows.first, rows.second], axis=1)
    near = pairs[values <= reach + 1e-14]
    assert {*map(tuple, pairs[values <= reach - 1e-14])} <= {*map(tuple, found)} <= {*map(tuple, near)}
    assert found.tolist() == sorted(found.tolist())
    assert (rows.kind == PAIR).all()
    np.testing.assert_array_equal(rows.target, DISTANCE)
    np.testing.assert_array_equal(rows.sign, 1.0)
    np.testing.assert_array_equal(rows.period, period)
    assert family.least(q) == pytest.approx(values.min(initial=np.inf), rel=1e-14, abs=1e-14)


@SETTINGS
@given(gas=gases(), data=st.data())
def test_a_periodic_box_has_no_edges(gas, data):
    dimension, bodies, q, period = gas
    turns = data.draw(hnp.arrays(np.int64, (bodies, dimension), elements=st.integers(-3, 3)))
    moved = q + (turns * np.array(period)).reshape(-1)
    listed = SpheresApart(None, DISTANCE, period=period).bind(layout_of(bodies, dimension))
    np.testing.assert_allclose(listed.value(moved), listed.value(q), atol=1e-13)
    family = searched(dimension, bodies, period)
    assert family.least(moved) == pytest.approx(family.least(q), abs=1e-13)


def test_nearest_images_in_numbers():
    q = np.array([0.2, 0.5, 9.9, 0.5])
    both = Layout(2, np.ones(4), q)
    assert SpheresApart([(0, 1)], 0.1, period=10.0).bind(both).value(q) == pytest.approx(0.2)
    np.testing.assert_allclose(SpheresApart([(0, 1)], 0.1, period=10.0).bind(both).jacobian(q), [[1, 0, -1, 0]])
    assert SpheresApart([(0, 1)], 0.1, period=[0.0, 10.0]).bind(both).value(q) == pytest.approx(9.6)


def test_a_few_bodies_are_listed_and_many_are_searched():
    few, many = distances.SEARCH_ABOVE, distances.SEARCH_ABOVE + 1
    listed = SpheresApart(None, 0.5).bind(layout_of(few, 1))
    assert not listed.searched
    assert listed.rows == few * (few - 1) // 2
    family = SpheresApart(None, 0.5).bind(layout_of(many, 1))
    assert family.searched
    assert family.rows == 0
    assert family.labels() == []
    assert not SpheresApart([(0, 1)], 0.5).bind(layout_of(many, 1)).searched
    each = np.full(many * (many - 1) // 2, 0.5)
    assert not SpheresApart(None, each).bind(layout_of(many, 1)).searched


@pytest.mark.parametrize("method", ["value", "jacobian"])
def test_a_searched_family_has_no_values_and_says_what_has(method):
    family = searched(2, 3, 0.0)
    message = rf"{method} of SpheresApart: all pairs of 3 bodies are not listed .*neighbours\(q, reach\), .*least\(q\)"
    with pytest.raises(InputError, match=message):
        getattr(family, method)(np.zeros(6))


def test_only_one_distance_of_all_pairs_is_searched():
    with pytest.raises(InputError, match=r"only all pairs \(pairs=None\) at one distance are searched"):
        SpheresApart([(0, 1)], 0.5).bind(layout_of(2, 1)).neighbours(np.zeros(2), 0.0)


@pytest.mark.parametrize("period", [0.9, [2.0, -1.0]])
def test_a_box_too_small_for_two_spheres_is_refused(period):
    with pytest.raises(InputError, match=r"period of SpheresApart: found .*; it must be at least twice the distance"):
        SpheresApart(None, 0.5, period=period).bind(layout_of(2, 2))


def test_found_rows_follow_the_fixed_ones(monkeypatch):
    monkeypatch.setattr(distances, "SEARCH_ABOVE", 2)
    families = [SpheresApart(None, 0.5, period=[4.0, 0.0]), Planes([0.0, 1.0], bodies=[1]), SpheresInside(9.0)]
    stack = ConstraintStack(families).bind(layout_of(3, 2))
    q = np.array([0.0, 0.0, 3.7, 0.0, 2.0, 1.0])
    assert stack.searched
    assert stack.rows_table().kind.tolist() == [PLANE, POINT, POINT, POINT]
    rows = stack.neighbours(q, 0.1)
    assert rows.kind.tolist() == [PLANE, POINT, POINT, POINT, PAIR]
    assert (rows.first[-1], rows.second[-1]) == (0, 1)
    assert rows.period.tolist() == [4.0, 0.0]


@pytest.mark.parametrize("momentum", [0.0, 1.0])
def test_overlap_among_many_is_refused_by_name(momentum):
    x = np.arange(400.0)
    x[17] = 41.4
    with pytest.raises(
        InputError, match=r"position: unilateral constraint \(gap body 17 - body 41\) has value -0.1 at the start"
    ):
        Scene(1.0, x, np.full(400, momentum), unilateral=SpheresApart(None, 0.5))


def test_touching_within_tolerance_is_admitted_among_many():
    Scene(1.0, 0.5 * np.arange(400.0), np.zeros(400), unilateral=SpheresApart(None, 0.5))


def test_searched_families_are_not_bilateral():
    with pytest.raises(InputError, match=r"bilateral: found SpheresApart.*list them"):
        Scene(1.0, np.arange(400.0), np.zeros(400), bilateral=SpheresApart(None, 0.5))
