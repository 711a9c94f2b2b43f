import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanics_cases import CONSTRAINTS, DIMENSIONS, POTENTIALS, configurations, layout, spread

from deli.errors import InputError
from deli.mechanics.constraints import ConstraintStack
from deli.mechanics.distances import SpheresApart
from deli.mechanics.functions import Constraints, Potential
from deli.mechanics.potential_sum import PotentialSum
from deli.mechanics.tables import OTHER, PAIR, PLANE, POINT, SPRING, table_norms, table_rates, table_values

SETTINGS = settings(max_examples=15, deadline=None)

dimensions = pytest.mark.parametrize("dimension", DIMENSIONS)


def constraint(name, dimension):
    return CONSTRAINTS[name](dimension).bind(layout(dimension))


def potential(name, dimension):
    return POTENTIALS[name](dimension).bind(layout(dimension))


def row_by_row(rows, q):
    """Values and gradients of the rows, read from the definition of the table one by one."""
    dimension = rows.vector.shape[1]
    x = q.reshape(-1, dimension)
    values, gradients = [], []
    for k, kind in enumerate(rows.kind):
        i, j = rows.first[k], rows.second[k]
        gradient = np.zeros_like(x)
        if kind == PLANE:
            values.append(rows.vector[k] @ x[i] - rows.target[k])
            gradient[i] = rows.vector[k]
        else:
            apart = x[i] - x[j] if kind == PAIR else x[i] - rows.vector[k]
            if kind == PAIR:
                for axis in np.flatnonzero(rows.period):
                    images = apart[axis] + rows.period[axis] * np.arange(-3, 4)
                    apart[axis] = images[np.argmin(abs(images))]
            values.append(rows.sign[k] * (np.linalg.norm(apart) - rows.target[k]))
            gradient[i] += rows.sign[k] * apart / np.linalg.norm(apart)
            if kind == PAIR:
                gradient[j] -= rows.sign[k] * apart / np.linalg.norm(apart)
        gradients.append(gradient.reshape(-1))
    return np.array(values), np.array(gradients).reshape(len(values), q.size)


def energy_of(terms, q):
    """The energy of the terms, read from the definition of the table."""
    x = q.reshape(-1, terms.centre.shape[1])
    total = terms.weight @ q
    for kind, i, j, strength, length in zip(*terms[1:6], strict=True):
        r = np.linalg.norm(x[i] - x[j])
        ratio = (length / r) ** 6
        total += 0.5 * strength * (r - length) ** 2 if kind == SPRING else strength * (ratio**2 - ratio)
    for body, centre, coefficient, exponent in zip(*terms[6:], strict=True):
        total += coefficient * np.linalg.norm(x[body] - centre) ** exponent
    return total


def check_layout(table):
    for name, column in table._asdict().items():
        assert column.dtype == (np.int64 if name in ("kind", "first", "second", "body") else np.float64), name
        assert column.flags.c_contiguous, name
        assert column.flags.writeable, name


