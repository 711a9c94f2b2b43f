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


@pytest.mark.parametrize(
    "method",
    [deli.GVI(), deli.GVI(predictor="closed_loop"), deli.Collision()],
    ids=["forward", "closed_loop", "events"],
)
@pytest.mark.parametrize("solvers", ["native", "daqp"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_blow_that_outruns_the_search_is_taken_again(method: object, solvers: str, sign: float) -> None:
    """Through balls in touch, each lighter than the one before, the last is struck off four times as fast at least."""
    bodies, runs = 5, []
    for pairs in (None, list(zip(*np.triu_indices(bodies, 1), strict=True))):
        scene = deli.Scene(
            mass=[1000.0, 30.0, 1.0, 0.03, 1.0],
            position=sign * np.array([-1.01, 0.0, 1.0, 2.0, 3.5]),
            momentum=sign * np.array([1000.0, 0.0, 0.0, 0.0, 0.0]),
            unilateral=deli.SpheresApart(pairs=pairs, distance=1.0),
            dimension=1,
        )
        runs.append(run(scene, method, 0.1, 4, solvers=solvers))
    found, known = runs
    assert np.abs(known.momentum / scene.mass).max() > 4.0  # which the search does not allow for
    np.testing.assert_array_equal(found.reflected, known.reflected)
    for counted in ("solves", "skipped", "status"):
        np.testing.assert_array_equal(getattr(found, counted), getattr(known, counted))
    np.testing.assert_allclose(found.residuals, known.residuals, rtol=0, atol=1e-12)
    assert difference(found, known) < 1e-11
