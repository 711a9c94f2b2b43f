"""Sentences about a study are those that its numbers allow."""

import numpy as np
import pytest
from study_data import made_up

from deli.plotting.comparison import work_precision
from deli.studies.findings import findings

ONE = {"solver": "slow", "step_size": 0.1, "tolerance": 1e-3}


def test_what_a_clean_study_says():
    told = findings(made_up())
    assert told == [
        "All 24 cases ended.",
        "Contacts last at every tolerance up to 1e-3 with every solver.",
        "Along solver, quick takes the least wall time; times as much (geometric mean of 12 cases each): slow 3.",
        "Along step_size, 0.2 takes the least wall time; times as much (geometric mean of 6 cases each): 0.1 2, "
        "0.05 4, 0.025 8.",
        "Wall time does not depend on tolerance (within 5 %, 8 cases each).",
        "The energy band does not depend on solver (within 5 % in all 24 cases compared).",
        "Energy band by step_size (geometric mean of 6 cases each): 0.2 8.00e-02, 0.1 2.00e-02, 0.05 5.00e-03, "
        "0.025 1.25e-03, about step_size^2.",
        "The energy band does not depend on tolerance (within 5 % in all 24 cases compared).",
        "The worst violation by tolerance (of 8 cases each): 1e-3 1.0e-12, 1e-6 1.0e-15, 1e-9 1.0e-18.",
        "Energy drifts in none of 24 cases (beyond 4 standard errors and a tenth of its band).",
        "The worst violation in 24 cases is 1.0e-12, with solver = quick, step_size = 0.2, tolerance = 1e-3.",
        "Of 240 solves in 24 cases 240 were verified to their tolerance; 0 were claimed and do not hold, 0 hold and "
        "were not claimed.",
    ]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {
                "state": (ONE, "failed"),
                "outcome": (ONE, "failed in step 7 (from time 0.7): position: 3 rows did not converge; use daqp"),
            },
            "23 of 24 cases ended; others: 1 failed (position: 3 rows did not converge).",
        ),
        (
            {"smooth_contacts": (ONE, 1.9)},
            "Contacts last with step_size = 0.1: up to tolerance 1e-3 with quick; up to tolerance 1e-6 with slow.",
        ),
        (
            {"energy_drift": (ONE, 1e-3)},
            "Energy drifts in 1 of 24 cases; most with solver = slow, step_size = 0.1, tolerance = 1e-3: +1.0e-03 a "
            "unit of time.",
        ),
        (
            {"verified_solves": (ONE, 4.0)},
            "Of 240 solves in 24 cases 234 were verified to their tolerance; 6 were claimed and do not hold, 0 hold "
            "and were not claimed.",
        ),
        (
            {"violation_worst": (ONE, 0.25)},
            "The worst violation in 24 cases is 2.5e-01, with solver = slow, step_size = 0.1, tolerance = 1e-3.",
        ),
    ],
    ids=["failure", "contact lost", "drift", "claim", "violation"],
)
def test_what_one_case_changes(changes, sentence):
    assert sentence in findings(made_up(**changes))


def test_failed_cases_are_left_out_of_comparisons():
    spoiled = made_up(state=(ONE, "failed"), outcome=(ONE, "failed"), wall_time=(ONE, 1e9), energy_band=(ONE, 1e9))
    told = findings(spoiled)
    assert (
        "Comparisons are between 18 of 24 cases; left out because of cases that did not end or are excluded: "
        "step_size = 0.1 (1 of 6)." in told
    )
    assert (
        "Along solver, quick takes the least wall time; times as much (geometric mean of 9 cases each): slow 3." in told
    )
    assert not any("e+09" in sentence for sentence in told)


def test_contacts_that_no_tolerance_keeps():
    told = findings(made_up(smooth_contacts=({"solver": "slow"}, 0.5)))
    assert (
        "Contacts last up to tolerance 1e-3 with quick; at no tolerance that was tried with slow." in told
    )  # measured by what the other solver keeps


def test_what_fails_is_not_said_to_keep_contacts():
    failed = {"solver": "slow", "tolerance": [1e-9, 1e-6]}
    told = findings(made_up(state=(failed, "failed"), outcome=(failed, "failed")))
    assert "Contacts last up to tolerance 1e-3 with quick, slow (which fails at 2 of 3)." in told


def test_lost_contacts_that_bounce_are_counted():
    told = findings(made_up(smooth_contacts=(ONE, 0.0), reflected_contacts=(ONE, 40.0)))
    assert (
        "What should slide or rest bounces where contacts are lost: 40 reflections instead of 0 with step_size = 0.1, "
        "solver = slow, tolerance = 1e-3." in told
    )


def test_what_an_impact_does_to_energy_is_told_by_scene():
    place = {"operator": "quick", "scene": "gas"}
    study = made_up(drift_per_impact=({"solver": "quick", "step_size": 0.1}, 2e-3))
    study = study.rename(solver="operator", step_size="scene").assign_coords(scene=["ball", "gas", "pile", "chain"])
    sentence = "Energy drift per reflected contact by operator (root mean square): gas quick 2.0e-03, slow 0.0e+00 "
    sentence += "(3 cases each)."
    assert sentence in findings(study)
    study["drift_per_impact"].loc[place] = 0.0
    assert "The energy drift per reflected contact does not depend on operator (24 cases compared)." in findings(study)


def test_members_of_an_ensemble_are_not_compared():
    told = findings(made_up().rename(tolerance="seed"))
    assert len(told) > 4
    assert not any("by seed" in sentence or "on seed" in sentence or "Along seed" in sentence for sentence in told)


def test_points_that_differ_by_rounding_alone_are_drawn():
    """Means of equal numbers, and zeros, which stand at the bottom of a logarithmic axis."""
    data = made_up()
    data["reflected_contacts"][:] = 1e-17 * np.linspace(1.0, 1.0 + 1e-15, data.reflected_contacts.size).reshape(2, 4, 3)
    for error in ("reflected_contacts", "momentum_error", "smooth_contacts"):
        axes = work_precision(data, "wall_time", error, "step_size", "solver")
        low, high = axes.get_ylim()
        drawn = np.concatenate([line.get_ydata() for line in axes.lines])
        assert low < drawn.min() <= drawn.max() < high
        assert axes.get_yscale() == "log"
