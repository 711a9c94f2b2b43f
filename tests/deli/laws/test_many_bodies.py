"""Scenes of many bodies: exact solutions, rest, conservation; searching and islands change nothing."""

import dataclasses

import numpy as np
import pytest
from law_runs import Run, difference, growth, run

import deli

SPHERES = 256  # more than are listed pair by pair


def gas(**parameters: object) -> deli.Scene:
    return deli.scenes.hard_sphere_gas(**{"spheres": SPHERES, "filled": 0.3, **parameters})


@pytest.mark.parametrize("boundary", ["walls", "ring"])
@pytest.mark.parametrize("predictor", ["forward", "closed_loop"])
def test_velocities_of_equal_rods_permute(boundary: str, predictor: str) -> None:
    scene = deli.scenes.hard_rods(rods=12, boundary=boundary)
    result = run(scene, deli.GVI(predictor=predictor), 0.01, 1500)
    assert result.reflected.sum() > 50
    velocities = result.momentum / scene.mass
    if boundary == "walls":
        velocities = np.abs(velocities)
    ordered = np.sort(velocities, axis=1)
    assert np.abs(ordered - ordered[0]).max() < 1e-12


@pytest.mark.parametrize("boundary", ["periodic", "box"])
def test_a_gas_keeps_energy_and_momentum(boundary: str) -> None:
    parameters = {} if boundary == "periodic" else {"boundary": "walls"}
    scene = gas(**parameters)
    assert scene.unilateral.searched
    result = deli.simulate(scene, deli.GVI(), step_size=0.01, steps=150)["trajectory"]
    assert result["reflected_contacts"].values.sum() > 50
    energy = result["hamiltonian"].values
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-12
    if boundary == "periodic":
        drift = result["linear_momentum"].values - result["linear_momentum"].values[0]
        assert np.abs(drift).max() < 1e-11


def struck(speed: float) -> deli.Scene:
    """A dense gas at rest that twenty heavy spheres run into: a blow can outrun the neighbours that were searched."""
    mass, momentum = np.ones(SPHERES), np.zeros((SPHERES, 3))
    mass[:20] = 50.0
    momentum[:20] = 50.0 * speed * np.array([0.8, 0.5, 0.33]) * np.linspace(0.5, 1.0, 20)[:, np.newaxis]
    return dataclasses.replace(gas(filled=0.45), mass=mass, momentum=momentum)


@pytest.mark.parametrize(
    ("predictor", "speed", "steps"),
    [("forward", 0.0, 60), ("closed_loop", 0.0, 60), ("forward", 20.0, 60), ("closed_loop", 40.0, 12)],
)
def test_searching_neighbours_changes_nothing(predictor: str, speed: float, steps: int) -> None:
    searched = struck(speed) if speed else gas()
    (family,) = searched.unilateral.families
    pairs = np.stack(np.triu_indices(SPHERES, 1), axis=1)
    listed = dataclasses.replace(searched, unilateral=[dataclasses.replace(family, pairs=pairs)])
    assert searched.unilateral.searched
    assert not listed.unilateral.searched
    trees = [
        deli.simulate(scene, deli.GVI(predictor=predictor), step_size=0.01, steps=steps) for scene in (searched, listed)
    ]
    runs = [tree["trajectory"] for tree in trees]
    assert runs[0]["reflected_contacts"].values.sum() > 20
    for name in ("solves", "skipped", "rows"):
        np.testing.assert_array_equal(*(tree["solver_stats"][name].values for tree in trees))
    for name in ("position", "momentum", "gap_min", "reflected_contacts"):
        np.testing.assert_array_equal(runs[0][name].values, runs[1][name].values)


def test_a_gas_restarts_to_the_bit() -> None:
    scene = gas()
    method = deli.GVI()
    whole = deli.simulate(scene, method, step_size=0.01, steps=60)["trajectory"]
    half = dataclasses.replace(scene, position=whole["position"].values[25], momentum=whole["momentum"].values[25])
    rest = method.stepper(scene, 0.01)
    q, p = half.position, half.momentum
    for row in range(26, 61):
        q, p = rest.step(q, p)
        np.testing.assert_array_equal(q, whole["position"].values[row])
        np.testing.assert_array_equal(p, whole["momentum"].values[row])


@pytest.mark.parametrize(("rows", "columns"), [(4, 4), (12, 10)])
def test_a_pile_stays_at_rest(rows: int, columns: int) -> None:
    scene = deli.scenes.disc_pile(rows=rows, columns=columns)
    result = deli.simulate(scene, deli.GVI(), step_size=0.01, steps=30)["trajectory"]
    assert result["smooth_contacts"].values[-1] > 2 * rows * (columns - 1)
    assert np.abs(result["position"].values - scene.position).max() < 1e-12
    assert np.abs(result["momentum"].values).max() < 1e-12
    assert result["gap_min"].values.min() > -1e-13


