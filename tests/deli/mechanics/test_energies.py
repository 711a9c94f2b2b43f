import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanics_cases import configurations, layout, spread

from deli.errors import InputError, StepError
from deli.mechanics.energies import (
    hamiltonian,
    kinetic_energy,
    numerical_hamiltonian,
    potential_energy,
    reflection_metric,
)
from deli.mechanics.functions import Potential
from deli.mechanics.pair_potentials import LennardJones, Springs
from deli.mechanics.potentials import Gravity, RadialPowers
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import SCHEMES, get_scheme

SETTINGS = settings(max_examples=15, deadline=None)
SCHEME_NAMES = ("midpoint", "verlet")
schemes = pytest.mark.parametrize("scheme", SCHEME_NAMES)


def free_scene(**changes):
    """Four bodies of different masses on nonlinear springs in the plane, no constraint."""
    given = {
        "mass": layout(2).mass,
        "position": spread(2) + np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.2, 0.0, 0.1]),
        "momentum": np.array([0.5, -1.0, 0.3, 0.8, -0.6, 0.1, 0.9, -0.4]),
        "potential": [
            Gravity([0.5, -1.0]),
            Springs([(0, 1), (1, 2), (2, 3)], [1.0, 2.0, 3.0], 1.0),
            LennardJones(0.2, 1.0),
            RadialPowers([0.01], [4.0]),
        ],
        "dimension": 2,
    }
    return Scene(**(given | changes))


def flight(scene, scheme, h, steps):
    """Trajectory of unconstrained steps D1 + p = 0, p+ = D2, shapes (steps + 1, dof)."""
    scheme, q, p = get_scheme(scheme), scene.position, scene.momentum
    positions, momenta = [q], [p]
    for _ in range(steps):
        x = q + h * p / scene.mass
        for _ in range(100):
            previous, x = x, q + h * (p + scheme.first_force(scene.potential, q, x, h)) / scene.mass
            if not scheme.weights[1] or np.abs(x - previous).max() < 1e-15:
                break
        p = scene.mass * (x - q) / h + scheme.second_force(scene.potential, q, x, h)
        q = x
        positions.append(q)
        momenta.append(p)
    return np.array(positions), np.array(momenta)


@schemes
def test_numerical_hamiltonian_varies_with_the_fourth_power_of_the_step_where_the_hamiltonian_does_with_the_second(
    scheme,
):
    scene, ranges = free_scene(), []
    for steps in (200, 400, 800):
        h = 2.0 / steps
        q, p = flight(scene, scheme, h, steps)
        numerical = numerical_hamiltonian(scene, get_scheme(scheme), q, p, h)
        ranges.append([np.ptp(hamiltonian(scene, q, p)), np.ptp(numerical)])
    second, fourth = np.log2(np.array(ranges[:-1]) / np.array(ranges[1:])).T
    np.testing.assert_allclose(second, 2.0, atol=0.1)
    np.testing.assert_allclose(fourth, 4.0, atol=0.2)


@schemes
def test_free_flight_is_symmetric_in_time(scheme):
    scene = free_scene()
    q, p = flight(scene, scheme, 0.02, 50)
    back = free_scene(position=q[-1], momentum=-p[-1])
    q_back, p_back = flight(back, scheme, 0.02, 50)
    np.testing.assert_allclose(q_back[-1], scene.position, atol=1e-12)
    np.testing.assert_allclose(p_back[-1], -scene.momentum, atol=1e-12)


@schemes
@SETTINGS
@given(data=st.data(), h=st.floats(0.01, 0.2))
def test_force_slots_are_the_derivatives_of_the_discrete_lagrangian(scheme, data, h):
    # the potential part of L_d is -h V((q + x)/2) for midpoint (8.2), -(h/2) (V(q) + V(x)) for verlet (8.3)
    q, x = data.draw(configurations(2)), data.draw(configurations(2))
    potential = free_scene().potential

    def action(q, x):
        if scheme == "midpoint":
            return -h * potential.energy(0.5 * (q + x))
        return -0.5 * h * (potential.energy(q) + potential.energy(x))

    slots = get_scheme(scheme)
    unit, step = np.identity(q.size), 1e-5
    first = [(action(q + step * e, x) - action(q - step * e, x)) / (2.0 * step) for e in unit]
    second = [(action(q, x + step * e) - action(q, x - step * e)) / (2.0 * step) for e in unit]
    for slot, expected in ((slots.first_force, first), (slots.second_force, second)):
        force = slot(potential, q, x, h)
        np.testing.assert_allclose(force, expected, rtol=1e-6, atol=1e-6 * np.abs(force).max())


