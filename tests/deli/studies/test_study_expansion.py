"""From a study file to its cases."""

import itertools
import math

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from running import call, refused
from study_cases import BALL, study

import deli
import solvers
from deli.config import parse
from deli.studies.expansion import digest_of, load, make_study

KEYS = ["scene.mass", "scene.gravity", "contact_tolerance", "record.every"]
AXES = st.dictionaries(
    st.sampled_from(KEYS), st.lists(st.integers(1, 9), min_size=1, max_size=3, unique=True), min_size=1
).map(lambda axes: {key: [v / 10 for v in vs] if key == "contact_tolerance" else vs for key, vs in axes.items()})


@settings(deadline=None, max_examples=25)
@given(AXES)
def test_axes_are_multiplied(axes):
    found = make_study({"base": BALL, "axes": axes}, None)
    assert len(found.cases) == math.prod(map(len, axes.values()))
    assert len({case.digest for case in found.cases}) == len(found.cases)
    names = [dimension.name for dimension in found.dimensions]
    assert [tuple(case.labels.values()) for case in found.cases] == list(itertools.product(*axes.values()))
    assert names == [key.split(".")[-1] for key in axes]


@settings(deadline=None, max_examples=25)
@given(AXES, st.data())
def test_exclusions_take_out_what_matches_all_they_say(axes, data):
    key = data.draw(st.sampled_from(sorted(axes)))
    rule = {key: data.draw(st.lists(st.sampled_from(axes[key]), min_size=1, unique=True))}
    other = data.draw(st.sampled_from(sorted(axes)))
    if other != key:
        rule[other] = data.draw(st.sampled_from(axes[other]))
    kept = [
        labels
        for labels in itertools.product(*axes.values())
        if not all(
            label in (rule[name] if isinstance(rule[name], list) else [rule[name]])
            for name, label in zip(axes, labels, strict=True)
            if name in rule
        )
    ]
    table = {"base": BALL, "axes": axes, "exclude": [rule]}
    if not kept:
        with pytest.raises(deli.InputError, match="exclude leaves no case"):
            make_study(table, None)
    else:
        assert [tuple(case.labels.values()) for case in make_study(table, None).cases] == kept


TABLES = st.recursive(
    st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=3) | st.booleans(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=4),
    max_leaves=8,
)


def shuffled(value, order):
    if isinstance(value, list):
        return [shuffled(entry, order) for entry in value]
    if not isinstance(value, dict):
        return value
    keys = sorted(value)
    order.shuffle(keys)
    return {key: shuffled(value[key], order) for key in keys}


@given(st.dictionaries(st.text(max_size=3), TABLES, max_size=4), st.randoms(use_true_random=False))
def test_a_digest_does_not_depend_on_the_order_of_keys(table, order):
    assert digest_of(table) == digest_of(shuffled(table, order))


def test_a_digest_depends_on_every_value():
    assert digest_of({"a": 1, "b": {"c": 2.0}}) == digest_of({"b": {"c": 2}, "a": 1.0})
    different = [{"a": 1}, {"a": 2}, {"b": 1}, {"a": [1]}, {"a": "1"}, {"a": 1.5}]
    assert len({digest_of(table) for table in different}) == len(different)


def test_a_case_s_config_is_complete_and_reruns_it(tmp_path):
    found = study(tmp_path, axes={"scene.perturbation.seed": {"count": 3}, "scene.perturbation.position": [0.1]})
    assert [case.labels["seed"] for case in found.cases] == [0, 1, 2]
    starts = set()
    for case in found.cases:
        plan = parse(case.config).plan()
        assert digest_of(plan.config()) == case.digest
        starts.add(plan.scene.position.item())
    assert len(starts) == 3


def test_zips_and_cases_are_dimensions_of_their_own(tmp_path):
    found = study(
        tmp_path,
        axes={"solvers.default": ["daqp", {"backend": "osqp", "tolerance": 1e-6, "label": "loose"}]},
        zip=[{"name": "resolution", "values": {"step_size": [0.1, 0.05], "record": {"every": [1, 2]}}}],
        cases=[{"label": "heavy", "scene.mass": 5.0}, {"method": {"name": "moreau_jean"}}],
    )
    assert [dimension.name for dimension in found.dimensions] == ["solver", "resolution", "case"]
    assert [len(dimension.positions) for dimension in found.dimensions] == [2, 2, 2]
    assert [position.label for position in found.dimensions[1].positions] == ["0.1, 1", "0.05, 2"]
    heavy, moreau = found.cases[-2], found.cases[-1]
    assert heavy.labels == {"solver": "loose", "resolution": "0.05, 2", "case": "heavy"}
    assert heavy.config["scene"]["mass"] == 5.0
    assert (heavy.config["step_size"], heavy.config["record"]["every"]) == (0.05, 2)
    assert heavy.config["solvers"]["position"]["tolerance"] == 1e-6
    assert moreau.config["method"]["name"] == "moreau_jean"


