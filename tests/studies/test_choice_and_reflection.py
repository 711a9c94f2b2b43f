"""The studies of solvers and of reflections expand, in full and quick, to the cases that their notebooks read."""

from pathlib import Path

import pytest

import solvers
from deli.studies.expansion import load

STUDIES = Path(__file__).parents[2] / "studies"
QUICK_STEPS = 200_000


@pytest.mark.parametrize("name", ["solver_choice", "reflection"])
@pytest.mark.parametrize("quick", [False, True], ids=["full", "quick"])
def test_the_study_expands(name, quick):
    study = load(STUDIES / f"{name}.toml", quick)
    scenes = {case.labels["scene"] for case in study.cases}
    assert {"solver_choice": {"sphere mixed", "cradle"}, "reflection": {"sphere mixed", "wedge"}}[name] <= scenes
    assert len({case.digest for case in study.cases}) == len(study.cases)
    if quick:
        assert sum(case.steps for case in study.cases) < QUICK_STEPS


def test_every_installed_solver_is_asked_and_nothing_is_skipped():
    cases = load(STUDIES / "solver_choice.toml", True).cases
    assert {case.labels["solver"] for case in cases} == set(solvers.available())
    assert not any(case.config["skip"] for case in cases)


def test_symmetric_starts_are_not_disturbed():
    for case in load(STUDIES / "reflection.toml").cases:
        if case.labels["scene"] in {"oscillator", "wedge", "row", "cradle", "sphere mixed"}:
            assert case.labels["seed"] == 0
            assert case.config["scene"]["perturbation"]["momentum"] == 0.0
