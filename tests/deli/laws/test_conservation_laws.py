"""Momentum maps, constraints and complementarity (Theorem 5.1; 7.1-7.9), for every scene, method and backend."""

import numpy as np
import pytest
from law_cases import BACKEND, CASE, CASE_BY_NAME, CASES, METHOD, SCHEMES, Case, resolved
from law_reference import Reference
from law_runs import SOLVED_STATUSES, Run, angular_momentum, run, sizes

import deli

ACCURATE = 1e-10  # what every recorded residual stays below; the polish reaches it with every backend


def momentum_maps(of: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All components of linear and angular momentum (steps + 1, components), their scales, and which are conserved."""
    scene, dimension = of.scene, of.scene.dimension
    shape = (of.steps + 1, scene.bodies, dimension)
    q, p = of.position.reshape(shape), of.momentum.reshape(shape)
    length, impulse = sizes(of)
    angular = angular_momentum(q, p).reshape(of.steps + 1, len(scene.symmetry.angular))
    scales = scene.bodies * impulse * np.array([1.0] * dimension + [2.0 * length] * angular.shape[1])
    return np.column_stack([p.sum(axis=1), angular]), scales, np.array(scene.symmetry.linear + scene.symmetry.angular)


def check(of: Run) -> None:
    """The laws that hold for every run of every method."""
    scene = of.scene
    assert set(np.unique(of.status)) <= SOLVED_STATUSES
    assert of.residual <= ACCURATE

    maps, scales, conserved = momentum_maps(of)
    change = np.abs(maps - maps[0]).max(axis=0) / scales
    assert (change[conserved] <= of.rounding).all(), (change, of.rounding)

    if scene.bilateral.rows:
        _, impulse = sizes(of)
        assert np.abs(scene.bilateral.value(of.position)).max() <= 2 * max(of.residual, 1e-15) * scene.length_scale
        rates = [scene.bilateral.jacobian(q) @ (p / scene.mass) for q, p in zip(of.position, of.momentum, strict=True)]
        assert np.abs(rates).max() <= 100 * max(of.residual, 1e-15) * impulse / scene.mass.min()


@CASE
@METHOD
def test_every_method_keeps_momentum_maps_and_constraints(case: Case, method: object) -> None:
    case = resolved(case, method)
    check(run(case.build(), method, case.step_size, case.steps))


@CASE
@BACKEND
@pytest.mark.parametrize("energy", ["hamiltonian", "numerical", pytest.param("shadow8", marks=pytest.mark.long)])
def test_every_backend_keeps_momentum_maps_and_constraints(case: Case, backend: str, energy: str) -> None:
    predictor = "forward" if energy == "hamiltonian" else "closed_loop"
    method = deli.GVI(scheme=case.scheme, energy=energy, predictor=predictor)
    result = run(case.build(), method, case.step_size, case.steps // 2, solvers=backend, skip=False)
    check(result)
    assert result.backends == {backend}


@CASE
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("method", [deli.GVI, deli.DiscreteSmooth])
def test_impulses_push_and_only_at_contacts(case: Case, method: type, scheme: str) -> None:
    """The multipliers, found again by NNLS from the states alone (7.3, 7.4 and 6.8)."""
    scene, steps = case.build(), case.steps
    result = run(scene, method(scheme=scheme), case.step_size, steps)
    reference = Reference(scene, scheme, case.step_size)
    gaps = np.abs(scene.unilateral.value(result.position)) <= 1e-8 * scene.length_scale
    allowed = steps * [None]
    for step in range(steps):
        q, p, x = result.position[step], result.momentum[step], result.position[step + 1]
        if result.reflected[step]:  # off 𝔸, and on along 𝕊
            allowed[step] = gaps[step] | (scene.unilateral.value(reference.predict(q, p)) <= 0.0)
        else:  # at contacts that touch before and after
            allowed[step] = gaps[step] & gaps[step + 1]
        assert reference.unexplained(q, p, x, np.flatnonzero(allowed[step])) <= 1e-12
        assert result.reflected[step] <= allowed[step].sum()
        assert result.smooth[step] <= gaps[step].sum()
    pushed = [
        reference.unexplained(result.position[k], result.momentum[k], result.position[k + 1], np.zeros(0, dtype=int))
        for k in range(steps)
        if allowed[k].any()
    ]
    if method is deli.GVI or case.name == "spring_sphere_smooth":
        assert max(pushed) > 1e-3  # without contacts what happened cannot be explained


def test_the_scenes_have_symmetries_and_events() -> None:
    """Without them the laws above would hold of nothing."""
    linear = angular = 0
    for case in CASES:
        scene = case.build()
        linear, angular = linear + sum(scene.symmetry.linear), angular + sum(scene.symmetry.angular)
        result = run(scene, deli.GVI(scheme=case.scheme), case.step_size, case.steps)
        assert result.reflected.sum() + result.smooth.sum() > 0, case.name
    assert linear >= 2
    assert angular >= 7
    assert all(case in CASE_BY_NAME for case in ("newtons_cradle", "lennard_jones", "discs"))


def test_a_momentum_that_no_symmetry_protects_changes() -> None:
    case = CASE_BY_NAME["newtons_cradle"]
    result = run(case.build(), deli.GVI(), case.step_size, case.steps)
    maps, scales, conserved = momentum_maps(result)
    assert not conserved.any()
    assert (np.abs(maps - maps[0]).max(axis=0) > 1e-3 * scales).all()
