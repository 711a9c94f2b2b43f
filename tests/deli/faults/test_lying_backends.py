"""What a backend says wrongly gets into no row: it is put right, or the run ends and says who is at fault."""

import logging
from functools import cache

import lies
import numpy as np
import pytest
from lies import LIES, RAISING
from running import DONE, RUN_FAILED, call

import deli
import solvers

STEPS = 40
SUBPROBLEMS = ("reflection", "position", "projection")
# What is solved by the backend at fault, and where.
PLACES = (
    ("reflection", "cradle"),
    ("position", "cradle"),
    ("position", "sphere"),
    ("projection", "cradle"),
    ("projection", "sphere"),
)
# No point that a polish could begin at.
NO_POINT = {
    "not_a_number", "infinite", "too_short", "too_long", "a_column", "complex_numbers", "objects", "words", "nothing",
    "unheard_of", "uncounted", "contradicted", *RAISING,
}  # fmt: skip
# The right answer, and a word that it is none.
MODEST = {"hopeless", "infeasible", "unbounded"}
EVERY_LIE = tuple(name for name in (*LIES, *RAISING) if name != "single_precision")
REPLAYED = ("noise", "zeros", "huge", "not_a_number", "too_short", "tampering", "nothing", "error")
ROTATED = tuple((lie, *PLACES[number % len(PLACES)]) for number, lie in enumerate(EVERY_LIE))
ALL = tuple((lie, *place) for lie in EVERY_LIE for place in PLACES)
SCENES = {
    "cradle": (lambda: deli.scenes.newtons_cradle(balls=3), 0.03),
    "sphere": (lambda: deli.scenes.spring_sphere(start="smooth"), 0.1),
}


@pytest.fixture(autouse=True)
def _registered():
    with lies.registered():
        yield


def choice(backend, subproblem, polish, honest):
    table = {"backend": backend, "polish": polish, "options": {"honest": honest}}
    return {"default": "native", subproblem: table}


def simulate(where, chosen, **keywords):
    scene, step_size = SCENES[where]
    return deli.simulate(
        scene(), deli.GVI(), **{"step_size": step_size, "steps": STEPS, "skip": False, **keywords}, solvers=chosen
    )


@cache
def honest_run(where):
    return simulate(where, "native")


def assert_right(run, where, tolerance=1e-12):
    """Every row is that of an honest run, with energy and gap, and nothing in it is called what it is not."""
    honest, found = (one["trajectory"] for one in (honest_run(where), run))
    rows = np.rint(found["time"].values / SCENES[where][1]).astype(int)
    for name in ("position", "momentum", "hamiltonian", "gap_min", "equality_residual"):
        np.testing.assert_allclose(found[name], honest[name][rows], rtol=0, atol=tolerance, err_msg=name)
    stats = run["solver_stats"]
    assert (stats["verified"] <= stats["solves"]).all()
    residuals = np.fmax.reduce([stats[name].values for name in ("primal_residual", "dual_residual", "complementarity")])
    solved = stats["status"].values == 1
    assert np.nanmax(residuals[solved], initial=0.0) <= 1e-9


def check(lie, subproblem, where, polish):
    honest = 1 if subproblem == "reflection" else 8
    run = simulate(where, choice(lie, subproblem, polish, honest))
    assert_right(run, where)
    outcome, rows = run.attrs["outcome"], run["trajectory"].sizes["time"]
    if outcome == "complete":
        stats = run["solver_stats"]
        assert (polish and lie not in NO_POINT) or lie in MODEST
        assert polish == bool((stats["verified"] == stats["solves"]).all())
        return
    said = "raised" if lie in RAISING else "reports"
    assert outcome.startswith(f"failed in step {rows} (from time "), outcome
    assert f": {subproblem}: backend {lie!r} {said} " in outcome
    assert "\n" not in outcome
    assert 1 < rows <= STEPS


@pytest.mark.parametrize(("lie", "subproblem", "where"), ROTATED)
@pytest.mark.parametrize("polish", [False, True])
def test_no_lie_gets_into_a_row(lie, subproblem, where, polish):
    check(lie, subproblem, where, polish)


@pytest.mark.long
@pytest.mark.parametrize(("lie", "subproblem", "where"), sorted(set(ALL) - set(ROTATED)))
@pytest.mark.parametrize("polish", [False, True])
def test_no_lie_gets_into_a_row_of_any_subproblem(lie, subproblem, where, polish):
    check(lie, subproblem, where, polish)