def test_a_reference_keeps_what_it_does_not_change(tmp_path):
    found = study(tmp_path, axes={"step_size": [0.01, 0.02], "scene.mass": [1.0, 2.0]}, reference={"step_size": 0.001})
    assert len(found.references) == 4
    assert len({reference.digest for reference in found.references.values()}) == 4  # 20 steps end at two times
    for case in found.cases:
        reference = found.references[case.digest].config
        assert reference["scene"] == case.config["scene"]
        assert reference["steps"] * 0.001 == pytest.approx(20 * case.config["step_size"])
    assert next(iter(found.runs)) == next(iter(found.references.values())).digest


def test_the_base_is_relative_to_the_study(folder):
    (folder / "configs").mkdir()
    (folder / "configs" / "ball.toml").write_text(tomli_w.dumps(BALL))
    (folder / "studies").mkdir()
    path = folder / "studies" / "masses.toml"
    path.write_text('base = "../configs/ball.toml"\naxes.scene.mass = [1.0, 2.0]\n')
    found = load(path)
    assert [case.labels for case in found.cases] == [{"mass": 1.0}, {"mass": 2.0}]
    assert found.title == "masses"


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"axs": {}}, ["axs is an unknown key", "'axes'"]),
        ({}, ["varies nothing"]),
        ({"axes": {"step_size": 0.1}}, ["axes.step_size is 0.1", "a list"]),
        ({"axes": {"step_size": []}}, ["axes.step_size.values", "at least 1"]),
        ({"axes": {"step_size": {"count": 3, "values": [1]}}}, ["axes.step_size", "exactly one"]),
        ({"axes": {"stepsize": [0.1]}}, ["case stepsize = 0.1", "did you mean 'step_size'"]),
        ({"axes": {"scene.mass": [1.0, -1.0]}}, ["case mass = -1.0", "mass", "> 0"]),
        ({"axes": {"scene.mass": [1.0, 1.0]}}, ["label of mass 1.0 occurs twice"]),
        ({"axes": {"scene.mass": [1.0]}, "cases": [{"scene.mass.value": 1}]}, ["mass", "not a table"]),
        ({"axes": {"steps": [10, 20]}}, ["'steps'", "give it another"]),
        ({"axes": {"step_size": [float("nan")]}}, ["axes.step_size.0 is nan"]),
        ({"zip": [{"name": "z", "values": {"step_size": [0.1, 0.2], "skip": [True]}}]}, ["zip.0 (z)", "one length"]),
        ({"axes": {"scene.mass": [1.0]}, "exclude": [{"maas": 1.0}]}, ["exclude.0", "did you mean 'mass'"]),
        ({"axes": {"scene.mass": [1.0]}, "exclude": [{"mass": 3.0}]}, ["exclude.0.mass is 3.0", "allowed: 1.0"]),
        ({"axes": {"scene.mass": [1.0]}, "limits": {"memory": "2 apples"}}, ["limits.memory", "2 GB"]),
        ({"axes": {"scene.mass": [1.0]}, "limits": {"time": 0}}, ["limits.time", "greater than 0"]),
        ({"axes": {"scene": ["pogo_stick"]}, "reference": {"exact": True}}, ["no closed form", "point_mass"]),
        ({"axes": {"scene.mass": [1.0]}, "reference": {"step_siz": 1}}, ["reference", "step_siz"]),
        ({"axes": {"scene.mass": [1.0]}, "reference": {"steps": 5}}, ["reference", "let it last as long"]),
        ({"axes": {"scene.mass": [1.0]}, "workers": 0}, ["workers is 0"]),
        ({"base": "no.toml", "axes": {"scene.mass": [1.0]}}, ["no.toml cannot be read"]),
    ],
)
def test_what_is_refused(folder, table, words):
    (folder / "wrong.toml").write_text(tomli_w.dumps({"base": BALL, **table}))
    refused(call("study", "wrong.toml"), "wrong.toml", *words)
    assert [path.name for path in folder.iterdir()] == ["wrong.toml"]


def test_a_quick_form_changes_what_it_says(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        """
        [base]
        scene.name = "point_mass"
        steps = 1000
        [axes]
        step_size = [0.1, 0.01, 0.001]
        "solvers.default.tolerance" = [1e-6, 1e-9]
        [quick]
        base.steps = 10
        axes.step_size = [0.1]
        """
    )
    full, quick = load(path), load(path, quick=True)
    assert [len(full.cases), len(quick.cases)] == [6, 2]
    assert {case.steps for case in full.cases} == {1000}
    assert {(case.steps, case.config["step_size"]) for case in quick.cases} == {(10, 0.1)}
    path.write_text(path.read_text().split("[quick]")[0])
    with pytest.raises(deli.InputError, match=r"no table \[quick\]"):
        load(path, quick=True)


def test_installed_stands_for_all_backends():
    table = {"base": {"scene": "point_mass", "steps": 1}, "axes": {"solvers.default.backend": "installed"}}
    assert [case.labels["solver"] for case in make_study(table, None).cases] == solvers.available()
    with pytest.raises(deli.InputError, match=r"axes\.step_size is .installed.; allowed: a list of values"):
        make_study({**table, "axes": {"step_size": "installed"}}, None)
