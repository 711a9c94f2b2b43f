"""The compiled solver against another active-set method: on every program that runs meet, and over whole runs."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
import pytest
from law_cases import CASE_BY_NAME, CASES, ENERGIES, EVERY_CASE, MANY_BODIES, PREDICTORS, Case
from law_runs import Run, growth, run, sizes

import deli
import solvers
from deli.integrators import bridge
from solvers import registry
from solvers.residuals import Residuals

TOLERANCE = 1e-12
AGREE = 1e-9


class Both(solvers.Backend):
    """Answers as `native` does and keeps how far from that `daqp` is."""

    name = "both"
    distances: ClassVar[list[float]] = []
    residuals: ClassVar[list[float]] = []

    def __init__(self, program: solvers.QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self._solvers = [registry.factory(name)(program, tolerance, options) for name in ("native", "daqp")]
        self._residuals = Residuals(program)

    def update(self) -> None:
        for solver in self._solvers:
            solver.update()

    def solve(self) -> solvers.Answer:
        native, daqp = (solver.solve() for solver in self._solvers)
        scale = 1.0 + max(np.abs(native.x).max(initial=0.0), np.abs(daqp.x).max(initial=0.0))
        self.distances.append(float(np.abs(native.x - daqp.x).max(initial=0.0) / scale))
        self.residuals.extend(self._residuals.compute(answer.x, answer.y) for answer in (native, daqp))
        return native


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    registry.register("both", Both)
    Both.distances.clear()
    Both.residuals.clear()
    yield
    registry.unregister("both")


def apart(one: Run, other: Run, step_size: float) -> float:
    """The largest difference of two runs; momenta of what rests are compared with what the forces give in a step."""
    position, momentum = sizes(one)
    impulse = step_size * np.abs(one.scene.potential.gradient(one.position[0])).max()
    return max(
        float(np.abs(one.position - other.position).max()) / position,
        float(np.abs(one.momentum - other.momentum).max()) / max(momentum, impulse),
    )


def methods(case: Case) -> list[object]:
    reflecting = [
        deli.GVI(scheme=case.scheme, energy=energy, predictor=predictor)
        for energy in ENERGIES
        for predictor in PREDICTORS
    ]
    return [*reflecting, deli.DiscreteSmooth(scheme=case.scheme)]


@EVERY_CASE
def test_every_program_has_one_answer(case: Case) -> None:
    scene = case.build()
    for method in methods(case):
        before, choice = len(Both.distances), {"backend": "both", "tolerance": TOLERANCE}
        run(scene, method, case.step_size, case.steps // 2, solvers=choice, skip=False)
        assert len(Both.distances) - before >= case.steps // 2  # one projection a step at least
    assert np.max(Both.distances) <= AGREE
    assert np.max(Both.residuals) <= AGREE


@EVERY_CASE
def test_a_run_is_the_same_with_the_native_solver(case: Case) -> None:
    scene, method = case.build(), deli.GVI(scheme=case.scheme)
    native, other = (
        run(scene, method, case.step_size, case.steps, solvers=backend, skip=True) for backend in ("native", "daqp")
    )
    np.testing.assert_array_equal(native.smooth, other.smooth)
    np.testing.assert_array_equal(native.reflected, other.reflected)
    allowed = growth(other, method, case.step_size) * (native.rounding + other.rounding)
    assert apart(native, other, case.step_size) <= allowed
    assert allowed < 1e-3  # or anything would do


def test_the_runs_meet_contacts() -> None:
    runs = [
        run(case.build(), deli.GVI(scheme=case.scheme), case.step_size, case.steps, solvers="native")
        for case in CASES + MANY_BODIES
    ]
    assert sum(known.reflected.sum() > 0 for known in runs) >= 8
    assert sum(known.smooth.sum() > 0 for known in runs) >= 5
    assert max(known.reflected.max() for known in runs) >= 3


COUNTS = ("solves", "skipped", "iterations", "rows", "fallbacks", "claimed", "verified", "status")
MEASURED = ("primal_residual", "dual_residual", "complementarity")


@EVERY_CASE
def test_compiled_solves_are_counted_as_those_of_a_backend(case: Case) -> None:
    scene, method = case.build(), deli.GVI(scheme=case.scheme)
    compiled, adapted = (method.stepper(scene, case.step_size, solvers=name) for name in ("native", "both"))
    state, total = (scene.position, scene.momentum), 0
    for number in range(case.steps // 2):
        if number % 3 == 0:  # what is counted adds up over the steps of a row
            total += compiled.stats.solves.sum()
            compiled.stats.reset()
            adapted.stats.reset()
        for stepper in (compiled, adapted):
            after = stepper.step(*state)
        for name in COUNTS:
            found, expected = (getattr(stepper.stats, name) for stepper in (compiled, adapted))
            np.testing.assert_array_equal(found, expected, err_msg=name)
        for name in MEASURED:
            found, expected = (getattr(stepper.stats, name) for stepper in (compiled, adapted))
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12, err_msg=name)
        state = after
    total += compiled.stats.solves.sum()
    assert compiled.stats.native_solves == total
    assert adapted.stats.native_solves == 0


@pytest.mark.parametrize("start", ["smooth", "mixed"])
def test_what_compiled_code_cannot_verify_is_left_to_the_chain_as_it_was(start: str) -> None:
    """Newton's programs too, which the compiled solver works on in other coordinates."""
    scene, states = deli.scenes.spring_sphere(start=start), []
    for tolerance in (1e-9, 1e-17):
        stepper = deli.GVI().stepper(scene, 0.25, solvers={"backend": "auto", "tolerance": tolerance})
        state = scene.position, scene.momentum
        for _ in range(20):
            state = stepper.step(*state)
        states.append(np.concatenate(state))
    assert stepper.stats.fallbacks.sum() > 0
    assert stepper.stats.verified.sum() < stepper.stats.solves.sum()
    np.testing.assert_allclose(states[1], states[0], rtol=0, atol=1e-11)


def test_where_there_is_no_clock_solves_go_untimed(monkeypatch: pytest.MonkeyPatch) -> None:
    case, method = CASE_BY_NAME["newtons_cradle"], deli.GVI()
    scene = case.build()
    steppers = [method.stepper(scene, case.step_size, solvers="native")]
    with monkeypatch.context() as without:
        without.setattr(bridge, "_clock", bridge._clock.__wrapped__)
        without.setattr(bridge.ctypes, "CDLL", lambda name: object())
        steppers.append(method.stepper(scene, case.step_size, solvers="native"))
    states = []
    for stepper in steppers:
        state = scene.position, scene.momentum
        for _ in range(case.steps):
            state = stepper.step(*state)
        states.append(np.concatenate(state))
    timed, untimed = (stepper.stats for stepper in steppers)
    np.testing.assert_array_equal(*states)
    np.testing.assert_array_equal(timed.solves, untimed.solves)
    assert (timed.solve_time[timed.solves > 0] > 0.0).all()
    assert untimed.solve_time.sum() == untimed.overhead_time.sum() == 0.0
