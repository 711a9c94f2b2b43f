"""Studies, figures and plots of reports that nobody means: refused in one line that names the key, or carried out."""

import json
import re
import tomllib

import pytest
import tomli_w
from hostile_judging import DONE, judge, sizes, try_all, words
from hostile_values import FIGURE_FILES, STUDY_FILES, changed_structure, changed_text
from hypothesis import strategies as st

from deli.metrics import METRICS
from deli.studies.model import StudyTable

LABEL = "../../outside/$x$"
FEW = 2  # values of an axis that are kept of a shipped study
EVERYTHING = """
title = "All that a study can say"
workers = 1
time_steps = true
[base]
scene = { name = "newtons_cradle", balls = 2 }
step_size = 0.01
steps = 4
[axes]
"solvers.default" = ["native", { backend = "native", tolerance = 1e-6, label = "loose" }]
scene.perturbation.seed = { count = 2 }
[[zip]]
name = "length"
values = { steps = [4, 6], record.every = [1, 2] }
labels = ["short", "long"]
[[cases]]
label = "plain"
[[cases]]
label = "heavy"
scene.mass = 5.0
[[exclude]]
solver = "loose"
case = ["heavy"]
[reference]
step_size = 0.005
[limits]
time = 60.0
memory = "2 GB"
[[plots]]
kind = "pareto"
title = "Worth its time?"
x = "wall_time"
y = "energy_band"
by = "solver"
[quick]
base.steps = 2
"""


def shortened(path):
    """A shipped study, with few values on each axis."""
    table = tomllib.loads(path.read_text())
    table.pop("exclude", None)  # of values that are no more
    axes = table.get("axes", {})
    for key, values in axes.items():
        axes[key] = values[:FEW] if isinstance(values, list) else values
    for entry in table.get("zip", []):
        entry["values"] = {key: values[:FEW] for key, values in entry["values"].items() if isinstance(values, list)}
        entry.pop("labels", None)
    table["cases"] = table.get("cases", [])[:FEW]
    return table


STUDIES = [tomllib.loads(EVERYTHING)] * 10 + [shortened(path) for path in STUDY_FILES]


@pytest.fixture
def planned(victim, tmp_path):
    """Plan one study, and judge what became of it; nothing is written."""
    place = tmp_path / "study.toml"

    def carry_out(case):
        content, quick = case
        place.write_bytes(content if isinstance(content, bytes) else content.encode())
        judge(victim.run(tmp_path, "study", place.name, "--dry-run", *quick), *words(content))

    yield carry_out
    assert {path.name for path in tmp_path.iterdir()} == {"study.toml"}


QUICK = st.sampled_from([(), ("--quick",)])


@sizes(35, 2500)
def test_studies_with_other_entries(planned, examples):
    try_all(st.tuples(st.sampled_from(STUDIES).flatmap(changed_structure), QUICK), examples, planned)


@sizes(20, 1500)
def test_studies_with_other_letters(planned, examples):
    try_all(st.tuples(st.sampled_from([EVERYTHING]).flatmap(changed_text), QUICK), examples, planned)


@pytest.mark.long
def test_studies_that_run(victim, tmp_path):
    """What is planned runs: values that only a solver or a worker would stumble upon are refused or recorded."""

    def check(case):
        number = len(list(tmp_path.iterdir()))
        (tmp_path / f"study{number}.toml").write_text(case)
        outcome = victim.run(tmp_path, "study", f"study{number}.toml", "-q")
        if outcome.status != 1:  # 1: cases failed, which are told one a line
            judge(outcome, *words(case))
        assert not outcome.fault

    small = tomllib.loads(EVERYTHING) | {"zip": [], "reference": {"exact": False}}
    try_all(changed_structure(small), 40, check)


@sizes(15, 1200)
def test_figures(victim, tmp_path, examples):
    """Configs of figures, listed or made from two steps."""
    (tmp_path / "configs").mkdir()

    def check(case):
        text, way = case
        (tmp_path / "configs" / "1.toml").write_bytes(text.encode() + b"\n[quick]\nsteps = 2\n")
        arguments = ("figures", "--configs", "configs", "-o", "made", *way)
        judge(victim.run(tmp_path, *arguments), *words(text))
        assert {path.name for path in tmp_path.iterdir()} <= {"configs", "made"}

    ways = st.sampled_from([("--list",), ("--list",), ("--quick", "-q")])
    tables = [
        {key: value for key, value in tomllib.loads(path.read_text()).items() if key != "quick"}
        for path in FIGURE_FILES
    ]
    try_all(st.tuples(st.sampled_from(tables).flatmap(changed_structure), ways), examples, check)


@pytest.fixture(scope="module")
def finished(victim, tmp_path_factory):
    """The folder of a finished study."""
    place = tmp_path_factory.mktemp("finished")
    table = tomllib.loads(EVERYTHING) | {"zip": [], "cases": [], "exclude": [], "reference": {"exact": False}}
    table["title"] = "../../outside"
    table["base"]["record"] = {"output": "../outside.nc"}
    table["axes"]["solvers.default"][1]["label"] = LABEL
    (place / "study.toml").write_text(tomli_w.dumps(table))
    judge(victim.run(place, "study", "study.toml", "-o", "out", "-q"))
    return place


