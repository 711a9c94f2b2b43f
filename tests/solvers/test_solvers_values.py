"""Values of Parameters are real numbers; what is none is refused by the Parameter's name."""

from fractions import Fraction

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as arrays
from scipy import sparse

import solvers


@pytest.fixture(scope="module")
def compiled():
    v, b = cp.Variable(2, name="v"), cp.Parameter(2, name="b")
    return solvers.compile(cp.Problem(cp.Minimize(cp.quad_form(v, np.eye(2)) - 2 * b @ v), [v <= 1e10 * b + 9]), "daqp")


REFUSED = {
    "complex array": (np.array([1j, 2.0]), "complex numbers"),
    "complex list": ([1.0, 2.0 + 0j], "complex numbers"),
    "complex sparse": (sparse.coo_array(np.array([1.0, 2j])), "complex numbers"),
    "text array": (np.array(["1", "2"]), "text"),
    "text": ("12", "text"),
    "bytes": (b"12", "text"),
    "objects": (np.array([Fraction(1, 2), 1], dtype=object), "objects"),
    "nothing": (None, "objects"),
    "nothing within": ([None, 1.0], "objects"),
    "mapping": ({"b": 1.0}, "objects"),
    "cvxpy's own": (cp.Parameter(2), "objects"),
    "huge whole numbers": ([10**400, 1], "objects"),
    "dates": (np.array(["2001-01-01"] * 2, dtype="M8[D]"), "dates"),
    "times": (np.array([1, 2], dtype="m8[s]"), "times"),
    "records": (np.zeros(2, dtype="i,f"), "type"),
    "ragged": ([[1.0], [1.0, 2.0]], "no array of numbers"),
    "masked": (np.ma.array([1.0, 2.0], mask=[False, True]), "masked entries"),
    "nan": ([np.nan, 1.0], "nan or inf"),
    "inf": ([1.0, np.inf], "nan or inf"),
    "beyond double precision": (np.array([1.0, 1.0], dtype=np.longdouble) * np.longdouble("1e4000"), "nan or inf"),
    "too few": ([1.0], r"shape \(1,\); allowed: \(2,\)"),
    "scalar": (1.0, r"shape \(\); allowed: \(2,\)"),
    "row": (sparse.csr_array(np.array([[1.0, 2.0]])), r"shape \(1, 2\); allowed: \(2,\)"),
}


@pytest.mark.parametrize(("value", "found"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_real_number_is_refused_by_name(compiled, value, found):
    with pytest.raises(solvers.ParameterError, match=f"parameter 'b' .*{found}"):
        compiled.solve(b=value)
    assert compiled.solve(b=[0.5, 1.0]).ok


@pytest.mark.parametrize(
    "value",
    [
        [1, 0],
        np.array([True, False]),
        np.array([1, 0], dtype=np.int8),
        np.array([1, 0], dtype=np.float32),
        np.array([1, 0], dtype=np.longdouble),
        np.array([1.0, 9.0, 0.0])[::2],
        np.array([1.0, 0.0], dtype=">f8"),
        np.ma.array([1.0, 0.0], mask=[False, False]),
        sparse.coo_array(np.array([1.0, 0.0])),
    ],
    ids=str,
)
def test_real_numbers_of_every_type_are_taken(compiled, value):
    np.testing.assert_array_equal(
        compiled.solve(b=value).primal["v"], compiled.solve(b=np.array([1.0, 0.0])).primal["v"]
    )


@given(arrays.arrays(arrays.scalar_dtypes(), arrays.array_shapes(max_dims=2)))
def test_whatever_is_given_is_used_or_refused_by_name(compiled, value):
    real = value.dtype.kind in "fiub" and value.shape == (2,) and bool(np.all(np.abs(value.astype(object)) < 1e290))
    if real:
        compiled.solve(b=value)
        np.testing.assert_array_equal(compiled.parameters["b"], value.astype(float))
    elif value.dtype.kind not in "fiub" or value.shape != (2,) or not np.all(np.isfinite(value)):
        with pytest.raises(solvers.ParameterError, match="parameter 'b'"):
            compiled.solve(b=value)


def test_values_whose_products_overflow_are_refused(compiled):
    with pytest.raises(solvers.ParameterError, match="overflow"):
        compiled.solve(b=[1e300, 1.0])
    assert compiled.solve(b=[1e160, 1.0]).primal["v"].shape == (2,)  # its square overflows, and nothing else
