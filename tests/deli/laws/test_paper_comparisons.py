"""What the paper's figures show of the methods that it compares with."""

import numpy as np
import pytest

import deli


def trajectory(scene, method, h, **length):
    run = deli.simulate(scene, method, step_size=h, **length)
    assert run.attrs["outcome"] == "complete"
    return run["trajectory"]


def restitutions(start, constraint, h=0.01):
    """Energy after each bounce of a dropped mass, as a share of that before."""
    record = trajectory(deli.scenes.point_mass(position=start), deli.Direct(constraint), h, duration=3.0)
    energy = record["hamiltonian"].values
    changes = np.flatnonzero(np.abs(np.diff(energy)) > 1e-9 * energy[0])
    return energy[changes + 1] / energy[changes]


def test_figure_1_3_the_midpoint_method_gives_back_too_much_or_too_little():
    shares = restitutions(1.0, "midpoint")
    assert shares.max() > 1.01
    assert shares.min() < 0.99


def test_figure_1_3_the_endpoint_method_loses_what_the_start_decides():
    kept = []
    for start in (1.0, 1.01, 1.02):
        shares = restitutions(start, "endpoint")
        assert shares.max() <= 1.0 + 1e-12
        kept.append(shares[:2].prod())
    assert max(kept) > 5.0 * min(kept)


@pytest.mark.parametrize("start", ["smooth", "mixed"])
def test_figures_5_1_and_8_3_the_endpoint_method_loses_energy_and_angular_momentum(start):
    scene = deli.scenes.spring_sphere(start=start)
    record = trajectory(scene, deli.Direct("endpoint"), 0.5, duration=100.0)
    energy, angular = record["hamiltonian"].values, record["angular_momentum"].values
    assert energy[-1] < energy[0] - 1.5
    assert abs(angular[-1]) < abs(angular[0]) - 5.0
    kept = trajectory(scene, deli.GVI(), 0.5, duration=100.0)
    assert np.abs(kept["angular_momentum"].values - angular[0]).max() < 1e-11
    assert np.abs(kept["hamiltonian"].values - energy[0]).max() < 0.1
    if start == "mixed":
        # The first particle's bouncing dies under the endpoint method, and goes on under GVI.
        late = [run["position"].values[-50:, :2] for run in (record, kept)]
        ended, bouncing = (np.ptp(np.linalg.norm(rows, axis=1)) for rows in late)
        assert ended < 0.1 * bouncing


def test_figure_8_2_of_the_oscillator():
    scene = deli.scenes.nonlinear_oscillator()
    endpoint = trajectory(scene, deli.Direct("endpoint"), 0.1, duration=300.0)
    energy, angular = endpoint["hamiltonian"].values, endpoint["angular_momentum"].values
    assert energy.min() < energy[0] - 1.0
    assert np.abs(angular - angular[0]).max() > 0.5
    bounds = {}
    for linearized in (False, True):
        record = trajectory(scene, deli.GVI(linearized=linearized), 0.1, duration=300.0)
        energy, angular = record["hamiltonian"].values, record["angular_momentum"].values
        assert np.abs(energy - energy[0]).max() < 0.13
        bounds[linearized] = np.abs(angular - angular[0]).max()
    assert bounds[False] < 1e-11
    assert bounds[True] > 0.1