def test_words_of_a_study_name_no_files(finished):
    """Cases are named by what they are, whatever they are called."""
    assert {path.name for path in finished.iterdir()} == {"study.toml", "out"}
    assert not (finished.parent / "outside.nc").exists()
    made = [path.name for path in (finished / "out" / "cases").iterdir()]
    assert len(made) == 3 * 4
    assert all(re.fullmatch(r"[0-9a-f]{16}\.(nc|toml|json)", name) for name in made)


AXES = {"solver": ["native", LABEL], "seed": [0, 1]}
METRIC = st.sampled_from(["wall_time", "energy_band", "solves", "trajectory_error", *METRICS])
HOSTILE = st.sampled_from(["state", "file", "", "$x$", "outcome", "time", "__class__", "solver", "seed", "wall_time"])
TITLES = st.sampled_from(["Plain", "$\\frac{", "![](/etc/passwd)", "<img src=/etc/passwd>", "|", "```", "# *a* <b>"])
KINDS = {
    "pareto": {"x": METRIC, "y": METRIC},
    "work_precision": {"cost": METRIC, "error": METRIC, "along": st.just("seed")},
    "heat_map": {"x": st.just("seed"), "y": st.just("solver"), "value": METRIC},
    "profile": {"cost": METRIC, "by": st.sampled_from(list(AXES))},
    "energy_traces": {"by": st.sampled_from(list(AXES))},
    "pie": {},
}


@st.composite
def plot(draw):
    """A plot of a report, with something in it that there is not in half of the cases."""
    kind = draw(st.sampled_from(list(KINDS)))
    table = {"kind": kind, "title": draw(TITLES)} | {key: draw(names) for key, names in KINDS[kind].items()}
    axis = draw(st.sampled_from(list(AXES)))
    if draw(st.booleans()):
        table["where"] = {axis: draw(st.sampled_from(AXES[axis]))}
    if draw(st.booleans()):
        change = draw(st.sampled_from(("name", "panels", "where", "label", "key")))
        key = draw(st.sampled_from(["x", "y", "by", "cost", "error", "along", "value", "panels"]))
        if change in ("name", "key"):
            table[key] = draw(HOSTILE)
        elif change == "panels":
            table["panels"] = axis
        else:
            labels = st.sampled_from([0, 7, "native", True, [0], {}, 0.0, "$x$"])
            table["where"] = {draw(HOSTILE) if change == "where" else axis: draw(labels)}
    return table


@sizes(3, 400)
def test_plots_of_a_report(victim, finished, examples):
    """Plots of what a study does not have are refused; a report shows no file but its own pictures."""
    manifest = finished / "out" / "manifest.json"
    found = json.loads(manifest.read_text())

    def check(case):
        plots, title = case
        text = tomli_w.dumps({"plots": plots}) + "\n# ``` ![](/etc/passwd)\n"
        manifest.write_text(json.dumps(found | {"study": text, "title": title}))
        outcome = judge(victim.run(finished, "report", "out"), *words(text))
        if outcome.status == DONE:
            page = (finished / "out" / "report.html").read_text()
            assert all(source.startswith("data:image/png") for source in re.findall(r'<img[^>]*src="([^"]*)', page))
            assert len(re.findall("<img", page)) == len(plots) or not plots
        assert {path.name for path in (finished / "out").iterdir()} <= {
            "manifest.json", "cases", ".lock", "report", "report.html", "report.md",
        }  # fmt: skip

    titles = TITLES | st.just("a\n\n![](../study.toml)")
    try_all(st.tuples(st.lists(plot(), max_size=2), titles), examples, check)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            "".join(f'"scene.x{axis}" = {{ count = 100 }}\n' for axis in range(12)),
            "1,000,000,000,000,000,000,000,000 combinations",
        ),
        ('"scene.perturbation.seed" = { count = 1_000_000_000 }', "axes.scene.perturbation.seed.count is 1000000000"),
        ("".join(f"x{axis} = {[*range(300)]}\n" for axis in range(3)), "27,000,000 combinations"),
    ],
)
def test_too_many_cases_are_counted_and_not_made(victim, tmp_path, lines, said):
    (tmp_path / "study.toml").write_text(f'[base]\nscene = "point_mass"\nsteps = 1\n[axes]\n{lines}')
    outcome = judge(victim.run(tmp_path, "study", "study.toml", "--dry-run"), "combinations")
    assert said in outcome.errors
    assert "allowed" in outcome.errors or "less than or equal" in outcome.errors
    assert outcome.grown < 50_000_000


def test_the_study_that_is_changed_says_all_that_studies_can():
    assert {*StudyTable.model_fields, "quick"} == set(tomllib.loads(EVERYTHING))