@pytest.mark.parametrize("lie", ["noise", "zeros", "wrong_sign", "stale", "tampering", "hopeless", "unbounded"])
def test_polish_makes_right_what_it_lets_pass(lie):
    """All of the run is computed from answers to the wrong question, put right by the system of their active set."""
    run = simulate("cradle", {"backend": lie})
    assert run.attrs["outcome"] == "complete"
    assert_right(run, "cradle")
    claimed, verified, solves = (
        run["solver_stats"][name].sum("step").values for name in ("claimed", "verified", "solves")
    )
    assert (verified == solves).all()
    assert (claimed == (0 if lie in MODEST else solves)).all()


@pytest.mark.parametrize("subproblem", ["reflection", "projection"])
def test_an_answer_of_single_precision_is_taken_and_called_inaccurate(subproblem):
    run = simulate("cradle", choice("single_precision", subproblem, False, 1))
    assert run.attrs["outcome"] == "complete"
    assert_right(run, "cradle", tolerance=1e-4)
    stats = run["solver_stats"].isel(subproblem=SUBPROBLEMS.index(subproblem))
    assert stats["claimed"].sum() == stats["solves"].sum()
    assert 1 <= stats["verified"].sum() < stats["solves"].sum()
    assert "inaccurate" in np.array(stats["status"].attrs["flag_meanings"].split())[stats["status"].values]
    exact = simulate("cradle", choice("single_precision", subproblem, True, 1))
    assert_right(exact, "cradle")


@pytest.mark.parametrize("lie", ["zeros", "error"])
def test_the_failed_attempt_is_counted_with_the_row_that_it_adds(lie, tmp_path, caplog):
    """With every third step recorded, the last good state is a row of its own, and its stats tell who claimed what."""
    path = tmp_path / "run.nc"
    with caplog.at_level(logging.WARNING, logger="deli"):
        run = simulate("sphere", choice(lie, "projection", False, 10), every=3, output=path)
    assert caplog.messages == [f"{run.attrs['title']}: {run.attrs['outcome']}"]
    assert run["trajectory"].identical(deli.open_run(path)["trajectory"])
    assert not path.with_name("run.nc.partial").exists()
    assert run.attrs["outcome"].startswith("failed in step 11 ")
    np.testing.assert_allclose(run["trajectory"]["time"], [0.0, 0.3, 0.6, 0.9, 1.0])
    assert_right(run, "sphere")
    stats = run["solver_stats"].isel(subproblem=2)
    assert stats["solves"].values.tolist() == [3, 3, 3, 2]
    assert stats["verified"].values.tolist() == [3, 3, 3, 1]
    assert stats["claimed"].values.tolist() == [3, 3, 3, 2 if lie == "zeros" else 1]
    assert np.array(stats["status"].attrs["flag_meanings"].split())[stats["status"].values].tolist() == [
        *["solved"] * 3, "inaccurate" if lie == "zeros" else "failed",
    ]  # fmt: skip


@pytest.mark.parametrize("lie", ["wrong_sign", "nothing", "leave"])
def test_members_of_an_ensemble_fail_one_by_one(lie):
    members = [deli.scenes.newtons_cradle(balls=3, angle=angle) for angle in (-0.62, -0.63, -0.64)]
    keywords = {"step_size": 0.03, "steps": STEPS, "skip": False}
    chosen = choice(lie, "reflection", False, 1)
    run = deli.simulate_ensemble(members, deli.GVI(), **keywords, solvers=chosen, workers=2)
    honest = deli.simulate_ensemble(members, deli.GVI(), **keywords, solvers="native")
    assert run.attrs["outcome"] == "3 of 3 members failed"
    for member, outcome in enumerate(run["outcome"].values):
        assert f": reflection: backend {lie!r} r" in outcome
        good = int(run["steps_taken"][member]) + 1
        for name in ("position", "momentum", "hamiltonian"):
            found, expected = (one["trajectory"][name][member].values for one in (run, honest))
            np.testing.assert_allclose(found[:good], expected[:good], rtol=0, atol=1e-12)
            assert np.isnan(found[good:]).all()


