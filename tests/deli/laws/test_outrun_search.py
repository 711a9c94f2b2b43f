"""Bodies that outrun what the search for neighbours allowed for: the runs are those of listed pairs."""

import numpy as np
import pytest
from law_runs import difference, run

import deli
from deli.integrators import bound
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


def struck_rows(scale: float, gap: float = 0.01) -> list[deli.Scene]:
    """Balls in a row whose pairs are searched, and the same whose pairs are all listed; a scale < 0 mirrors them."""
    return [
        deli.Scene(
            mass=[1000.0, 30.0, 1.0, 0.03, 1.0],
            position=scale * np.array([-1.0 - gap, 0.0, 1.0, 2.0, 3.5]),
            momentum=scale * np.array([1000.0, 0.0, 0.0, 0.0, 0.0]),
            unilateral=deli.SpheresApart(pairs=pairs, distance=abs(scale)),
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
@pytest.mark.parametrize("scale", [-1.0, 1.0, 1e9])
def test_a_blow_that_outruns_the_search_is_taken_again(method: object, solvers: str, scale: float) -> None:
    """Through balls in touch, each lighter than the one before, the last is struck off four times as fast at least."""
    found, known = (run(scene, method, 0.1, 4, solvers=solvers) for scene in struck_rows(scale))
    assert np.abs(known.momentum / known.scene.mass).max() > 4.0 * abs(scale)  # which the search does not allow for
    np.testing.assert_array_equal(found.reflected, known.reflected)
    for counted in ("solves", "skipped", "status"):
        np.testing.assert_array_equal(getattr(found, counted), getattr(known, counted))
    np.testing.assert_allclose(found.residuals, known.residuals, rtol=0, atol=1e-12)
    assert difference(found, known) < 1e-11


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


def pushed_aside() -> list[deli.Scene]:
    """A ball pushes another one out of its way, which a track lets go faster than it comes itself."""
    return [
        deli.Scene(
            mass=[1000.0, 1.0],
            position=[[-0.0051, 0.0], [1.0, 0.0]],
            momentum=[[1000.0, 0.0], [0.0, 0.0]],
            unilateral=deli.SpheresApart(pairs=pairs, distance=1.0),
            bilateral=deli.Planes([[-1.0, 0.03]], offsets=-1.0, bodies=[1]),
            dimension=2,
        )
        for pairs in (None, [(0, 1)])
    ]


@pytest.mark.parametrize(
    "method",
    [
        deli.GVI(),
        deli.GVI(predictor="closed_loop"),
        deli.Collision(),
        deli.NonsmoothAlpha(),
        deli.MoreauJean(),
        deli.Newmark(),
        deli.Direct("midpoint"),
    ],
    ids=["forward", "closed_loop", "events", "generalized_alpha", "moreau_jean", "newmark", "midpoint"],
)
def test_what_was_counted_before_a_step_that_is_taken_again_is_kept(method: object) -> None:
    """The second step outruns the search, and all are counted in one row."""
    reflects = isinstance(method, deli.GVI | deli.Collision)
    scenes, step_size = (struck_rows(1.0, 0.11), 0.1) if reflects else (pushed_aside(), 0.005)
    assert [scene.unilateral.searched for scene in scenes] == [True, False]
    found, known = (
        deli.simulate(scene, method, step_size=step_size, steps=4, every=4, solvers="daqp")["solver_stats"]
        for scene in scenes
    )
    for counted in ("solves", "skipped", "iterations", "rows", "claimed", "verified", "status"):
        np.testing.assert_array_equal(found[counted], known[counted], err_msg=counted)


def test_a_step_after_one_that_outran_the_search_is_searched_for_as_usual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Or what is searched would soon be all pairs."""
    factors, search = [], bound.search
    monkeypatch.setattr(bound, "search", lambda *known: factors.append(known[-1]) or search(*known))
    scene = deli.Scene(1.0, [0.0, 1.5], [-1.0, 1.0], unilateral=deli.SpheresApart(pairs=None, distance=1.0))
    assert scene.unilateral.searched
    deli.simulate(scene, deli.GVI(), step_size=0.1, steps=100, every=100)
    assert len(factors) > 10
    assert set(factors) == {1.0}
