"""Problems of simultaneous impact with known answers, and where the law of Chatterjee and Ruina (1998) leads."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from law_cases import REFLECTION
from law_clusters import Cluster, clusters, tangent
from scipy.optimize import nnls

import deli


def outcome(scene: deli.Scene, operator: str, order: str) -> np.ndarray:
    return deli.reflect(scene, scene.position, scene.momentum, operator, order=order).reshape(scene.bodies, -1)


@REFLECTION
@pytest.mark.parametrize("balls", [2, 3, 5, 10, 50])
def test_cradle(balls: int, operator: str, order: str) -> None:
    scene = deli.impacts.cradle(balls)
    expected = np.zeros(balls)
    if operator == "moreau":
        expected[:] = 2.0 / balls  # a plastic impulse makes one body of all, which moves at 1/n
        expected[0] -= 1.0
    else:
        expected[-1] = 1.0
    np.testing.assert_allclose(outcome(scene, operator, order)[:, 0], expected, atol=1e-12)


@REFLECTION
@pytest.mark.parametrize("striker", [0.5, 1.0, 2.0, 20.0])
def test_bernoulli(striker: float, operator: str, order: str) -> None:
    scene = deli.impacts.bernoulli(striker)
    after = outcome(scene, operator, order)
    impulse = np.sqrt(3.0) / (1.5 / striker + 1.0)
    expected = np.array([[striker, 0.0], [0.0, 0.0], [0.0, 0.0]])
    expected += impulse * np.array([[-np.sqrt(3.0), 0.0], [np.sqrt(0.75), -0.5], [np.sqrt(0.75), 0.5]])
    if operator == "sequential":
        assert abs(after[1, 0] - after[2, 0]) > 0.05
        np.testing.assert_allclose(after.sum(axis=0), [striker, 0.0], atol=1e-13)
        assert (after**2).sum(axis=1) @ [1.0 / striker, 1.0, 1.0] == pytest.approx(striker, rel=1e-13)
    else:
        np.testing.assert_allclose(after, expected, atol=1e-13 * striker)


@REFLECTION
@pytest.mark.parametrize("rows", [2, 3, 4])
def test_rack_is_broken_symmetrically_unless_one_contact_comes_first(rows: int, operator: str, order: str) -> None:
    scene = deli.impacts.rack(rows)
    after = outcome(scene, operator, order)
    mirrored = [0, *(1 + row * (row + 1) // 2 + row - place for row in range(rows) for place in range(row + 1))]
    lopsided = np.abs(after[mirrored] * [1.0, -1.0] - after).max()
    assert lopsided > 0.1 if operator == "sequential" else lopsided <= 1e-13


@pytest.mark.parametrize("call", [deli.impacts.cradle, deli.impacts.rack])
def test_too_few_bodies_are_refused(call) -> None:
    with pytest.raises(deli.InputError, match="it must be >= 2"):
        call(1)


def collide(normal: np.ndarray, relative: np.ndarray, e_n: float, e_t: float, friction: float) -> np.ndarray:
    """Impulse of Chatterjee and Ruina's law at one contact of two discs of mass 1 that do not turn."""
    inertia = 2.0 * np.eye(2)
    frictionless = -(normal @ relative) / (normal @ inertia @ normal) * normal
    sticking = -np.linalg.solve(inertia, relative)
    across = sticking - frictionless
    impulse = (1.0 + e_n) * frictionless + (1.0 + e_t) * across
    sideways = np.linalg.norm(impulse - (impulse @ normal) * normal)
    if sideways <= friction * (impulse @ normal):
        return impulse
    slid = np.linalg.norm(sticking - (sticking @ normal) * normal) - friction * (normal @ across)
    share = friction * (1.0 + e_n) * (normal @ frictionless) / slid
    return (1.0 + e_n) * frictionless + share * across


@pytest.mark.parametrize("rows", [2, 3, 4])
@pytest.mark.parametrize("seed", range(5))
def test_the_single_contact_law_fastest_first_is_the_sequential_operator(rows: int, seed: int) -> None:
    scene = deli.impacts.rack(rows)
    q = scene.position.reshape(-1, 2)
    velocity = np.random.default_rng(seed).standard_normal(q.shape)
    start = velocity.copy()
    pairs = np.argwhere(np.triu(np.linalg.norm(q[:, None] - q, axis=2) < 1.0 + 1e-9, 1))
    directions = q[pairs[:, 0]] - q[pairs[:, 1]]
    while True:
        rates = ((velocity[pairs[:, 0]] - velocity[pairs[:, 1]]) * directions).sum(axis=1)
        if rates.min() >= -1e-8:
            break
        one, two = pairs[rates.argmin()]
        impulse = collide(directions[rates.argmin()], velocity[one] - velocity[two], e_n=1.0, e_t=0.3, friction=0.0)
        velocity[one] += impulse
        velocity[two] -= impulse
    after = deli.reflect(scene, scene.position, start, "sequential", order="fastest")
    np.testing.assert_allclose(after.reshape(q.shape), velocity, atol=1e-11)


def twice_plastic(cluster: Cluster) -> np.ndarray:
    """p + 2 P_I with the impulse of a frictionless plastic collision at all contacts: argmin ½|p + Gλ|² in M⁻¹."""
    root = np.sqrt(cluster.mass)
    rows = np.array([tangent(row, cluster.mass, cluster.bilateral) for row in cluster.gradients]) / root
    rows /= np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None]
    return cluster.momentum + 2.0 * root * (nnls(rows.T, -cluster.momentum / root)[0] @ rows)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(cluster=clusters())
def test_twice_the_plastic_impulse_of_all_contacts_is_moreau_where_none_separates(cluster: Cluster) -> None:
    closing = cluster.approach(cluster.momentum) <= 1e-12
    assume(closing.any())
    cluster = replace(cluster, gradients=cluster.gradients[closing])
    scene = cluster.scene()
    after = deli.reflect(scene, scene.position, scene.momentum, "moreau")
    np.testing.assert_allclose(after, twice_plastic(cluster), atol=1e-9 * np.abs(cluster.momentum).max())


@pytest.mark.parametrize(("speed", "same"), [(0.4, False), (0.6, True)])
def test_twice_the_plastic_impulse_of_all_contacts_differs_where_it_would_close_one_that_separates(
    speed: float, same: bool
) -> None:
    """Stopped against the second ball, the first pair moves at 1/2: a third ball that is slower is pressed too."""
    rows = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    cluster = Cluster(np.ones(3), np.array([1.0, 0.0, speed]), rows, np.zeros((0, 3)), np.zeros((3, 3)))
    scene, plastic = cluster.scene(), twice_plastic(cluster)
    after = deli.reflect(scene, scene.position, scene.momentum, "moreau")
    np.testing.assert_allclose(np.sort(after), np.sort(cluster.momentum), atol=1e-14)
    first_pass = np.array([0.0, 1.0, speed])
    assert np.allclose(plastic, first_pass, atol=1e-14) == same
