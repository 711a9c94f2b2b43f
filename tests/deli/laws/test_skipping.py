"""Skipping solvers where none is needed changes nothing but the count, for every scene and method."""

import numpy as np
import pytest
from law_cases import CASE, CASE_BY_NAME, CASES, METHOD, SHADOW_METHODS, Case, resolved
from law_runs import difference, growth, resolution, run

import deli

REFLECTION, POSITION, PROJECTION = range(3)


@CASE
@METHOD
def test_skipping_changes_nothing_but_the_count(case: Case, method: object) -> None:
    case = resolved(case, method)
    scene, steps = case.build(), case.steps // 2
    on = run(scene, method, case.step_size, steps, skip=True)
    off = run(scene, method, case.step_size, steps, skip=False)
    np.testing.assert_array_equal(on.smooth, off.smooth)
    np.testing.assert_array_equal(on.reflected, off.reflected)
    rounding = on.rounding + off.rounding + (resolution(on) if method in SHADOW_METHODS else 0.0)
    assert difference(on, off) <= growth(on, method, case.step_size) * rounding

    # Every pass of a reflection and every projection is either solved or skipped, whichever way.
    passes, solved = (on.solves + on.skipped)[:, REFLECTION], (off.solves + off.skipped)[:, REFLECTION]
    islands = np.clip(on.reflected, 1, scene.bodies)  # at most: each has a contact that is reflected, and a body
    if method in SHADOW_METHODS:  # each island has a program of its own, and a pass that asks no solver counts once
        assert (solved >= passes).all()
        assert (solved <= islands * passes).all()
    else:
        assert (passes >= solved).all()
        assert (passes <= islands * solved).all()
    assert (on.solves[:, PROJECTION] == 0).all()
    assert (off.skipped[:, PROJECTION] == 0).all()
    np.testing.assert_array_equal(on.skipped[:, PROJECTION], off.solves[:, PROJECTION])
    if isinstance(method, deli.DiscreteSmooth) or method.predictor == "forward":
        assert (on.skipped[:, PROJECTION] == 1).all()  # landings in a closed loop take more
        assert (off.skipped[off.reflected > 0, REFLECTION] == 0).all() or method in SHADOW_METHODS
    # A position update is skipped, or takes as many solves as it has linearizations.
    assert (off.solves[:, POSITION] >= 1).all()
    assert (off.skipped[:, POSITION] == 0).all()
    # Skipping also tells bodies apart that do not meet: each island is a program, without it there is one for all.
    assert (on.solves[:, POSITION] <= scene.bodies * off.solves[:, POSITION]).all()
    assert ((on.solves + on.skipped)[:, POSITION] >= 1).all()
    if isinstance(method, deli.DiscreteSmooth):
        assert not passes.any()
    else:
        assert (passes >= 1).all()
        if method.predictor == "forward":
            assert ((on.solves[:, POSITION] == 0) == (on.skipped[:, POSITION] == 1)).all()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_what_needs_no_solver_gets_none(case: Case) -> None:
    on = run(case.build(), deli.GVI(scheme=case.scheme), case.step_size, case.steps)
    contact = on.smooth > 0
    assert (on.solves[~contact, POSITION] == 0).all()
    assert (on.solves[contact, POSITION] >= 1).all()
    assert (on.solves[on.reflected < 2, REFLECTION] == 0).all()
    if not on.scene.bilateral.rows:  # an unconstrained step is no position update that could be measured
        assert np.isnan(on.residuals[~contact & (on.reflected == 0)][..., POSITION]).all()


def test_solvers_are_asked_where_skipping_is_on() -> None:
    """Or the comparison would compare closed forms with themselves."""
    cradle = CASE_BY_NAME["newtons_cradle"]
    on = run(cradle.build(), deli.GVI(), cradle.step_size, cradle.steps)
    assert on.solves[:, REFLECTION].sum() > 0
    assert on.solves[:, POSITION].sum() > 0
    assert on.skipped.sum(axis=0).min() > 0


@pytest.mark.parametrize("bodies", range(1, 8))
def test_what_falls_off_a_ceiling_falls_freely(bodies: int) -> None:
    """Programs are filled up with rows to a few sizes, and those must not bind."""
    scene = deli.Scene(
        1.0, np.zeros(bodies), np.zeros(bodies), deli.Gravity(-9.8), deli.Planes([-1.0], bodies=range(bodies))
    )
    fallen = run(scene, deli.GVI("verlet"), 0.1, 1, skip=False)
    assert fallen.smooth[0] == bodies
    np.testing.assert_allclose(fallen.position[1], -4.9 * 0.1**2, rtol=1e-12)
    np.testing.assert_allclose(fallen.momentum[1], -0.98, rtol=1e-12)
