"""Numbers of a report agree with each other, whichever cases failed, and say how many cases they are of."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from study_data import made_up

from deli.numerals import numeral
from deli.plotting.comparison import heat_map, pareto, work_precision
from deli.studies import report
from deli.studies.findings import findings
from deli.studies.matching import word
from deli.studies.states import DONE, EXCLUDED

AXES = ("solver", "step_size", "tolerance")
LEFT_OUT = re.compile(r"(\w+) = ([\w.e+-]+) \((\d+) of (\d+)\)")


def shaken(failed, seed=0, state="failed"):
    """The made-up study with metrics that depend on everything, and cases that failed, whose numbers mean nothing."""
    study = made_up()
    random = np.random.default_rng(seed)
    for name in ("energy_band", "wall_time", "violation_worst"):
        study[name].values = np.exp(random.normal(0.0, 3.0, study[name].shape))
        study[name].values[failed] = 1e30
    study["state"].values[failed] = state
    study["outcome"].values[failed] = "failed"
    return study


def told_by(told, begin):
    """Sentences that begin so."""
    return [sentence for sentence in told if sentence.startswith(begin)]


def bands(told):
    """Energy band by label, and how many cases stand behind each, by axis."""
    found = {}
    for sentence in told_by(told, "Energy band by "):
        axis, count, numbers = re.fullmatch(
            r"Energy band by (\w+) \(geometric mean of (\d+) cases? each\): (.*?)(?:, about .*)?\.", sentence
        ).groups()
        found[axis] = int(count), {part.split()[0]: float(part.split()[1]) for part in numbers.split(", ")}
    return found


failures = st.lists(st.booleans(), min_size=24, max_size=24).map(lambda flags: np.array(flags).reshape(2, 4, 3))
few = st.lists(st.integers(0, 23), max_size=6).map(lambda places: np.isin(np.arange(24), places).reshape(2, 4, 3))


@settings(max_examples=60, deadline=None)
@given(failed=failures | few, seed=st.integers(0, 9))
def test_means_by_one_axis_agree_with_those_by_another(failed, seed):
    study = shaken(failed, seed)
    told = findings(study)
    head, found = told_by(told, "Comparisons are between "), bands(told)
    words = {axis: [word(label) for label in study[axis].values] for axis in AXES}
    kept = {axis: list(labels) for axis, labels in words.items()}
    assert len(head) == failed.any()
    for sentence in head:
        for axis, label, missing, cases in LEFT_OUT.findall(sentence):
            part = failed.take(words[axis].index(label), AXES.index(axis))
            assert (int(missing), int(cases)) == (part.sum(), part.size)
            kept[axis].remove(label)
        count = int(re.match(r"Comparisons are between (\d+) of 24 cases", sentence)[1])
        assert count == np.prod([len(labels) for labels in kept.values()])
    grid = np.ix_(*([words[axis].index(label) for label in kept[axis]] for axis in AXES))
    assert not failed[grid].any()
    means = {axis: np.exp(np.mean(np.log(list(numbers.values())))) for axis, (_, numbers) in found.items()}
    for axis, (count, numbers) in found.items():
        values = study["energy_band"].values[grid]
        assert list(numbers) == kept[axis]
        assert count * len(numbers) == values.size
        others = tuple(other for other in range(3) if other != AXES.index(axis))
        np.testing.assert_allclose(list(numbers.values()), np.exp(np.log(values).mean(axis=others)), rtol=6e-3)
        assert means[axis] == pytest.approx(next(iter(means.values())), rel=1e-2)
    assert not any("e+30" in sentence for sentence in told)


def test_a_backend_that_fails_now_and_then_is_left_out_and_not_the_cases():
    failed = np.zeros((2, 4, 3), dtype=bool)
    failed[1, :, :2] = True  # the slow solver at loose tolerances
    study = shaken(failed).reindex(solver=["quick", "slow", "third"], fill_value=np.nan)
    for name in study.data_vars:
        study[name].loc["third"] = study[name].sel(solver="quick").values
    told = findings(study)
    assert (
        "Comparisons are between 24 of 36 cases; left out because of cases that did not end or are excluded: "
        "solver = slow (8 of 12)." in told
    )
    for axis, count in (("solver", 12), ("step_size", 6), ("tolerance", 8)):
        about = told_by(told, f"The energy band does not depend on {axis}") or told_by(told, f"Energy band by {axis} ")
        assert f"{24 if axis == 'solver' else count} cases" in about[0]


def test_what_is_zero_or_unknown_is_left_out_of_its_own_sentences():
    study = shaken(np.zeros((2, 4, 3), dtype=bool))
    study["energy_band"].loc[{"step_size": 0.1}] = 0.0
    told = findings(study)
    assert not told_by(told, "Comparisons are between")
    assert told_by(
        told, "Energy band by solver (geometric mean of 9 cases each; left out where it is unknown or zero: "
    )
    assert all("step_size = 0.1 (6 of 6)" in sentence for sentence in told_by(told, "Energy band by "))
    assert told_by(told, "Along solver, ")[0].count("of 12 cases each")


def test_members_that_a_scene_does_not_have_are_not_missing():
    """Scenes and seeds are problems: a seed that one scene has and another has not takes nothing away."""
    excluded = np.zeros((2, 4, 3), dtype=bool)
    excluded[:, 1:, 1:] = True
    study = shaken(excluded, state=EXCLUDED).rename(step_size="scene", tolerance="seed")
    study["outcome"].values[excluded] = ""
    told = findings(study)
    assert told[0] == "All 12 cases ended."
    assert not told_by(told, "Comparisons are between")
    assert "geometric mean of 6 cases each" in told_by(told, "Energy band by solver")[0]
    study["state"].values[0, 2, 0] = "failed"
    assert (
        "Comparisons are between 10 of 12 cases; left out because of cases that did not end or are excluded: "
        "0.05, seed = 1e-3 (1 of 2)." in findings(study)
    )


def test_excluded_cases_did_not_fail():
    """A solver that is not tried at a tolerance is not said to fail there."""
    study = made_up(state=({"solver": "slow", "tolerance": 1e-3}, EXCLUDED))
    told = findings(study)
    assert not any("fails at" in sentence for sentence in told)
    assert (study["state"] == DONE).sum() == 20
    study["state"].loc[{"tolerance": 1e-9, "step_size": 0.1}] = "killed"
    assert (
        "Whether contacts last is unknown where no case ended at the tightest tolerance: step_size = 0.1."
        in findings(study)
    )


@settings(max_examples=30, deadline=None)
@given(failed=failures | few)
def test_points_of_a_work_precision_plot_are_means_of_the_same_cases(failed):
    study = shaken(failed)
    axes = work_precision(study, "wall_time", "energy_band", "step_size", "solver")
    tried = ~failed.all(axis=(0, 1))  # a tolerance at which no case ended is no case of any point
    for solver, line in enumerate(axes.lines):
        whole = ~failed[solver][:, tried].any(axis=1) if tried.any() else np.zeros(4, dtype=bool)
        drawn = np.isfinite(line.get_ydata())
        np.testing.assert_array_equal(drawn, whole)
        means = np.exp(np.log(study["energy_band"].values[solver][:, tried]).mean(axis=1))[whole]
        np.testing.assert_allclose(line.get_ydata()[whole], means)
        name = study["solver"].values[solver]
        assert line.get_label() == (name if whole.all() else f"{name} ({whole.sum()} of 4 points)")
    if any(np.isfinite(line.get_ydata()).any() for line in axes.lines) and tried.sum() != 1:
        assert axes.get_legend().get_title().get_text() == f"means of {tried.sum()} cases"


def test_plots_say_of_how_many_cases_they_are():
    failed = np.zeros((2, 4, 3), dtype=bool)
    failed[1, 0, 0] = True
    study = shaken(failed)
    labels = [line.get_label() for line in pareto(study, "wall_time", "energy_band", "solver").lines]
    assert labels == ["quick", "slow (11 of 12 cases)", "best"]
    study["state"].values[0, 1, 1] = EXCLUDED
    colours = heat_map(study, "step_size", "solver", "energy_band").figure.axes[1]
    assert colours.get_ylabel().endswith("worst of 2 to 3 cases")


def test_means_in_a_table_say_of_how_many_cases_they_are(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "MOST_ROWS", 8)
    failed = np.zeros((2, 4, 3), dtype=bool)
    failed[1, 0, 0] = True
    study = shaken(failed)
    study["energy_band"].values[0, 1, :2] = np.nan
    plots = '[[plots]]\nkind = "heat_map"\ntitle = "t"\nx = "step_size"\ny = "solver"\nvalue = "energy_band"'
    study.attrs = {
        "title": "t",
        "study": plots,
        "folder": str(tmp_path),
        "machine": "",
        "workers": 1,
        "deli_version": "",
    }
    _, text = report.write_report(study)
    table = [line.strip("| ").split(" | ") for line in text.read_text().splitlines() if line.startswith("| ")]
    head = table[0]
    rows = {tuple(row[:2]): dict(zip(head, row, strict=True)) for row in table[2:10]}
    assert rows["slow", "0.2"]["state"] == "2"
    assert rows["slow", "0.2"]["energy_band"] == numeral(np.exp(np.log(study.energy_band.values[1, 0, 1:]).mean()), 3)
    assert rows["quick", "0.1"]["energy_band"] == f"{numeral(study.energy_band.values[0, 1, 2], 3)} (1)"
