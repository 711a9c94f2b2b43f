import importlib.util
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanics_cases import CONSTRAINTS, POTENTIALS, configurations, layout, spread

from deli.errors import InputError
from deli.mechanics.functions import Constraints, Potential
from deli.mechanics.scene import Scene

SETTINGS = settings(max_examples=15, deadline=None)

WELLS = POTENTIALS["wells"](2).bind(layout(2))
RODS = CONSTRAINTS["rods"](2).bind(layout(2))
PLAIN_WELLS = Potential(energy=WELLS.energy, gradient=WELLS.gradient, hessian=WELLS.hessian)
PLAIN_RODS = Constraints(value=RODS.value, jacobian=RODS.jacobian)


@SETTINGS
@given(data=st.data())
def test_functions_make_the_same_potential_as_the_family(data):
    plain, q = PLAIN_WELLS.bind(layout(2)), data.draw(configurations(2, (2, 3)))
    np.testing.assert_allclose(plain.energy(q), WELLS.energy(q), rtol=1e-14)
    np.testing.assert_array_equal(plain.gradient(q[0, 0]), WELLS.gradient(q[0, 0]))
    np.testing.assert_array_equal(plain.hessian(q[0, 0]), WELLS.hessian(q[0, 0]))


@SETTINGS
@given(data=st.data())
def test_functions_make_the_same_constraints_as_the_family(data):
    plain, q = PLAIN_RODS.bind(layout(2)), data.draw(configurations(2, (2, 3)))
    assert plain.rows == RODS.rows
    assert plain.labels() == ["constraint row 0", "constraint row 1"]
    np.testing.assert_allclose(plain.value(q), RODS.value(q), rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(plain.jacobian(q[0, 0]), RODS.jacobian(q[0, 0]))


@SETTINGS
@given(entry=st.integers(0, 7), error=st.floats(1e-3, 10.0))
def test_a_wrong_gradient_is_refused_by_entry(entry, error):
    def gradient(q):
        wrong = WELLS.gradient(q)
        wrong[entry] += error * abs(wrong).max()
        return wrong

    with pytest.raises(InputError, match=rf"gradient of Potential: entry {entry} is .*finite differences .* give"):
        Potential(energy=WELLS.energy, gradient=gradient).bind(layout(2))


@SETTINGS
@given(row=st.integers(0, 7), column=st.integers(0, 7), error=st.floats(1e-3, 10.0))
def test_a_wrong_hessian_is_refused_by_entry(row, column, error):
    def hessian(q):
        wrong = WELLS.hessian(q)
        wrong[row, column] -= error * abs(wrong).max()
        return wrong

    with pytest.raises(InputError, match=rf"hessian of Potential: entry \({row}, {column}\) is"):
        Potential(energy=WELLS.energy, gradient=WELLS.gradient, hessian=hessian).bind(layout(2))


@SETTINGS
@given(row=st.integers(0, 1), column=st.integers(0, 7), error=st.floats(1e-3, 10.0))
def test_a_wrong_jacobian_is_refused_by_entry(row, column, error):
    def jacobian(q):
        wrong = RODS.jacobian(q)
        wrong[row, column] += error
        return wrong

    with pytest.raises(InputError, match=rf"jacobian of Constraints: entry \({row}, {column}\) is"):
        Constraints(value=RODS.value, jacobian=jacobian).bind(layout(2))


@pytest.mark.parametrize("name", POTENTIALS)
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_right_derivatives_pass_at_every_size(name, size):
    family = POTENTIALS[name](2).bind(layout(2))
    Potential(
        energy=lambda q: size * family.energy(q),
        gradient=lambda q: size * family.gradient(q),
        hessian=lambda q: size * family.hessian(q),
    ).bind(layout(2))


def test_a_function_that_writes_into_its_argument_does_no_harm():
    def energy(q):
        q *= q
        return 0.5 * q.sum()

    potential = Potential(energy=energy, gradient=lambda q: q).bind(layout(2))
    q = spread(2)
    before = q.copy()
    assert potential.energy(q) == potential.energy(q) == 0.5 * before @ before
    np.testing.assert_array_equal(q, before)


def test_a_function_that_returns_one_buffer_again_and_again_does_no_harm():
    buffer = np.empty(8)

    def gradient(q):
        buffer[:] = q
        return buffer

    potential = Potential(energy=lambda q: 0.5 * q @ q, gradient=gradient).bind(layout(2))
    first = potential.gradient(np.ones(8))
    potential.gradient(np.zeros(8))
    np.testing.assert_array_equal(first, np.ones(8))


def test_the_hessian_is_optional():
    assert Potential(energy=WELLS.energy, gradient=WELLS.gradient).bind(layout(2)).hessian(spread(2)) is None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Potential(energy=3.0), r"energy of Potential: found 3.0; pass a function"),
        (lambda: Potential(energy=WELLS.energy, gradient=2), r"gradient of Potential: found 2; pass a function"),
        (lambda: Constraints(value=None), r"value of Constraints: found None; pass a function"),
        (
            lambda: Potential(energy=lambda q: q, gradient=lambda q: q),
            r"energy of Potential: found shape \(8,\) at the initial state; it must return shape \(\)",
        ),
        (
            lambda: Potential(energy=lambda q: 0.0, gradient=lambda q: q[:3]),
            r"gradient of Potential: found shape \(3,\) at the initial state; it must return shape \(8,\)",
        ),
        (
            lambda: Potential(energy=lambda q: float("nan"), gradient=lambda q: q),
            r"energy of Potential: not finite at the initial state \(nan\); start where it is defined",
        ),
        (
            lambda: Potential(energy=lambda q: q[99], gradient=lambda q: q),
            r"energy of Potential: fails at the initial state: IndexError: index 99",
        ),
        (
            lambda: Potential(energy=lambda q: 1 / 0, gradient=lambda q: q),
            r"energy of Potential: fails at the initial state: ZeroDivisionError: division by zero",
        ),
        (
            lambda: Potential(energy=lambda q: 0.0, gradient=lambda q: 1j * q),
            r"gradient of Potential: found values of type complex128 at the initial state; return real numbers",
        ),
        (
            lambda: Potential(energy=lambda q: None, gradient=lambda q: q),
            r"energy of Potential: found values of type object at the initial state; return real numbers",
        ),
        (
            lambda: Constraints(value=lambda q: q[0], jacobian=lambda q: q),
            r"value of Constraints: found shape \(\); return a vector of shape \(rows,\), also for one row",
        ),
        (
            lambda: Constraints(value=lambda q: q[:1], jacobian=lambda q: q),
            r"jacobian of Constraints: found shape \(8,\) at the initial state; it must return shape \(1, 8\)",
        ),
    ],
)
def test_bad_functions_are_refused_with_what_to_do(make, message):
    with pytest.raises(InputError, match=message):
        make().bind(layout(2))


