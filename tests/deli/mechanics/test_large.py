"""A scene of 100,000 bodies: made, measured and searched without anything dense."""

import time

import numpy as np
import pytest

from deli.errors import InputError
from deli.mechanics.constraints import Planes
from deli.mechanics.distances import Rods, SpheresApart, SpheresInside
from deli.mechanics.energies import hamiltonian, numerical_hamiltonian
from deli.mechanics.pair_potentials import Springs
from deli.mechanics.potentials import Gravity, RadialPowers
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import SCHEMES
from deli.mechanics.symmetry import angular_momentum, linear_momentum

BODIES = 100_000
SIDE = 47
SECONDS = 10.0
"""Generous: a few tenths are used, and anything dense would not fit in memory at all."""


@pytest.fixture(scope="module")
def lattice():
    places = np.stack(np.unravel_index(np.arange(BODIES), (SIDE, SIDE, SIDE)), axis=1).astype(float)
    return places + np.random.default_rng(1).uniform(-0.1, 0.1, places.shape)


@pytest.fixture(scope="module")
def made(lattice):
    start = time.perf_counter()
    number = np.arange(0, BODIES - 1, 2)
    scene = Scene(
        mass=2.0,
        position=lattice,
        momentum=np.ones((BODIES, 3)),
        potential=[
            Gravity([0.0, 0.0, -9.8]),
            Springs(np.stack([number, number + 1], axis=1), 1.0, 1.0),
            RadialPowers([1.0], [2.0]),
        ],
        unilateral=[
            Planes([0.0, 0.0, 1.0], offsets=-1.0),
            SpheresApart(None, 0.8, period=float(SIDE)),
            SpheresInside(200.0),
        ],
        bilateral=[Rods([(0, 1)], np.linalg.norm(lattice[0] - lattice[1]))],
        dimension=3,
    )
    return scene, time.perf_counter() - start


def test_a_large_scene_is_made_quickly(made):
    scene, seconds = made
    assert scene.unilateral.rows == 2 * BODIES
    assert seconds < SECONDS


def test_neighbours_are_found_quickly(made):
    scene, _ = made
    start = time.perf_counter()
    rows = scene.unilateral.neighbours(scene.position, 0.3)
    assert time.perf_counter() - start < SECONDS
    assert 2 * BODIES + 100_000 < rows.kind.size < 2 * BODIES + 1_000_000


def test_energies_and_momenta_of_a_large_scene(made):
    scene, _ = made
    q, p = scene.position, scene.momentum
    energy = hamiltonian(scene, q, p)
    assert np.isfinite(energy)
    for scheme in SCHEMES.values():
        assert numerical_hamiltonian(scene, scheme, q, p, 1e-3) == pytest.approx(energy, rel=1e-3)
    np.testing.assert_allclose(linear_momentum(scene, p), np.full(3, BODIES), rtol=1e-12)
    assert angular_momentum(scene, q, p).shape == (3,)
    assert scene.symmetry.linear == (False, False, False)


def test_values_of_planes_without_a_matrix(made):
    scene, _ = made
    planes, q = scene.unilateral.families[0], scene.position
    np.testing.assert_allclose(planes.value(np.stack([q, 2.0 * q])), [q[2::3] + 1.0, 2.0 * q[2::3] + 1.0])


def test_planes_without_a_matrix_are_the_same(monkeypatch):
    normals, q = np.arange(1.0, 13.0).reshape(4, 3), np.arange(12.0)
    scene = Scene(1.0, q, 0.0 * q, unilateral=Planes(normals), dimension=3)
    monkeypatch.setattr("deli.mechanics.constraints.LARGEST_MATRIX", 0)
    large = Scene(1.0, q, 0.0 * q, unilateral=Planes(normals), dimension=3)
    np.testing.assert_array_equal(large.unilateral.jacobian(q), scene.unilateral.jacobian(q))
    np.testing.assert_allclose(large.unilateral.value(q), scene.unilateral.value(q), rtol=1e-14)


def test_one_bad_body_of_many_is_named(lattice):
    moved = lattice.copy()
    moved[54_321] = lattice[77_777] + [0.01, 0.0, 0.0]
    with pytest.raises(InputError, match=r"unilateral constraint \(gap body 54321 - body 77777\) has value -0.79"):
        Scene(1.0, moved, 0.0 * moved, unilateral=SpheresApart(None, 0.8), dimension=3)
    moved[54_321, 2] = -5.0
    with pytest.raises(InputError, match=r"unilateral constraint 54321 \(plane under body 54321\) has value -4.8 "):
        Scene(1.0, moved, 0.0 * moved, unilateral=Planes([0.0, 0.0, 1.0], offsets=-0.2), dimension=3)
