"""Impacts without end, as in ``studies/repeated_impacts``: a wall under q⁴/4, and rods whose motion is known."""

import functools

import numpy as np
import pytest
import xarray as xr
from hypothesis import example, given, settings
from hypothesis import strategies as st

import deli
from deli.figures.exact import passing_points

LONG = functools.partial(pytest.param, marks=pytest.mark.long)
BAND = {"midpoint": 4.165e-4, "verlet": 8.34e-4}
"""Largest |H − H(0)| / H(0) of free motion under q⁴/4 from rest at 1, h = .05; the trapezoidal rule's is Verlet's."""
REFLECTING = [
    *(
        deli.GVI(scheme=scheme, energy=energy, predictor=predictor)
        for scheme in BAND
        for energy in ("hamiltonian", "numerical")
        for predictor in ("forward", "closed_loop")
    ),
    *(deli.Collision(scheme, energy) for scheme in BAND for energy in ("hamiltonian", "numerical")),
    deli.MoreauJean(),
]
PERIODS = [(deli.GVI("midpoint"), 74), (deli.GVI("verlet"), 74), (deli.MoreauJean(), 75)]
ABSORBING = [deli.Direct("endpoint"), deli.Newmark(), deli.Newmark(imex=True), deli.Newmark(0.0, imex=True)]
PERMUTING = [
    deli.GVI(reflection="sequential"),
    deli.GVI(reflection="sequential", predictor="closed_loop"),
    *(deli.Collision(energy=energy) for energy in ("hamiltonian", "discrete", "numerical")),
]


def record(scene: deli.Scene, method: object, step_size: float, steps: int) -> xr.Dataset:
    run = deli.simulate(scene, method, step_size=step_size, steps=steps)
    assert run.attrs["outcome"] == "complete"
    return run["trajectory"]


def wall(method: object, steps: int, momentum: float = 0.0) -> xr.Dataset:
    return record(deli.scenes.quartic_wall(momentum=momentum), method, 0.05, steps)


def energy_error(run: xr.Dataset) -> float:
    energy = run["hamiltonian"].values
    return float(np.abs(energy / energy[0] - 1.0).max())


def position_error(run: xr.Dataset) -> float:
    exact = passing_points(deli.scenes.hard_rods(), run["time"].values)
    return float(np.abs(run["position"].values - exact).max())


def speeds(run: xr.Dataset) -> np.ndarray:
    return np.sort(np.abs(run["momentum"].values), axis=1)


@pytest.mark.parametrize("steps", [3000, LONG(100_000)])
@pytest.mark.parametrize("method", REFLECTING, ids=str)
def test_a_wall_leaves_the_energy_band_of_free_motion(method: object, steps: int) -> None:
    """V is even, so that the motion is the absolute value of one that passes through the wall."""
    run = wall(method, steps)
    band = BAND[getattr(method, "scheme", "verlet")]
    assert 0.9 * band < energy_error(run) <= band
    assert run["gap_min"].values.min() >= 0.0


@pytest.mark.parametrize("scheme", BAND)
def test_that_band_is_that_of_free_motion(scheme: str) -> None:
    passing = wall(deli.DiscreteSmooth(scheme), 3000)
    assert 0.99 * BAND[scheme] < energy_error(passing) <= BAND[scheme]
    assert passing["gap_min"].values.min() < -0.99


@pytest.mark.parametrize(("method", "period"), PERIODS, ids=str)
def test_bounces_retrace_their_path(method: object, period: int) -> None:
    """A bounce only turns the momentum of a symmetric map round, so that it goes back the way that it came.

    In Moreau and Jean's scheme that takes a step, in which the position stays.
    """
    places = wall(method, 20_000)["position"].values.round(8)
    np.testing.assert_array_equal(places[period:], places[:-period])


@pytest.mark.parametrize(
    ("momentum", "energy", "gap"),
    [(0.0, 0.0008330619, 0.0029838906), (0.5, 0.0009718436, -0.0152819555)],
)
def test_moreau_jean_is_that_of_siconos(momentum: float, energy: float, gap: float) -> None:
    """Figures of MoreauJeanOSI of Siconos 4.4, θ = ½, from q = 1."""
    run = wall(deli.MoreauJean(), 3000, momentum)
    assert energy_error(run) == pytest.approx(energy, rel=1e-5)
    assert run["gap_min"].values.min() == pytest.approx(gap, abs=1e-9)