def test_an_implicit_scheme_is_one_whose_first_force_depends_on_the_end():
    potential, q = free_scene().potential, free_scene().position
    for name in SCHEME_NAMES:
        scheme = get_scheme(name)
        same = np.array_equal(scheme.first_force(potential, q, q, 0.1), scheme.first_force(potential, q, q + 0.1, 0.1))
        assert same == (not scheme.weights[1])


@pytest.mark.parametrize("name", ["euler", "", None, ["verlet"]])
def test_unknown_schemes_are_refused(name):
    with pytest.raises(InputError, match=r"scheme: found .*; choose one of 'midpoint', 'verlet'"):
        get_scheme(name)


def test_schemes_know_their_names():
    assert tuple(SCHEMES) == SCHEME_NAMES
    assert [get_scheme(name).name for name in SCHEME_NAMES] == list(SCHEME_NAMES)


@SETTINGS
@given(data=st.data())
def test_energies_of_a_batch_are_the_energies_one_by_one(data):
    scene = free_scene()
    q, p = data.draw(configurations(2, (2, 3))), data.draw(configurations(2, (2, 3)))
    energies = (
        lambda q, p: kinetic_energy(scene, p),
        lambda q, p: potential_energy(scene, q),
        lambda q, p: hamiltonian(scene, q, p),
        lambda q, p: numerical_hamiltonian(scene, get_scheme("verlet"), q, p, 0.1),
    )
    for energy in energies:
        together = energy(q, p)
        assert together.shape == (2, 3)
        one_by_one = [
            [energy(a, b) for a, b in zip(rows, columns, strict=True)] for rows, columns in zip(q, p, strict=True)
        ]
        np.testing.assert_allclose(together, one_by_one, rtol=1e-12)


@SETTINGS
@given(data=st.data())
def test_hamiltonian_is_half_p_v_plus_v(data):
    scene, q, p = free_scene(), data.draw(configurations(2)), data.draw(configurations(2))
    expected = 0.5 * p @ np.diag(1.0 / scene.mass) @ p + scene.potential.energy(q)
    assert hamiltonian(scene, q, p) == pytest.approx(expected, rel=1e-13)


@schemes
@SETTINGS
@given(data=st.data())
def test_the_metric_is_what_the_numerical_hamiltonian_makes_of_momentum(scheme, data):
    scene, h, slots = free_scene(), 0.05, get_scheme(scheme)
    q, before, after = (data.draw(configurations(2)) for _ in range(3))
    metric = reflection_metric(scene, slots, q, h)
    np.testing.assert_allclose(metric, metric.T, atol=1e-14)
    change = numerical_hamiltonian(scene, slots, q, after, h) - numerical_hamiltonian(scene, slots, q, before, h)
    assert change == pytest.approx(0.5 * (after @ metric @ after - before @ metric @ before), rel=1e-9, abs=1e-9)


def oscillator(curvature):
    """One body of mass 2 with V = curvature q^2 / 2; W = (1/2) (1 + c h^2 curvature / 2)."""
    return Scene(mass=2.0, position=1.0, momentum=0.0, potential=RadialPowers([0.5 * curvature], [2.0]))


@pytest.mark.parametrize(("scheme", "curvature"), [("midpoint", 3.0), ("verlet", -6.0)])
def test_a_step_too_large_for_the_metric_is_refused_with_the_largest_that_is_not(scheme, curvature):
    scene = oscillator(curvature)
    factor = {"midpoint": 1.0 / 12.0, "verlet": -1.0 / 6.0}[scheme]
    largest = np.sqrt(2.0 / (factor * curvature))
    metric = reflection_metric(scene, get_scheme(scheme), scene.position, 0.999 * largest)
    np.testing.assert_allclose(metric, [[0.5 * (1.0 - 0.999**2)]], rtol=1e-9)
    with pytest.raises(StepError, match=rf"step_size .* is too large for the {scheme} .* below {largest:.3g}"):
        reflection_metric(scene, get_scheme(scheme), scene.position, 1.001 * largest)


def test_a_potential_without_hessian_has_no_numerical_hamiltonian():
    scene = Scene(
        mass=1.0, position=1.0, momentum=1.0, potential=Potential(energy=lambda q: 0.5 * q @ q, gradient=lambda q: q)
    )
    verlet = get_scheme("verlet")
    with pytest.raises(InputError, match=r"the potential has no hessian; pass hessian=... to deli.Potential"):
        numerical_hamiltonian(scene, verlet, scene.position, scene.momentum, 0.1)
    with pytest.raises(InputError, match=r"the potential has no hessian; pass hessian=... to deli.Potential"):
        reflection_metric(scene, verlet, scene.position, 0.1)
