"""Scenes of plain Python functions move as the same scenes of tables do."""

import numpy as np
import pytest
from law_cases import FEW_SHADOW_METHODS, METHODS
from law_runs import difference, growth, run

import deli


def cradle() -> tuple[deli.Scene, deli.Scene]:
    """Newton's cradle as a table, and as functions."""
    table = deli.scenes.newtons_cradle(balls=4)
    balls, start = table.bodies, table.position.reshape(-1, 2)
    pivots = np.stack([0.5 * (np.arange(balls) - 0.5 * (balls - 1)), np.zeros(balls)], axis=1)
    weight = np.tile([0.0, 9.8], balls) * table.mass

    def rods(q):
        return np.linalg.norm(q.reshape(-1, 2) - pivots, axis=1) - 1.0

    def rods_jacobian(q):
        arms = q.reshape(-1, 2) - pivots
        jacobian = np.zeros((balls, balls, 2))
        jacobian[range(balls), range(balls)] = arms / np.linalg.norm(arms, axis=1, keepdims=True)
        return jacobian.reshape(balls, -1)

    def gaps(q):
        return np.linalg.norm(np.diff(q.reshape(-1, 2), axis=0), axis=1) - 0.5

    def gaps_jacobian(q):
        apart = np.diff(q.reshape(-1, 2), axis=0)
        normals = apart / np.linalg.norm(apart, axis=1, keepdims=True)
        jacobian = np.zeros((balls - 1, balls, 2))
        pair = np.arange(balls - 1)
        jacobian[pair, pair], jacobian[pair, pair + 1] = -normals, normals
        return jacobian.reshape(balls - 1, -1)

    return table, deli.Scene(
        mass=table.mass,
        position=start,
        momentum=table.momentum,
        potential=deli.Potential(
            energy=lambda q: weight @ q, gradient=lambda q: weight, hessian=lambda q: np.zeros((q.size, q.size))
        ),
        unilateral=[deli.Constraints(gaps, gaps_jacobian)],
        bilateral=[deli.Constraints(rods, rods_jacobian)],
        dimension=2,
    )


def pogo_stick() -> tuple[deli.Scene, deli.Scene]:
    """The pogo stick as a table, and as functions."""
    table = deli.scenes.pogo_stick()
    hessian = 10.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])

    def force(q):
        stretch = abs(q[0] - q[1]) - 5.0
        return 9.8 + 10.0 * stretch * np.sign(q[0] - q[1]) * np.array([1.0, -1.0])

    return table, deli.Scene(
        mass=table.mass,
        position=table.position,
        momentum=table.momentum,
        potential=deli.Potential(
            energy=lambda q: 9.8 * q.sum() + 5.0 * (abs(q[0] - q[1]) - 5.0) ** 2,
            gradient=force,
            hessian=lambda q: hessian,
        ),
        unilateral=[deli.Constraints(lambda q: q[1:], lambda q: np.array([[0.0, 1.0]]))],
    )


@pytest.mark.parametrize("solvers", ["native", "daqp"])
@pytest.mark.parametrize("method", [*METHODS, *FEW_SHADOW_METHODS], ids=str)
@pytest.mark.parametrize(("build", "step_size", "steps"), [(cradle, 0.02, 50), (pogo_stick, 0.05, 60)])
def test_functions_move_as_tables_do(build, step_size, steps, method, solvers) -> None:
    table, functions = build()
    known, found = (run(scene, method, step_size, steps, solvers=solvers) for scene in (table, functions))
    np.testing.assert_array_equal(found.smooth, known.smooth)
    np.testing.assert_array_equal(found.reflected, known.reflected)
    assert found.reflected.sum() > 0 or isinstance(method, deli.DiscreteSmooth)
    assert difference(known, found) <= growth(known, method, step_size, solvers=solvers) * (
        known.rounding + found.rounding
    )


def test_a_state_whose_energy_cannot_be_had_is_no_row(tmp_path) -> None:
    def energy(q: np.ndarray) -> float:
        if q[0] > 0.033:
            raise ValueError("too far")
        return 0.0

    scene = deli.Scene(1.0, [0.0], [1.0], deli.Potential(energy=energy, gradient=lambda q: np.zeros(1)))
    path = tmp_path / "run.nc"
    with pytest.raises(ValueError, match="too far"):
        deli.simulate(scene, deli.GVI(), step_size=0.01, steps=10, output=path)
    kept = deli.open_run(path)["trajectory"]
    np.testing.assert_allclose(kept["position"].values[:, 0], [0.0, 0.01, 0.02, 0.03], atol=1e-15)
    np.testing.assert_array_equal(kept["hamiltonian"].values, [0.5] * 4)


def test_a_potential_that_is_flat_at_the_start_curves_elsewhere() -> None:
    """What functions return at one configuration is all that is known of them."""
    quartic = deli.Potential(
        energy=lambda q: 0.25 * q[0] ** 4, gradient=lambda q: q**3, hessian=lambda q: 3.0 * q[np.newaxis] ** 2
    )
    known, found = (
        run(deli.Scene(1.0, [0.0], [1.0], potential), deli.GVI(), 0.1, 50)
        for potential in (deli.RadialPowers([0.25], [4.0]), quartic)
    )
    assert difference(known, found) <= 1e-12


def test_a_gap_with_no_gradient_at_the_start_closes_elsewhere() -> None:
    """Gaps are measured by their gradients at the start."""
    scene = deli.Scene(
        1.0, [0.0], [0.0], deli.Gravity(9.8), deli.Constraints(lambda q: 1.0 - q**2, lambda q: -2.0 * q[:, np.newaxis])
    )
    stepper = deli.GVI().stepper(scene, 0.1)
    q, p = stepper.step(np.ones(1), np.zeros(1))
    assert stepper.stats.smooth_contacts == 1
    assert abs(q[0] - 1.0) <= 1e-13
    assert p[0] == 0.0
