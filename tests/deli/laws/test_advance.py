"""Many steps at once are the same steps: states, counts and recorded rows."""

import numpy as np
import pytest
from law_cases import EVERY_CASE, Case
from law_runs import angular_momentum, energy, run

import deli
from deli.kernels.advance import make_block
from deli.kernels.record import Record
from deli.subproblems.stats import UNUSED

REL = 1e-12
KINETIC, POTENTIAL, GAP, MISMATCH = range(4)


def advanced(scene: deli.Scene, method: object, case: Case, every: int, solvers: str) -> Record:
    """Rows of a run, taken in portions: two of one step, which a deadline that has passed allows, and the rest."""
    stepper = method.stepper(scene, case.step_size, solvers=solvers)
    block = make_block(case.steps + 1, scene.dof, scene.dimension)
    block.fields.diagnostics[...] = np.nan  # what a block held before does not show
    stepper.place(scene.position, scene.momentum)
    stepper.record(block)
    for taken, deadline in ((1, 0.0), (2, 0.0), (case.steps, np.inf)):
        assert stepper.advance(block, case.steps, every, deadline) is None
        assert block.fields.progress[0] == taken
    return block


@pytest.mark.parametrize("solvers", ["native", "daqp"])
@EVERY_CASE
def test_advancing_is_stepping_to_the_bit(case: Case, solvers: str) -> None:
    scene = case.build()
    for method in (
        deli.GVI(scheme=case.scheme),
        deli.GVI(scheme=case.scheme, energy="numerical", predictor="closed_loop"),
        deli.DiscreteSmooth(scheme=case.scheme),
        deli.NonsmoothAlpha(),
    ):
        known = run(scene, method, case.step_size, case.steps, solvers=solvers)
        for every in (1, 7):
            rows = advanced(scene, method, case, every, solvers).fields
            count = rows.progress[1]
            steps = rows.steps[:count]
            picked = {*range(0, case.steps + 1, every), case.steps}
            np.testing.assert_array_equal(steps, sorted(picked))
            assert rows.position[:count].tobytes() == known.position[steps].tobytes()
            assert rows.momentum[:count].tobytes() == known.momentum[steps].tobytes()
            starts = steps[:-1]
            for recorded, stepped in ((rows.counts[:, 0], known.solves), (rows.counts[:, 1], known.skipped)):
                np.testing.assert_array_equal(recorded[1:count], np.add.reduceat(stepped, starts))
            np.testing.assert_array_equal(rows.contacts[1:count, 0], known.smooth[steps[1:] - 1])
            np.testing.assert_array_equal(rows.contacts[1:count, 1], np.add.reduceat(known.reflected, starts))
            np.testing.assert_array_equal(rows.residuals[1:count], np.fmax.reduceat(known.residuals, starts))
            recorded, stepped = (np.where(status == UNUSED, -1, status) for status in (rows.status, known.status))
            np.testing.assert_array_equal(recorded[1:count], np.maximum.reduceat(stepped, starts))


@EVERY_CASE
def test_diagnostics_are_those_of_the_recorded_states(case: Case) -> None:
    scene, dimension = case.build(), case.build().dimension
    rows = advanced(scene, deli.GVI(scheme=case.scheme), case, 1, "native").fields
    q, p, found = rows.position, rows.momentum, rows.diagnostics
    kinetic, potential = 0.5 * (p**2 / scene.mass).sum(axis=1), scene.potential.energy(q)
    np.testing.assert_allclose(found[:, KINETIC], kinetic, rtol=REL)
    largest = max(np.abs(potential).max(), kinetic.max())
    np.testing.assert_allclose(found[:, POTENTIAL], potential, rtol=REL, atol=REL * largest)
    np.testing.assert_allclose(found[:, [KINETIC, POTENTIAL]].sum(axis=1), energy(scene, q, p), atol=2 * REL * largest)
    size = np.abs(q).max()
    gaps = scene.unilateral.value(q).min(axis=1) if scene.unilateral.rows else np.full(len(q), np.nan)
    np.testing.assert_allclose(found[:, GAP], gaps, atol=REL * size, rtol=REL)
    mismatch = np.abs(scene.bilateral.value(q)).max(axis=1) if scene.bilateral.rows else np.full(len(q), np.nan)
    np.testing.assert_allclose(found[:, MISMATCH], mismatch, atol=REL * size, rtol=0.0)
    bodies = (len(q), -1, dimension)
    moving = np.abs(p).max() * scene.bodies
    linear = p.reshape(bodies).sum(axis=1)
    np.testing.assert_allclose(found[:, 4 : 4 + dimension], linear, atol=REL * moving, rtol=0.0)
    if dimension > 1:
        angular = angular_momentum(q.reshape(bodies), p.reshape(bodies)).reshape(len(q), -1)
        np.testing.assert_allclose(found[:, 4 + dimension :], angular, atol=REL * moving * size, rtol=0.0)
