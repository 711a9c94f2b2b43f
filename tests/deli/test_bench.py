"""`deli bench` measures its parts, stores them, and shows earlier results beside new ones."""

import json

import pytest
from typer.testing import CliRunner

from deli.bench import PARTS, backends, ensemble, registry, scaling, skip, startup, steps
from deli.bench.part import Column, Part
from deli.bench.report import print_part
from deli.bench.runner import measure
from deli.cli import app
from deli.commands.bench import DEFAULT

DONE, INPUT_AT_FAULT = 0, 2


def call(*words):
    return CliRunner().invoke(app, ["bench", *words, "--quick", "--quiet"])


@pytest.fixture(autouse=True)
def tiny(monkeypatch, tmp_path):
    """Measurements so short that they mean nothing."""
    monkeypatch.chdir(tmp_path)
    for module in (steps, skip):
        monkeypatch.setattr(module, "QUICK", (1, 1e-3))
        monkeypatch.setattr(module, "SCENES", module.SCENES[1:2])
    monkeypatch.setattr(scaling, "QUICK", {"hard_rods": (8, 16)})
    monkeypatch.setattr(scaling, "QUICK_BUDGET", 0.05)
    monkeypatch.setattr(scaling, "QUICK_LIMIT", 120.0)
    monkeypatch.setattr(backends, "USUAL", ("daqp",))
    monkeypatch.setattr(startup, "QUICK_REPEAT", 1)
    monkeypatch.setattr(startup, "_RUN", startup._IMPORT)
    monkeypatch.setattr(ensemble, "SCENES", ("point_mass",))
    monkeypatch.setattr(ensemble, "QUICK", (2, 5))
    return tmp_path


def stored(path):
    return json.loads(path.read_text())["parts"]


def test_every_part_has_the_name_it_is_called_by():
    assert [registry.get(name).name for name in PARTS] == list(PARTS)


def test_steps_and_skip(tiny):
    result = call("steps", "skip")
    assert result.exit_code == DONE, result.output
    found = stored(tiny / DEFAULT)
    assert set(found) == {"steps", "skip"}
    for part in found.values():
        assert part["quick"] is True
        assert {"python", "deli", "numba", "cvxpy"} <= set(part["versions"])
        assert part["machine"]["cores"] >= 1
        assert part["date"].startswith("20")
        assert not [row["failed"] for row in part["rows"] if "failed" in row]
    rows = {(row["scene"], row["backend"]): row for row in found["steps"]["rows"]}
    assert set(rows) == {
        ("ball bouncing", "auto"),
        ("ball bouncing", "daqp"),
        ("pogo_stick, Python functions", "auto"),
    }
    assert all(row["us_per_step"] > 0 and 0 <= row["share_solving"] <= 1 for row in rows.values())
    assert rows["pogo_stick, Python functions", "auto"]["us_of_functions"] > 0
    assert found["skip"]["rows"][0]["solves_solve"] >= 1 > found["skip"]["rows"][0]["solves_skip"]


def test_scaling_measures_each_case_in_a_process(tiny):
    result = call("scaling", "-o", "here.json")
    assert result.exit_code == DONE, result.output
    rows = stored(tiny / "here.json")["scaling"]["rows"]
    assert [(row["scene"], row["bodies"]) for row in rows] == [("hard_rods", 8), ("hard_rods", 16)]
    for row in rows:
        assert row["steps"] > 0
        assert row["energy_error"] < 1e-12
        shares = [row[f"share_{part}"] for part in ("search", "kernels", "solves", "recording")]
        assert all(share >= 0 for share in shares)
        assert sum(shares) == pytest.approx(1.0)
    assert "exponent" in rows[-1]


def test_a_case_that_fails_is_a_row_that_says_so(tiny, monkeypatch):
    monkeypatch.setattr(scaling, "QUICK", {"hard_rods": (1, 8)})
    result = call("scaling")
    assert result.exit_code == DONE
    failed, good = stored(tiny / DEFAULT)["scaling"]["rows"]
    assert "at least 2" in failed["failed"] or "rods" in failed["failed"]
    assert failed["failed"] in result.stdout
    assert good["us_per_step"] > 0


def test_a_case_that_takes_too_long_is_a_row_that_says_so(monkeypatch):
    monkeypatch.setattr(scaling, "QUICK", {"hard_rods": (8,)})
    monkeypatch.setattr(scaling, "QUICK_LIMIT", 0.01)
    (row,) = measure(scaling.PART, quick=True, shown=False)
    assert row == {"scene": "hard_rods", "bodies": 8, "failed": "not done after 0 s"}


def test_backends_import_and_ensemble(tiny):
    result = call("backends", "import", "ensemble")
    assert result.exit_code == DONE, result.output
    found = stored(tiny / DEFAULT)
    for row in found["backends"]["rows"]:
        assert row["backend"] == "daqp"
        assert row["compiled"] > 0
        assert row["raw"] > 0
        assert row["verified"] == 1.0
    assert {row["what"] for row in found["import"]["rows"]} >= {"import deli", "deli --help"}
    assert all("failed" in row or row["steps_per_second"] > 0 for row in found["ensemble"]["rows"])


def test_earlier_results_are_shown_beside_new_ones(tiny):
    call("import", "-o", "old.json")
    content = json.loads((tiny / "old.json").read_text())
    for row in content["parts"]["import"]["rows"]:
        row["seconds"] = 98765.25
    (tiny / "old.json").write_text(json.dumps(content))
    result = call("import", "-o", "new.json", "--against", "old.json")
    assert result.exit_code == DONE
    assert "98765.25" in result.stdout
    assert "ratio" in result.stdout
    assert stored(tiny / "new.json")["import"]["rows"][0]["seconds"] < 98765
    again = call("import", "-o", "old.json")
    assert "98765.25" in again.stdout, "the output's own results are those to compare with"


def test_parts_not_measured_stay_in_the_file(tiny):
    call("import")
    before = stored(tiny / DEFAULT)["import"]
    call("ensemble")
    assert stored(tiny / DEFAULT)["import"] == before


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["stepps"], "'stepps' is not a part of the benchmark"),
        (["import", "--against", "none.json"], "none.json cannot be read"),
        (["import", "--against", "text.json"], "text.json holds no results"),
        (["import", "--against", "future.json"], "found format 99"),
        (["import", "-o", "no/folder/x.json"], "cannot be written"),
    ],
)
def test_what_is_refused(tiny, words, what):
    (tiny / "text.json").write_text("hello")
    (tiny / "future.json").write_text('{"format": 99, "parts": {}}')
    result = call(*words)
    assert result.exit_code == INPUT_AT_FAULT
    assert what in result.stderr


def test_a_ratio_is_new_over_before(capsys):
    from rich.console import Console

    columns = (Column("name", "name"), Column("value", "value", ".1f", compared=True))
    part = Part("part", "title", ("name",), columns, lambda quick: [])
    where = {"date": "then", "quick": False, "machine": {"processor": "p"}}
    now = {"rows": [{"name": "a", "value": 3.0}, {"name": "b", "failed": "boom"}, {"name": "c", "value": None}]}
    print_part(Console(width=100), part, now, {**where, "rows": [{"name": "a", "value": 2.0}]})
    text = capsys.readouterr().out
    assert "1.50" in text
    assert "b: boom" in text
