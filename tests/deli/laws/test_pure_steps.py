"""A step is a function of the state: it changes no input, remembers nothing, and repeats to the bit."""

import numpy as np
import pytest
from law_cases import BACKEND, CASE, CASE_BY_NAME, PREDICTORS, SCHEMES, SHADOWS, SKIP, Case
from law_runs import Run, run

import deli

MANY_SHAPES = ("spring_sphere_mixed", "newtons_cradle", "discs")


def methods(case: Case) -> list[object]:
    numerical = deli.GVI(scheme=case.scheme, energy="numerical", predictor="closed_loop")
    shadows = [
        deli.GVI(scheme=case.scheme, energy=energy, predictor=predictor)
        for energy, predictor in zip(SHADOWS, PREDICTORS, strict=True)
    ]
    return [
        deli.GVI(scheme=case.scheme),
        numerical,
        *shadows,
        deli.DiscreteSmooth(scheme=case.scheme),
        deli.NonsmoothAlpha(),
    ]


def assert_same(one: Run, other: Run, since: int = 0) -> None:
    """Bit for bit, of states and counts."""
    assert one.position[since:].tobytes() == other.position.tobytes()
    assert one.momentum[since:].tobytes() == other.momentum.tobytes()
    for name in ("smooth", "reflected", "solves", "skipped", "status", "residuals"):
        np.testing.assert_array_equal(getattr(one, name)[since:], getattr(other, name))


@SKIP
@BACKEND
@pytest.mark.parametrize("name", MANY_SHAPES)
def test_runs_repeat_and_restart_to_the_bit(name: str, backend: str, skip: bool) -> None:
    case = CASE_BY_NAME[name]
    scene, steps = case.build(), 3 * case.steps // 4
    method = deli.GVI(scheme=case.scheme)
    options = {"solvers": backend, "skip": skip}
    whole = run(scene, method, case.step_size, steps, **options)
    assert whole.reflected.sum() > 0
    assert_same(whole, run(scene, method, case.step_size, steps, **options))
    since = int(np.flatnonzero(whole.reflected)[0])  # from the state that an impact meets
    start = (whole.position[since].copy(), whole.momentum[since].copy())
    assert_same(whole, run(scene, method, case.step_size, steps - since, start=start, **options), since)


@CASE
def test_every_method_restarts_to_the_bit(case: Case) -> None:
    scene, steps, since = case.build(), case.steps // 2, case.steps // 4
    for method in methods(case):
        whole = run(scene, method, case.step_size, steps)
        start = whole.states[since]
        assert_same(whole, run(scene, method, case.step_size, steps - since, start=start), since)


@CASE
def test_a_stepper_remembers_nothing(case: Case) -> None:
    """One that has made a run makes it again, to the bit."""
    scene = case.build()
    for method in methods(case):
        stepper = method.stepper(scene, case.step_size)
        runs = []
        for _ in range(2):
            states = [(scene.position, scene.momentum)]
            for _ in range(case.steps // 2):
                states.append(stepper.step(*states[-1]))
            runs.append(b"".join(part.tobytes() for state in states for part in state))
        assert runs[0] == runs[1]


@CASE
def test_inputs_are_left_alone_and_results_are_read_only(case: Case) -> None:
    scene = case.build()
    for method in methods(case):
        stepper = method.stepper(scene, case.step_size)
        state = (scene.position, scene.momentum)
        for _ in range(case.steps // 2):
            given = tuple(part.copy() for part in state)
            moved = stepper.step(*given)
            for before, copy in zip(state, given, strict=True):
                assert before.tobytes() == copy.tobytes()
                assert copy.flags.writeable
                assert not any(np.shares_memory(copy, after) for after in moved)
            assert not any(array.flags.writeable for array in moved)
            state = moved


@pytest.mark.parametrize("scheme", SCHEMES)
@CASE
def test_a_caller_may_use_its_arrays_again(case: Case, scheme: str) -> None:
    """A state written over the last one in the same arrays is a new state."""
    scene, steps = case.build(), case.steps
    for predictor in ("forward", "closed_loop"):
        method = deli.GVI(scheme=scheme, predictor=predictor)
        expected = run(scene, method, case.step_size, steps)
        stepper = method.stepper(scene, case.step_size, solvers="daqp")
        q, p = scene.position.copy(), scene.momentum.copy()
        for step in range(steps):
            moved, carried = stepper.step(q, p)
            q[:], p[:] = moved, carried
            assert q.tobytes() == expected.position[step + 1].tobytes()
            assert p.tobytes() == expected.momentum[step + 1].tobytes()


@CASE
def test_reflect_leaves_its_inputs_alone(case: Case) -> None:
    scene = case.build()
    q, p = scene.position.copy(), scene.momentum - 0.1 * scene.mass * scene.position
    kept = (q.copy(), p.copy())
    after = deli.reflect(scene, q, p)
    assert not np.shares_memory(after, p)
    assert q.tobytes() == kept[0].tobytes()
    assert p.tobytes() == kept[1].tobytes()
    assert q.flags.writeable
    assert p.flags.writeable
    assert deli.reflect(scene, q, p).tobytes() == after.tobytes()