@pytest.mark.parametrize("lie", EVERY_LIE)
def test_a_single_reflection_is_right_or_refused(lie):
    scene = deli.scenes.newtons_cradle(balls=3, angle=0.0)
    position, momentum = scene.position, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    kept = position.copy(), momentum.copy()
    expected = deli.reflect(scene, position, momentum)
    for polish in (False, True):
        keywords = {"solvers": {"backend": lie, "polish": polish}, "skip": False}
        if lie not in MODEST and (not polish or lie in NO_POINT):
            with pytest.raises(deli.StepError, match=f"reflection: backend '{lie}' r"):
                deli.reflect(scene, position, momentum, **keywords)
        else:
            np.testing.assert_allclose(deli.reflect(scene, position, momentum, **keywords), expected, atol=1e-13)
    np.testing.assert_array_equal(kept, (position, momentum))


def test_replay_verifies_no_lie(tmp_path):
    path = tmp_path / "run.nc"
    simulate("cradle", "native", steps=2, subproblems=8, output=path)
    for polish in (False, True):
        data = deli.replay(path, backends=[*REPLAYED, "native"], polish=polish, repeat=1, limit=1e4)
        assert data["verified"].sel(backend="native").all()
        assert (data["error"].where(data["verified"], 0.0) < 1e-8).all()
        assert not data["verified"].sel(backend=["not_a_number", "too_short", "nothing", "error"]).any()
        assert data["claimed"].sel(backend=["noise", "zeros", "too_short", "not_a_number"]).all()
        assert not data["claimed"].sel(backend=["nothing", "error"]).any()
        if not polish:
            assert not data["verified"].sel(backend=["noise", "huge"]).any()


def test_the_benchmark_of_backends_shows_what_is_verified():
    from deli.bench.backends import measure

    assert measure("noise", (4, 2, 1.0), True)["verified"] == 0.0
    with pytest.raises(solvers.BackendError, match="backend 'error' raised RuntimeError: out of luck"):
        measure("error", (4, 2, 1.0), True)


class TestChain:
    @pytest.fixture(
        params=["noise", "too_short", "not_a_number", "error", "leave", "tampering", "infeasible", "endless"]
    )
    def lie(self, request, monkeypatch):
        monkeypatch.setitem(solvers.registry.CHAINS, "auto", (request.param, "native", "daqp"))
        monkeypatch.setattr("deli.subproblems.program.NATIVE", ())
        return request.param

    def test_goes_on_behind_a_member_at_fault_and_counts_it(self, lie):
        scene = deli.scenes.spring_sphere(start="smooth")
        stepper = deli.GVI().stepper(scene, 0.1, solvers={"backend": "auto", "polish": False}, skip=False)
        stepper._bound.method.native[:] = False  # the kernels' own solver would answer before any chain
        honest = honest_run("sphere")["trajectory"]
        state = scene.position, scene.momentum
        for step in range(1, 11):
            state = stepper.step(*state)
            np.testing.assert_allclose(state[0], honest["position"][step], rtol=0, atol=1e-12)
            np.testing.assert_allclose(state[1], honest["momentum"][step], rtol=0, atol=1e-12)
        assert (stepper.stats.fallbacks == stepper.stats.solves).all()
        assert (stepper.stats.verified == stepper.stats.solves).all()
        assert stepper.stats.solves[1:].min() >= 10
        assert stepper.backends == {"native"}


class TestCommandLine:
    @pytest.mark.parametrize("lie", ["zeros", "too_long", "error", "leave", "panic"])
    def test_a_run_says_it_once_and_keeps_its_rows(self, lie, folder):
        table = f'{{backend="{lie}", polish=false, options={{honest=8}}}}'
        settings = ["--set", f"solvers.projection={table}", "--set", "skip=false", "--set", "step_size=0.1"]
        result = call("run", "spring_sphere", "--set", "steps=40", *settings, "-o", "run.nc", "--quiet")
        assert result.exit_code == RUN_FAILED
        assert result.stdout == ""
        assert result.stderr.count("\n") == 1
        assert result.stderr.startswith(f"deli: failed in step 9 (from time 0.8): projection: backend {lie!r} r")
        assert result.stderr.endswith("; 9 rows are in run.nc.\n")
        assert_right(deli.open_run("run.nc"), "sphere")
        assert [path.name for path in folder.iterdir()] == ["run.nc"]

    def test_a_liar_that_is_polished_is_no_failure(self, folder):
        result = call("run", "newtons_cradle", "--set", "steps=5", "--set", "solvers.default=zeros", "-o", "run.nc")
        assert result.exit_code == DONE, result.output
