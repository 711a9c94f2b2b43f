"""Tolerances are free of scale: in other units, or with constraints multiplied by a number, a run is the same."""

from dataclasses import replace

import numpy as np
import pytest
from law_cases import CASE, CASES, SKIP, Case
from law_runs import Run, difference, growth, run
from law_units import IN_UNITS, Units, rescaled_constraints

import deli

FACTORS = [
    Units(length=1e6),
    Units(length=1e-6),
    Units(mass=1e6),
    Units(mass=1e-6),
    Units(time=1e6),
    Units(time=1e-6),
    Units(length=1e-6, mass=1e6, time=1e6),
]
FACTOR = pytest.mark.parametrize(
    "units", [pytest.param(units, id=f"{units.length:g}-{units.mass:g}-{units.time:g}") for units in FACTORS]
)


def back(of: Run, units: Units) -> Run:
    """The run in the units it had before."""
    return replace(of, position=of.position / units.length, momentum=of.momentum / units.momentum)


def check_same(one: Run, other: Run, grown: float) -> None:
    np.testing.assert_array_equal(one.smooth, other.smooth)
    np.testing.assert_array_equal(one.reflected, other.reflected)
    assert difference(one, other) <= grown * (one.rounding + other.rounding)


@CASE
@FACTOR
def test_other_units(case: Case, units: Units) -> None:
    method = deli.GVI(scheme=case.scheme, energy="numerical" if units is FACTORS[-1] else "hamiltonian")
    plain = run(IN_UNITS[case.name](Units()), method, case.step_size, case.steps)
    scaled = run(IN_UNITS[case.name](units), method, case.step_size * units.time, case.steps)
    check_same(plain, back(scaled, units), growth(plain, method, case.step_size))


@CASE
@pytest.mark.parametrize("units", [FACTORS[-1]], ids=["all"])
@pytest.mark.parametrize("backend", ["daqp", "clarabel", "osqp"])
def test_other_units_through_solvers(case: Case, units: Units, backend: str) -> None:
    method, steps = deli.GVI(scheme=case.scheme, predictor="closed_loop"), case.steps // 2
    options = {"solvers": backend, "skip": False}
    plain = run(IN_UNITS[case.name](Units()), method, case.step_size, steps, **options)
    scaled = run(IN_UNITS[case.name](units), method, case.step_size * units.time, steps, **options)
    check_same(plain, back(scaled, units), growth(plain, method, case.step_size))


@CASE
@SKIP
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_constraints_multiplied_by_a_number(case: Case, factor: float, skip: bool) -> None:
    method, scene = deli.GVI(scheme=case.scheme), case.build()
    plain = run(scene, method, case.step_size, case.steps // 2, skip=skip)
    scaled = run(rescaled_constraints(scene, factor), method, case.step_size, case.steps // 2, skip=skip)
    check_same(plain, scaled, growth(plain, method, case.step_size))


@FACTOR
@pytest.mark.parametrize("tolerance", [1e-8, 1e-4])
@pytest.mark.parametrize("normal", [1e-6, 1.0, 1e6])
def test_contact_tolerance_is_a_fraction_in_any_units(units: Units, tolerance: float, normal: float) -> None:
    """A body that slides on a floor: which heights count as touching, which normal velocities as resting."""

    def contacts(height: float, rate: float) -> tuple[int, int]:
        scene = deli.Scene(
            mass=2.0 * units.mass,
            position=np.array([1.0, height]) * units.length,
            momentum=2.0 * np.array([1.0, rate]) * units.momentum,
            unilateral=deli.Planes(normals=[0.0, normal]),
            dimension=2,
        )
        stepper = deli.GVI().stepper(scene, 1e-12 * units.time, contact_tolerance=tolerance)
        stepper.step(scene.position, scene.momentum)
        return stepper.stats.smooth_contacts, stepper.stats.reflected_contacts

    below, above = 0.5 * tolerance, 2.0 * tolerance
    assert contacts(0.0, 0.0) == contacts(below, below) == contacts(below, -below) == (1, 0)
    assert contacts(0.0, above) == contacts(above, 0.0) == contacts(above, -above) == (0, 0)
    assert contacts(0.0, -above) == contacts(below, -above) == (0, 1)


def test_the_scenes_in_plain_units_are_those_of_the_laws() -> None:
    assert list(IN_UNITS) == [case.name for case in CASES]
    for case in CASES:
        scene, same = case.build(), IN_UNITS[case.name](Units())
        np.testing.assert_allclose(same.position, scene.position, rtol=1e-15)
        np.testing.assert_allclose(same.momentum, scene.momentum, rtol=1e-15)
        moved = run(scene, deli.GVI(scheme=case.scheme), case.step_size, 5).position[-1]
        np.testing.assert_allclose(
            run(same, deli.GVI(scheme=case.scheme), case.step_size, 5).position[-1], moved, rtol=1e-12, atol=1e-12
        )
