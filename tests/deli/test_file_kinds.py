"""Every command with every kind of file: what it does not take, it names, with the command that does."""

import json
import shutil
from pathlib import Path

import pytest
from running import DONE, INPUT_AT_FAULT, SHORT, call, refused

from deli.commands import files

PAPER = Path(__file__).parents[2] / "studies/paper"
CONFIG = 'steps = 10\nscene = "point_mass"\n'

COMMANDS = {
    "run": lambda file: ("run", file, "--dry-run"),
    "study": lambda file: ("study", file, "--dry-run"),
    "report": lambda file: ("report", file),
    "plot": lambda file: ("plot", file, "-o", "made.png"),
    "animate": lambda file: ("animate", file, "-o", "made.gif", "--every", "10"),
    "check": lambda file: ("check", file),
    "replay": lambda file: ("replay", file, "-b", "daqp"),
    "figures": lambda file: ("figures", "--configs", file, "--list"),
}
KINDS = {
    "config.toml": (files.CONFIG, {"run", "check"}),
    "study.toml": (files.STUDY, {"study"}),
    "8.2c.toml": (files.FIGURE, set()),
    "run.nc": (files.NETCDF, {"plot", "animate", "check", "replay"}),
    "studied": (files.STUDY_FOLDER, {"report"}),
    "drawn": (files.FIGURE_FOLDER, set()),
    "configs": (files.CONFIG_FOLDER, {"figures"}),
    "empty": (files.FOLDER, set()),
    "t1.py": (files.PYTHON, set()),
    "first.ipynb": (files.NOTEBOOK, set()),
    "ball.png": (files.PICTURE, set()),
    "bench.json": (files.RESULTS, set()),
    "report.html": (files.PAGE, set()),
}


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    """A folder with a file of each kind."""
    folder = tmp_path_factory.mktemp("kinds")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("config.toml").write_text(CONFIG)
        Path("study.toml").write_text('base = "config.toml"\n[axes]\nstep_size = [0.1, 0.2]\n')
        shutil.copy(PAPER / "8.2c.toml", folder)
        shutil.copytree(PAPER, "configs")
        assert call("run", "config.toml", "-o", "run.nc", "--set", "record.subproblems=true", "-q").exit_code == DONE
        assert call("study", "study.toml", "-o", "studied", "-q", "--workers", "1").exit_code == DONE
        assert call("figures", "8.2c", "--quick", "-o", "drawn", "-q").exit_code == DONE
        Path("empty").mkdir()
        shutil.copy("drawn/8.2c.png", "ball.png")
        Path("t1.py").write_text("import deli\n")
        Path("first.ipynb").write_text(json.dumps({"cells": [], "nbformat": 4}))
        Path("bench.json").write_text("{}")
        Path("report.html").write_text("<html></html>")
    return folder


@pytest.fixture
def there(kinds, tmp_path, monkeypatch):
    monkeypatch.chdir(shutil.copytree(kinds, tmp_path / "kinds"))


def test_every_kind_is_tried():
    assert {kind for kind, _ in KINDS.values()} == {one for one in vars(files).values() if isinstance(one, files.Kind)}


@pytest.mark.usefixtures("there")
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("file", KINDS)
def test_a_command_and_a_file(command, file):
    kind, takers = KINDS[file]
    before = sorted(Path().rglob("*"))
    result = call(*COMMANDS[command](file))
    told = f"{file} is {kind.name}: {kind.taken_by}; deli {command} takes "
    if command in takers:
        assert told not in result.stderr
        assert result.exit_code == DONE or "holds no subproblems" in result.stderr
    elif file == "empty" and command in ("figures", "report"):
        refused(result, {"figures": "empty holds no figure configs", "report": "holds no study"}[command])
    else:
        refused(result, told)
        assert sorted(Path().rglob("*")) == before


@pytest.mark.usefixtures("there")
def test_what_a_file_is_does_not_hang_on_its_suffix():
    shutil.copy("run.nc", "run.dat")
    refused(call("run", "run.dat"), "run.dat is a netCDF file")
    shutil.copy("run.nc", "run.toml")
    refused(call("study", "run.toml"), "run.toml is a netCDF file")
    assert call("plot", "run.dat").exit_code == DONE


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("text", ["", "bse = 1\n", "nonsense", "= 1"])
@pytest.mark.parametrize("command", ["run", "study", "check"])
def test_what_is_of_no_known_kind_is_left_to_its_reader(command, text):
    Path("some.toml").write_text(text)
    result = call(command, "some.toml")
    assert result.exit_code == INPUT_AT_FAULT
    assert "some.toml is" not in result.stderr or "is not valid TOML" in result.stderr


def test_keys_tell_kinds_apart():
    from deli.config.models import RunTable
    from deli.figures.model import FigureTable
    from deli.studies.model import StudyTable

    models = (RunTable, StudyTable, FigureTable)
    fields = [set(model.model_fields) for model in models]
    fields[0] |= {"scene", "method"}
    for place, own in enumerate((files.CONFIG_KEYS, files.STUDY_KEYS, files.FIGURE_KEYS)):
        assert own <= fields[place]
        assert not own & set().union(*(fields[:place] + fields[place + 1 :]))


@pytest.mark.usefixtures("folder")
class TestOutputs:
    def made(self, *arguments):
        result = call(*arguments)
        assert result.exit_code == DONE, result.output

    @pytest.mark.parametrize("name", ["x.txt", "x", "x.png", "x.nc.txt"])
    def test_of_runs_are_netcdf(self, name):
        Path("config.toml").write_text(CONFIG)
        words = (f"output {name}: found the suffix", "allowed: .nc, .nc4, .netcdf")
        refused(call("run", "config.toml", "-o", name), *words)
        refused(call("run", "config.toml", "--set", f"record.output={name}"), *words)
        refused(call("replay", "-o", name), *words)
        assert [path.name for path in Path().iterdir()] == ["config.toml"]

    @pytest.mark.parametrize("name", ["x.nc", "x.NC", "x.nc4", "x.netcdf"])
    def test_of_runs_have_these_suffixes(self, name):
        self.made("run", "point_mass", *SHORT, "-q", "-o", name)

    def test_of_the_benchmark_are_json(self):
        refused(call("bench", "-o", "x.txt"), "x.txt", "'.txt'", "allowed: .json")

    @pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
    def test_a_picture_that_exists_is_kept(self, suffix):
        picture = Path(f"ball{suffix}")
        picture.write_text("mine")
        self.made("run", "point_mass", *SHORT, "-q", "-o", "ball.nc")
        for command in (
            ("plot", "ball.nc", "-o", picture),
            ("run", "point_mass", *SHORT, "-o", "new.nc", "--plot", picture),
            ("replay", "--plot", picture),
        ):
            refused(call(*command), f"picture {picture} exists", "--overwrite")
        assert picture.read_text() == "mine"
        self.made("plot", "ball.nc", "-o", picture, "--overwrite")
        assert picture.stat().st_size > 5000
        self.made("run", "point_mass", *SHORT, "-o", "ball.nc", "--plot", picture, "--resume", "-q")

    def test_the_picture_of_an_unfinished_run_is_named_like_the_run_s(self):
        self.made("run", "point_mass", *SHORT, "-q", "-o", "ball.nc")
        Path("ball.nc").rename("ball.nc.partial")
        self.made("plot", "ball.nc.partial")
        assert Path("ball.png").exists()
