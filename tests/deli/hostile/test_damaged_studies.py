"""Folders of studies in which files are damaged: one message that names the file, or the study as it was."""

import copy
import json
import random
import shutil

import pytest
import tomli_w
from running import DONE, call, refused

import deli
from deli.errors import InputError
from deli.studies.expansion import make_study
from deli.studies.running import plan_study, run_study

TABLE = {
    "base": {"scene": "point_mass", "step_size": 0.01, "steps": 20},
    "axes": {"scene.mass": [1.0, 2.0], "skip": [True, False]},
    "workers": 1,
}
STRANGE = (None, True, -1, 2**70, 1.5, "", "../../elsewhere", "x" * 10_000, [], [[]], {}, {"a": 1}, ["a", "b"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    assert run_study(make_study(TABLE, folder), folder / "out", workers=1).states == {"done": 4}
    return folder / "out"


@pytest.fixture
def out(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "out")
    return tmp_path / "out"


def sidecar(out):
    return sorted((out / "cases").glob("*.json"))[0]


def plan(out):
    return [(decision.action, decision.why) for decision in plan_study(make_study(TABLE, out.parent), out)]


def places(value, path=()):
    """Where there are values in a document."""
    yield path
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield from places(one, (*path, key))


def changed(document, path, value):
    if not path:
        return value
    document = copy.deepcopy(document)
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return document


def look(out):
    """Do what readers do; return what was refused, if anything was."""
    try:
        deli.open_study(out)
        plan(out)
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("count", [150, pytest.param(3000, marks=pytest.mark.long)])
@pytest.mark.parametrize("which", ["manifest", "metrics"])
def test_a_document_with_strange_values_is_refused_or_read(out, count, which):
    rng, file = random.Random(4), out / "manifest.json" if which == "manifest" else sidecar(out)
    document = json.loads(file.read_text())
    everywhere, refusals = sorted(places(document), key=str), 0
    for _ in range(count):
        file.write_text(json.dumps(changed(document, rng.choice(everywhere), rng.choice(STRANGE))))
        refusal = look(out)
        assert not refusal or str(file) in refusal
        refusals += bool(refusal)
    assert refusals > count / 4


@pytest.mark.parametrize("count", [100, pytest.param(2000, marks=pytest.mark.long)])
def test_a_document_of_damaged_bytes_is_refused_or_read(out, count):
    rng = random.Random(5)
    for file in (out / "manifest.json", sidecar(out)):
        content = file.read_bytes()
        for _ in range(count // 2):
            data = bytearray(content)
            for _ in range(rng.randrange(1, 4)):
                data[rng.randrange(len(data))] = rng.randrange(256)
            file.write_bytes(data[: rng.choice((len(data), rng.randrange(len(data))))])
            refusal = look(out)
            assert not refusal or str(file) in refusal
        file.write_bytes(content)


@pytest.mark.parametrize("text", ["", "[" * 100_000, "[1, 2]", '{"format": 1}', '{"format": 9}', "\0", "9" * 10_000])
def test_a_manifest_that_is_none_is_refused_by_every_command(out, text):
    (out / "manifest.json").write_text(text)
    (out.parent / "study.toml").write_text(tomli_w.dumps(TABLE))
    for command in (["report", out], ["study", out.parent / "study.toml", "-o", out]):
        refused(call(*command), "manifest.json")
    with pytest.raises(InputError, match=r"manifest\.json"):
        deli.open_study(out)


def test_a_lost_manifest_is_made_again_of_the_runs_that_are_there(out):
    before = deli.open_study(out)
    (out / "manifest.json").unlink()
    assert {action for action, _ in plan(out)} == {"keep"}
    run_study(make_study(TABLE, out.parent), out, workers=1)
    after = deli.open_study(out)
    assert after.drop_vars("wall_time").identical(before.drop_vars("wall_time").assign_attrs(after.attrs))


def test_damaged_metrics_are_measured_again_and_damaged_partial_files_begun_again(out):
    before, beside = deli.open_study(out), sidecar(out)
    beside.write_text(beside.read_text()[:-10])
    with pytest.raises(InputError, match=beside.name):
        deli.open_study(out)
    refused(call("report", out), beside.name)

    manifest = json.loads((out / "manifest.json").read_text())
    digest = next(case["digest"] for case in manifest["cases"] if case["digest"] != beside.stem)
    file = out / "cases" / f"{digest}.nc"
    (out / "cases" / f"{digest}.nc.partial").write_bytes(file.read_bytes()[:1000])
    file.unlink()
    manifest["runs"][digest] |= {"state": "interrupted"}
    (out / "manifest.json").write_text(json.dumps(manifest))

    whys = [why for action, why in sorted(plan(out)) if action != "keep"]
    assert len(whys) == 2
    assert beside.name in whys[0]
    assert whys[1].startswith("cannot be continued")
    assert run_study(make_study(TABLE, out.parent), out, workers=1).states == {"done": 4}
    after = deli.open_study(out)
    clocks = ["wall_time", "solver_time"]
    assert after.drop_vars(clocks).identical(before.drop_vars(clocks).assign_attrs(after.attrs))


def test_a_damaged_run_is_refused_alone_and_runs_again(out):
    study = deli.open_study(out)
    labels = {"mass": 1.0, "skip": True}
    file = out / study.file.sel(labels).item()
    content = file.read_bytes()
    file.write_bytes(content[:1000])
    with pytest.raises(InputError, match=rf"{file.name} is damaged: it was cut off"):
        study.deli.run(**labels)
    assert study.deli.run(mass=2.0, skip=True).attrs["outcome"] == "complete"
    assert call("report", out).exit_code == DONE
    whys = [why for action, why in plan(out) if action == "run"]
    assert len(whys) == 1
    assert f"{file.name} is damaged: it was cut off" in whys[0]
    assert run_study(make_study(TABLE, out.parent), out, workers=1).states == {"done": 4}
    assert study.deli.run(**labels).attrs["outcome"] == "complete"


def test_a_digest_leads_nowhere_else(out):
    manifest = json.loads((out / "manifest.json").read_text())
    digest = manifest["cases"][0]["digest"]
    text = json.dumps(manifest).replace(digest, f"../../{digest}")
    (out / "manifest.json").write_text(text)
    with pytest.raises(InputError, match="is damaged"):
        deli.open_study(out)