@pytest.mark.parametrize("name", CONSTRAINTS)
@dimensions
@SETTINGS
@given(data=st.data())
def test_rows_are_the_family(name, dimension, data):
    family, q = constraint(name, dimension), data.draw(configurations(dimension))
    rows = family.rows_table()
    check_layout(rows)
    values, gradients = row_by_row(rows, q)
    np.testing.assert_allclose(values, family.value(q), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(gradients, family.jacobian(q), rtol=1e-13, atol=1e-13)
    v = data.draw(configurations(dimension))
    np.testing.assert_allclose(table_values(rows, q), values, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(table_rates(rows, q, v), gradients @ v, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(table_norms(rows, q), np.linalg.norm(gradients, axis=1), rtol=1e-13)


@pytest.mark.parametrize("name", POTENTIALS)
@dimensions
@SETTINGS
@given(data=st.data())
def test_terms_are_the_potential(name, dimension, data):
    family, q = potential(name, dimension), data.draw(configurations(dimension))
    terms = family.terms_table()
    check_layout(terms)
    assert energy_of(terms, q) == pytest.approx(family.energy(q), rel=1e-12)


@pytest.mark.parametrize("name", POTENTIALS)
@dimensions
@SETTINGS
@given(data=st.data())
def test_curvature_is_the_hessian_in_one_direction(name, dimension, data):
    family, q, v = potential(name, dimension), data.draw(configurations(dimension)), spread(dimension)
    hessian = family.hessian(q)
    assert family.curvature(q, v) == pytest.approx(v @ hessian @ v, rel=1e-10, abs=1e-10 * abs(hessian).max())


def test_a_stack_has_its_families_rows_and_numbers_those_of_functions():
    names = ["floor", "some apart", "some outside", "pendulums", "inside"]
    one = Constraints(value=lambda q: q[:2], jacobian=lambda q: np.eye(8)[:2])
    two = Constraints(value=lambda q: q[2:3], jacobian=lambda q: np.eye(8)[2:3])
    parts = [CONSTRAINTS[name](2) for name in names]
    stack = ConstraintStack([one, *parts[:2], ConstraintStack([two, parts[2]]), *parts[3:]]).bind(layout(2))
    rows, q = stack.rows_table(), spread(2)
    check_layout(rows)
    assert rows.kind.size == stack.rows
    other = rows.kind == OTHER
    np.testing.assert_array_equal(rows.first[other], [0, 1, 2])
    values = np.concatenate([family.value(q) for family in stack.others])
    np.testing.assert_array_equal(stack.value(q)[other], values[rows.first[other]])
    np.testing.assert_allclose(table_values(rows, q)[~other], stack.value(q)[~other], rtol=1e-13, atol=1e-13)
    assert np.isnan(table_values(rows, q)[other]).all()
    assert set(rows.kind) == {PLANE, PAIR, POINT, OTHER}
    assert not stack.searched
    for found, expected in zip(stack.neighbours(q, 1.0), rows, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_an_empty_stack_has_an_empty_table():
    rows = ConstraintStack().bind(layout(3)).rows_table()
    check_layout(rows)
    assert rows.vector.shape == (0, 3)
    assert rows.period.shape == (3,)


@dimensions
@SETTINGS
@given(data=st.data())
def test_a_sum_has_all_terms_but_those_of_functions(dimension, data):
    q = data.draw(configurations(dimension))
    function = Potential(energy=lambda q: q @ q, gradient=lambda q: 2.0 * q)
    parts = [POTENTIALS[name](dimension) for name in POTENTIALS]
    total = PotentialSum([*parts[:3], PotentialSum([function, *parts[3:]])]).bind(layout(dimension))
    terms = total.terms_table()
    check_layout(terms)
    (other,) = total.others
    assert energy_of(terms, q) + other.energy(q) == pytest.approx(total.energy(q), rel=1e-12)
    assert total.curvature(q, q) is None


def test_the_zero_potential_has_an_empty_table():
    total = PotentialSum().bind(layout(2))
    check_layout(total.terms_table())
    np.testing.assert_array_equal(total.terms_table().weight, np.zeros(8))
    assert total.others == ()
    assert total.curvature(spread(2), spread(2)) == 0.0


def test_coincident_bodies_have_no_direction():
    rows = SpheresApart([(0, 1)], 1.0).bind(layout(2)).rows_table()
    q = np.zeros(8)
    np.testing.assert_array_equal(table_values(rows, q), [-1.0])
    np.testing.assert_array_equal(table_rates(rows, q, np.arange(8.0)), [0.0])
    np.testing.assert_array_equal(table_norms(rows, q), [0.0])


def test_pairs_of_two_periods_are_refused():
    families = [SpheresApart([(0, 1)], 1.0, period=8.0), SpheresApart([(0, 2)], 1.0)]
    with pytest.raises(InputError, match=r"period: found pairs with period \[8.0\] beside pairs with period \[0.0\]"):
        ConstraintStack(families).bind(layout(1))
