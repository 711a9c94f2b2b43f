"""Names that lead elsewhere: nothing is written but where the command line says, whatever a file or a link wants."""

import os
import tomllib
from pathlib import Path

import pytest
from hostile_judging import DONE, REFUSED, judge

import deli

STUDY = """
title = {title}
[base]
scene = "point_mass"
steps = 3
record.output = {title}
[axes]
step_size = [{{ label = {title}, value = 0.01 }}, 0.02]
[[plots]]
kind = "energy_traces"
title = {title}
by = "step_size"
"""


def files(folder):
    """Everything in a folder, by its path from there, without the contents of links."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def quoted(text):
    return '"' + text.encode("unicode_escape").decode().replace("\\x", "\\u00") + '"'


@pytest.fixture
def place(tmp_path):
    """A folder to work in, two levels below one that must stay as it is."""
    inner = tmp_path / "above" / "here"
    inner.mkdir(parents=True)
    yield inner
    assert files(tmp_path) - {f"above/here/{name}" for name in files(inner)} == {"above", "above/here"}


def study(title):
    """A study that is called, and records, and labels a case, alike."""
    return STUDY.format(title=quoted(title))


@pytest.mark.parametrize("name", ["..toml", "...toml"])
def test_a_study_called_like_a_folder_above(victim, place, name):
    (place / name).write_text(study("x"))
    outcome = judge(victim.run(place, "study", name, "-q"), "folder")
    assert outcome.status == REFUSED
    assert files(place) == {name}


def test_an_output_that_a_study_s_base_names_is_left_alone(victim, place):
    (place / "kept.nc").write_text("precious")
    (place / "study.toml").write_text(study("kept.nc"))
    assert judge(victim.run(place, "study", "study.toml", "--dry-run")).status == DONE
    assert (place / "kept.nc").read_text() == "precious"


def run(victim, place, output, *more):
    return judge(
        victim.run(place, "run", "point_mass", "--set", "steps=3", "-q", "-o", output, *more), "output", "run.nc"
    )


class TestLinks:
    def test_the_output_is_a_link(self, victim, place):
        (place / "there").mkdir()
        (place / "there" / "kept.nc").write_text("precious")
        (place / "run.nc").symlink_to("there/kept.nc")
        assert run(victim, place, "run.nc").status == REFUSED
        assert run(victim, place, "run.nc", "--overwrite").status == DONE
        assert (place / "there" / "kept.nc").read_text() == "precious"
        assert not (place / "run.nc").is_symlink()
        assert deli.open_run(place / "run.nc").attrs["outcome"] == "complete"

    @pytest.mark.parametrize("more", [(), ("--overwrite",), ("--resume",)])
    @pytest.mark.parametrize("suffix", [".partial", ".partial.new"])
    def test_a_part_of_the_output_is_a_link_to_nowhere(self, victim, place, suffix, more):
        (place / f"run.nc{suffix}").symlink_to("elsewhere.nc")
        status = run(victim, place, "run.nc", *more).status
        assert status == (REFUSED if suffix == ".partial" else DONE)
        assert not (place / "elsewhere.nc").exists()

    def test_the_folder_is_a_link(self, victim, place):
        (place / "scratch").mkdir()
        (place / "folder").symlink_to("scratch")
        assert run(victim, place, "folder/run.nc").status == DONE
        assert files(place / "scratch") == {"run.nc"}

    @pytest.mark.parametrize("output", ["loop/run.nc", "loop", "self.nc", "gone/run.nc", "run.nc/run.nc"])
    def test_links_that_lead_nowhere(self, victim, place, output):
        (place / "loop").symlink_to("pool")
        (place / "pool").symlink_to("loop")
        (place / "self.nc").symlink_to("self.nc")
        (place / "gone").symlink_to("nowhere")
        before = files(place)
        assert run(victim, place, output, "--overwrite").status == REFUSED
        assert files(place) == before
        (place / "study.toml").write_text(study("x"))
        assert judge(victim.run(place, "study", "study.toml", "-o", "loop", "-q"), "folder").status == REFUSED
        assert judge(victim.run(place, "figures", "1.3a", "-o", "loop", "-q"), "folder").status == REFUSED
        assert judge(victim.run(place, "run", "point_mass", "--plot", "loop/a.png"), "picture").status == REFUSED


@pytest.mark.parametrize(
    "output",
    ["x" * 300 + ".nc", "x" * 245 + ".nc", "y/" * 3000 + "a.nc", "a\udcff.nc", ".", "..", "/", "/proc/a.nc"],
)
def test_names_that_no_file_has(victim, place, output):
    assert run(victim, place, output).status == REFUSED
    assert not files(place)


@pytest.mark.parametrize("name", ["a\nb.nc", "a\x1b[31m.nc", "\u05e9\u05dc.nc", "a b.nc", "-.nc", "%s.nc", "[red]x.nc"])
def test_names_that_are_odd(victim, place, name):
    outcome = victim.run(place, "run", "point_mass", "--set", "steps=3", f"--output={name}")
    assert judge(outcome).status == DONE
    assert files(place) == {name}
    assert f"Recorded in {name}\n" in outcome.output
    assert deli.open_run(place / name).attrs["outcome"] == "complete"


@pytest.mark.parametrize("kind", ["fifo", "device", "folder", "link", "large", "secret"])
def test_configs_that_are_no_plain_files(victim, place, kind):
    config, study = place / "config.toml", place / "study.toml"
    if kind == "fifo":
        os.mkfifo(config)
    elif kind == "device":
        config.symlink_to("/dev/zero")
    elif kind == "folder":
        config.mkdir()
    elif kind == "link":
        config.symlink_to("config.toml")
    elif kind == "large":
        with config.open("wb") as file:
            file.truncate(10**12)  # without taking any space
    elif kind == "secret":
        config.write_text("root:x:0:0:root\n")
    study.write_text('base = "config.toml"\naxes.step_size = [0.1]\n')
    for command in (("run", config.name), ("check", config.name), ("study", study.name), ("study", config.name)):
        assert judge(victim.run(place, *command), "config.toml").status == REFUSED


def test_a_study_says_nothing_of_other_files_contents(victim, place):
    """A base that is no config is refused without a word of what is in it."""
    (place / "study.toml").write_text('base = "/etc/passwd"\naxes.step_size = [0.1]\n')
    outcome = judge(victim.run(place, "study", "study.toml", "--dry-run"))
    assert outcome.status == REFUSED
    assert not any(line and line in outcome.errors for line in Path("/etc/passwd").read_text().splitlines())


def test_recorded_configs_hold_odd_words_whole(victim, place):
    (place / "config.toml").write_text(
        'scene = "point_mass"\nsteps = 2\n[record]\noutput = "\\u05e9 $x$ {0}.nc"\n', "utf-8"
    )
    assert judge(victim.run(place, "run", "config.toml", "-q")).status == DONE
    (found,) = place.glob("*.nc")
    assert found.name == "\u05e9 $x$ {0}.nc"
    assert tomllib.loads(deli.open_run(found).attrs["config"])["scene"]["name"] == "point_mass"