@pytest.mark.parametrize(
    ("make", "kind"),
    [(lambda: Potential(energy=WELLS.energy), "gradient"), (lambda: Constraints(value=RODS.value), "jacobian")],
)
def test_without_jax_a_missing_derivative_is_refused_with_the_install_line(make, kind, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=rf"no {kind} was given and JAX.*pip install '\.\[jax\]'"):
        make()


JAX_SCRIPT = """
import pickle
import jax, jax.numpy as jnp, numpy as np
import deli
from deli.mechanics.family import Layout

def energy(q):
    return jnp.sum(q**4) / 4 + q[0] * q[1]

def value(q):
    return jnp.stack([jnp.sqrt(q @ q) - 1.0])

q = np.array([0.3, -1.7, 2.0])
potential = deli.Potential(energy=energy).bind(Layout(1, np.ones(3), q))
np.testing.assert_allclose(potential.gradient(q), q**3 + q[[1, 0, 2]] * [1, 1, 0], rtol=1e-15)
np.testing.assert_allclose(potential.hessian(q), np.diag(3 * q**2) + [[0, 1, 0], [1, 0, 0], [0, 0, 0]], rtol=1e-15)
np.testing.assert_allclose(potential.energy(q), np.sum(q**4) / 4 + q[0] * q[1], rtol=1e-15)
rods = deli.Constraints(value=value).bind(Layout(1, np.ones(3), q))
np.testing.assert_allclose(rods.value(q), [np.linalg.norm(q) - 1.0], rtol=1e-15)
np.testing.assert_allclose(rods.jacobian(q), [q / np.linalg.norm(q)], rtol=1e-15)
np.testing.assert_array_equal(pickle.loads(pickle.dumps(potential)).gradient(q), potential.gradient(q))
assert not jax.config.jax_enable_x64
assert jnp.ones(1).dtype == "float32"
try:
    deli.Potential(energy=lambda q: np.sin(q).sum()).bind(Layout(1, np.ones(3), q))
except deli.InputError as error:
    assert "write it with jax.numpy instead of numpy, or pass gradient=" in str(error), error
else:
    raise AssertionError("a numpy energy was derived")
"""


def test_jax_makes_missing_derivatives_in_double_precision():
    pytest.importorskip("jax")
    # a process of its own: JAX keeps global state
    subprocess.run([sys.executable, "-c", JAX_SCRIPT], check=True, timeout=300)


def test_scene_checks_derivatives_at_its_initial_state():
    with pytest.raises(InputError, match=r"gradient of Potential: entry 1 is 0, finite differences .* give 2"):
        Scene(
            mass=1.0,
            position=[1.0, 1.0],
            momentum=[0.0, 0.0],
            potential=Potential(energy=lambda q: q[0] ** 2 + q[1] ** 2, gradient=lambda q: np.array([2 * q[0], 0.0])),
        )