@pytest.mark.parametrize("masses", [20, 120])
def test_a_chain_slides_on_its_cylinder(masses: int) -> None:
    scene = deli.scenes.chain_on_cylinder(masses=masses)
    errors = []
    for step_size in (0.004, 0.002):
        result = deli.simulate(scene, deli.GVI(), step_size=step_size, duration=0.12)["trajectory"]
        assert (result["smooth_contacts"].values[1:] == masses).all()
        assert np.abs(result["equality_residual"].values).max() < 1e-13
        assert np.abs(result["gap_min"].values).max() < 1e-12
        energy = result["hamiltonian"].values
        errors.append(np.abs(energy - energy[0]).max() / np.ptp(result["potential_energy"].values))
    assert errors[1] < 2e-5
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_large_islands_are_solved_like_small_ones() -> None:
    """Some 180 rows press at once: over sparse factors by default, through the dense model with daqp."""
    scene = deli.scenes.chain_on_cylinder(masses=90)
    sparse, dense = (run(scene, deli.GVI(), 0.002, 5, solvers=solvers) for solvers in ("auto", "daqp"))
    assert sparse.backends == {"native"}
    assert dense.backends == {"daqp"}
    method = deli.GVI()
    assert difference(sparse, dense) <= growth(sparse, method, 0.002) * (sparse.rounding + dense.rounding)


def test_clusters_that_do_not_touch_are_reflected_as_each_alone() -> None:
    mass, momentum = np.arange(1.0, 7.0), np.array([1.0, 0.0, -1.0, 3.0, 0.0, -2.0])
    position = np.array([-1.0, 0.0, 1.0, 9.0, 10.0, 11.0])
    pairs = np.array([(0, 1), (1, 2), (3, 4), (4, 5)])

    def reflected(bodies: slice, chosen: np.ndarray) -> np.ndarray:
        q, p = position[bodies], momentum[bodies]
        return deli.reflect(deli.Scene(mass[bodies], q, p, unilateral=deli.SpheresApart(chosen, 1.0)), q, p)

    alone = [reflected(slice(3), pairs[:2]), reflected(slice(3, 6), pairs[2:] - 3)]
    assert (np.sign(np.concatenate(alone)) != np.sign(momentum)).sum() >= 4
    np.testing.assert_allclose(reflected(slice(6), pairs), np.concatenate(alone), rtol=1e-12)


def test_rods_that_do_not_meet_hold_as_each_alone() -> None:
    """Each hangs from a bead on a track: the equation of the track holds at once, that of the rod does not."""

    def swinging(tracks: np.ndarray) -> Run:
        beads, rods = 2 * np.arange(len(tracks)), len(tracks)
        position = np.repeat(np.arange(2 * rods), 2).reshape(-1, 2) * [1.0, 0.0]
        momentum = np.tile([[0.0, 0.0], [0.0, -1.0]], (rods, 1))
        scene = deli.Scene(
            mass=np.tile([1.0, 2.0], rods),
            position=position,
            momentum=momentum,
            potential=deli.Gravity([0.0, -9.8]),
            bilateral=[
                deli.Planes(tracks, offsets=np.vecdot(tracks, position[beads]), bodies=beads),
                deli.Rods(np.stack([beads, beads + 1], axis=1), 1.0),
            ],
            dimension=2,
        )
        return run(scene, deli.GVI(), 0.02, 50)

    tracks = np.array([[0.0, 1.0], [0.3, 1.0], [-0.6, 1.0]])
    together = swinging(tracks)
    assert np.abs(together.scene.bilateral.value(together.position)).max() <= 1e-12
    for k, track in enumerate(tracks):
        alone = swinging(track[np.newaxis])
        moved = together.position[:, 4 * k : 4 * k + 4] - [2.0 * k, 0.0, 2.0 * k, 0.0]
        np.testing.assert_allclose(moved, alone.position, atol=1e-11)


@pytest.mark.parametrize("beads", [10, 300])
def test_a_struck_chain_of_beads_keeps_energy_and_momentum(beads: int) -> None:
    scene = deli.scenes.granular_chain(beads=beads)
    result = run(scene, deli.GVI(), 0.01, 40)
    assert result.reflected.max() == beads - 1
    energies = result.energy
    assert np.abs(energies / energies[0] - 1.0).max() < 1e-12
    assert np.abs(result.momentum.sum(axis=1) - scene.momentum.sum()).max() < 1e-12
    velocities = result.momentum[1] / scene.mass
    assert np.diff(velocities).min() > -1e-7  # none approaches another