@pytest.mark.parametrize("method", ABSORBING, ids=str)
def test_constraint_forces_at_the_endpoint_absorb_all_energy(method: object) -> None:
    run = wall(method, 20_000)
    energy = run["hamiltonian"].values / 0.25
    assert energy.max() <= 1.0 + BAND["verlet"]
    assert energy[-1] < 1e-3
    assert run["gap_min"].values.min() >= -1e-12


def test_constraint_forces_at_the_midpoint_let_energy_explode() -> None:
    run = wall(deli.Direct("midpoint"), 20_000)
    assert run["hamiltonian"].values.max() > 1e3
    assert run["gap_min"].values.min() < -1.0


@pytest.mark.parametrize("steps", [3000, LONG(100_000)])
@pytest.mark.parametrize("method", PERMUTING, ids=str)
def test_rods_exchange_velocities(method: object, steps: int) -> None:
    run = record(deli.scenes.hard_rods(), method, 0.01, steps)
    assert run["reflected_contacts"].values.sum() > 0.02 * steps
    ordered = speeds(run)
    assert np.abs(ordered - ordered[0]).max() <= 1e-15 * steps**0.5
    collides, closes = isinstance(method, deli.Collision), getattr(method, "predictor", "") == "closed_loop"
    if collides:
        assert position_error(run) <= 1e-15 * steps
    if collides or closes:
        assert run["gap_min"].values.min() >= -1e-12


@pytest.mark.parametrize("steps", [5000, LONG(100_000)])
@pytest.mark.parametrize("predictor", ["forward", "closed_loop"])
def test_only_blows_that_share_a_rod_change_the_set_of_speeds(predictor: str, steps: int) -> None:
    """Reflected at once, they share out energy; one at a time, they exchange velocities."""
    run = record(deli.scenes.hard_rods(), deli.GVI(predictor=predictor), 0.01, steps)
    changed = np.flatnonzero(np.abs(np.diff(speeds(run), axis=0)).max(axis=1) > 1e-9)
    turned = np.abs(np.diff(run["momentum"].values, axis=0)) > 1e-9
    for step in changed:
        assert run["reflected_contacts"].values[step + 1] >= 2
        assert (np.diff(np.flatnonzero(turned[step])) == 1).sum() >= 2  # three rods in a row
    assert len(changed) > 0 or (predictor, steps) == ("forward", 5000)
    assert energy_error(run) <= 1e-14


def test_positions_of_rods_converge_at_first_order() -> None:
    errors = {}
    for method in (deli.GVI(), deli.MoreauJean()):
        for refined in (1, 16):
            run = record(deli.scenes.hard_rods(), method, 0.01 / refined, 1000 * refined)
            errors[type(method), refined] = position_error(run)
        assert 8.0 < errors[type(method), 1] / errors[type(method), 16] < 32.0


def impacts(method: object, duration: float) -> int:
    run = record(deli.scenes.hard_rods(rods=2), method, 0.02, round(duration / 0.02))
    return int((run["reflected_contacts"] + run["smooth_contacts"]).values.sum())


def test_gvi_turns_rods_early_and_moreau_jean_late() -> None:
    """By half a step on average: the first takes momenta at the start of the step that meets, the second after it."""
    early, exact, late = (impacts(method, 2000.0) for method in (deli.GVI(), deli.Collision(), deli.MoreauJean()))
    assert early > exact > late


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    height=st.floats(-12.0, 3.0),
    slope=st.floats(-14.0, 0.0),
    share=st.floats(0.01, 3.0),
    predictor=st.sampled_from(["forward", "closed_loop"]),
)
@example(height=-8.0, slope=-8.0, share=0.3, predictor="forward")
def test_no_approach_is_too_slow_to_be_stopped(height: float, slope: float, share: float, predictor: str) -> None:
    """Steps that are long against the only length there is cross the band of touching gaps without an end in it."""
    start, speed = 10.0**height, 10.0**slope
    scene = deli.scenes.wedge(walls=1, gravity=0.0, position=[0.0, start], momentum=[1.0, -speed])
    run = record(scene, deli.GVI(predictor=predictor), share * start / speed, 1000)
    assert run["gap_min"].values.min() >= -1e-8 * start
    assert energy_error(run) <= 1e-14
    assert run["reflected_contacts"].values.sum() > 0
