"""Bodies that outrun what the search for neighbours allowed for: the runs are those of listed pairs."""

import numpy as np
import pytest
from law_runs import difference, run

import deli
from deli.mechanics import distances


@pytest.fixture(autouse=True)
def _search_always(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(distances, "SEARCH_ABOVE", 1)


@pytest.mark.parametrize("predictor", ["forward", "closed_loop"])
@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("moving", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_body_from_afar_is_found(predictor: str, dimension: int, moving: int, sign: float) -> None:
    """Pulled in from rest it outruns what its speed at the last search lets expect."""
    position = np.zeros((2, dimension))
    position[moving] = sign * 4.0 / np.sqrt(dimension)
    runs = []
    for pairs in (None, [(0, 1)]):
        scene = deli.Scene(
            mass=[1.0, 3.0],
            position=position,
            momentum=np.zeros(2 * dimension),
            potential=deli.Springs(pairs=[(0, 1)], stiffness=2.0, rest_length=0.0),
            unilateral=deli.SpheresApart(pairs=pairs, distance=1.0),
            dimension=dimension,
        )
        assert scene.unilateral.searched == (pairs is None)
        runs.append(run(scene, deli.GVI(scheme="verlet", predictor=predictor), 0.02, 150))
    found, known = runs
    assert known.reflected.sum() >= 1
    np.testing.assert_array_equal(found.reflected, known.reflected)
    assert difference(found, known) < 1e-12


def struck_rows(sign: float, gap: float = 0.01) -> list[deli.Scene]:
    """Balls in a row whose pairs are searched, and the same whose pairs are all listed."""
    return [
        deli.Scene(
            mass=[1000.0, 30.0, 1.0, 0.03, 1.0],
            position=sign * np.array([-1.0 - gap, 0.0, 1.0, 2.0, 3.5]),
            momentum=sign * np.array([1000.0, 0.0, 0.0, 0.0, 0.0]),
            unilateral=deli.SpheresApart(pairs=pairs, distance=1.0),
            dimension=1,
        )
        for pairs in (None, list(zip(*np.triu_indices(5, 1), strict=True)))
    ]


@pytest.mark.parametrize(
    "method",
    [deli.GVI(), deli.GVI(predictor="closed_loop"), deli.Collision()],
    ids=["forward", "closed_loop", "events"],
)
@pytest.mark.parametrize("solvers", ["native", "daqp"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_blow_that_outruns_the_search_is_taken_again(method: object, solvers: str, sign: float) -> None:
    """Through balls in touch, each lighter than the one before, the last is struck off four times as fast at least."""
    found, known = (run(scene, method, 0.1, 4, solvers=solvers) for scene in struck_rows(sign))
    assert np.abs(known.momentum / known.scene.mass).max() > 4.0  # which the search does not allow for
    np.testing.assert_array_equal(found.reflected, known.reflected)
    for counted in ("solves", "skipped", "status"):
        np.testing.assert_array_equal(getattr(found, counted), getattr(known, counted))
    np.testing.assert_allclose(found.residuals, known.residuals, rtol=0, atol=1e-12)
    assert difference(found, known) < 1e-11


@pytest.mark.parametrize("predictor", ["forward", "closed_loop"])
def test_what_the_steps_before_one_that_is_taken_again_have_cost_is_kept(predictor: str) -> None:
    counted = []
    for scene in struck_rows(1.0, gap=0.15):
        stepper, state = deli.GVI(predictor=predictor).stepper(scene, 0.1), (scene.position, scene.momentum)
        for _ in range(4):
            state = stepper.step(*state)
        counted.append((stepper.stats.solves + stepper.stats.skipped, stepper.stats.reflected_contacts))
    np.testing.assert_array_equal(counted[0][0], counted[1][0])
    assert counted[0][1] == counted[1][1] >= 3


@pytest.mark.parametrize("predictor", ["forward", "closed_loop"])
@pytest.mark.parametrize("most", [True, 5])
def test_what_a_step_that_is_taken_again_had_posed_is_forgotten(predictor: str, most: bool | int) -> None:
    found, known = (
        deli.simulate(
            scene,
            deli.GVI(predictor=predictor),
            step_size=0.1,
            steps=4,
            solvers="daqp",
            skip=False,
            subproblems=most,
        )["subproblems"].to_dataset()
        for scene in struck_rows(1.0)
    )
    for counted in ("step", "subproblem", "solve", "left_out"):
        np.testing.assert_array_equal(found[counted], known[counted])
    assert found.step.max() == (3 if most is True else 0)


@pytest.mark.parametrize(
    "method", [deli.GVI(), deli.NonsmoothAlpha(), deli.Collision()], ids=["GVI", "NonsmoothAlpha", "Collision"]
)
def test_a_step_that_is_taken_again_counts_once_among_those_of_its_row(method: object) -> None:
    found, known = (
        deli.simulate(scene, method, step_size=0.1, steps=8, every=8)["solver_stats"].to_dataset()
        for scene in struck_rows(1.0, gap=0.35)  # in the fourth step
    )
    for counted in ("solves", "skipped", "iterations", "rows", "claimed", "verified", "status"):
        np.testing.assert_array_equal(found[counted], known[counted], err_msg=counted)
