"""Nothing of a compiled problem can be assigned to without effect."""

import cvxpy as cp
import numpy as np
import pytest

import solvers


@pytest.fixture
def compiled():
    x, b = cp.Variable(2, name="x"), cp.Parameter(2, name="b", value=[1.0, 2.0])
    return solvers.compile(cp.Problem(cp.Minimize(0.5 * cp.sum_squares(x) - b @ x)), "daqp")


def test_parameters_are_written_into_and_not_replaced(compiled):
    with pytest.raises(TypeError, match=r"parameters\['b'\] cannot be replaced: write into it.* solve\(b="):
        compiled.parameters["b"] = np.array([3.0, 4.0])
    with pytest.raises(TypeError, match="cannot be replaced"):
        compiled.parameters["new"] = np.array([3.0, 4.0])
    for change in ("update", "pop", "clear", "setdefault", "popitem", "__delitem__"):
        assert not hasattr(compiled.parameters, change)
    np.testing.assert_array_equal(compiled.solve().primal["x"], [1.0, 2.0])
    compiled.parameters["b"][...] = 3.0, 4.0
    np.testing.assert_array_equal(compiled.solve().primal["x"], [3.0, 4.0])
    compiled.parameters["b"] -= 2.0
    np.testing.assert_array_equal(compiled.solve().primal["x"], [1.0, 2.0])
    assert list(compiled.parameters) == ["b"]


def test_no_public_attribute_can_be_assigned(compiled):
    public = [name for name in dir(compiled) if not name.startswith("_")]
    assert {"backend", "parameters", "program", "solve", "tolerance"} == set(public)
    for name in (*public, "polish"):
        with pytest.raises(AttributeError):
            setattr(compiled, name, 1e-3)
    for name in ("backend", "parameters", "program", "tolerance"):
        with pytest.raises(AttributeError, match=f"{name} of a compiled problem is fixed: compile another one"):
            setattr(compiled, name, None)
