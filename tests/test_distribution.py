"""The name under which deli is installed: one, in every line that tells a user how to install it."""

import re
import tomllib
from importlib.metadata import metadata
from pathlib import Path

import pytest

import deli
import solvers
from deli.recording.provenance import CITATION
from solvers.distribution import install_line

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
READ = ("*.md", "*.toml", "deli/**/*.py", "solvers/**/*.py", "docs/**/*.md", "studies/**/*.md", "studies/**/*.ipynb")
TEXTS = sorted({path for pattern in READ for path in ROOT.glob(pattern)})
INSTALL = re.compile(r"""pip install(?:\s+-[-\w]+)*\s+\\?["']?([^\s"'`\\]+)""")
OWN = re.compile(rf"(?:\.|{solvers.DISTRIBUTION})(?:\[([^\]]+)\])?\.?")


def strange_lines(text):
    """Install lines of other projects, or of extras that do not exist, and extras of a project called deli."""
    strange = re.findall(r"\bdeli\[[\w,]+\]", text)
    for found in INSTALL.finditer(text):
        own = OWN.fullmatch(found[1])
        extras = own[1].split(",") if own and own[1] else []
        if not own or not {*extras} <= {*PROJECT["optional-dependencies"], "{extra}", "EXTRA"}:
            strange.append(found[0])
    return strange


def test_install_lines_name_this_project():
    found = {str(path.relative_to(ROOT)): strange_lines(path.read_text()) for path in TEXTS}
    assert not {path: lines for path, lines in found.items() if lines}


@pytest.mark.parametrize(
    "line",
    [
        "pip install 'deli[solvers]'",
        "pip install deli",
        'pip install "solvers"',
        "pip install '.[solver]'",
        "`deli[jax]`",
    ],
)
def test_install_lines_of_strangers_are_found(line):
    assert strange_lines(f"Text before: {line} and after.")


def test_install_lines_are_looked_at():
    found = [INSTALL.findall(path.read_text()) for path in TEXTS]
    assert sum(map(len, found)) >= 10
    assert len(TEXTS) > 200


def test_the_distribution_has_one_name_and_one_version():
    installed = metadata(solvers.DISTRIBUTION)
    assert installed["Name"] == PROJECT["name"] == solvers.DISTRIBUTION
    assert installed["Version"] == deli.__version__


def test_messages_say_how_an_extra_is_installed():
    for info in solvers.backends():
        assert info.install in ("", install_line("solvers"))


def cited(text):
    """The value of each key of CITATION.cff that a line of its own has."""
    return dict(re.findall(r'^\s*(?:- )?([\w-]+): "?([^"\n]+)"?$', text, re.MULTILINE))


def test_the_version_is_written_in_one_place_and_told_elsewhere():
    assert cited((ROOT / "CITATION.cff").read_text())["version"] == deli.__version__
    assert f"\n## {deli.__version__}" in (ROOT / "CHANGELOG.md").read_text()
    assert "version" in PROJECT["dynamic"]


def test_runs_cite_as_the_citation_file_does():
    found = cited((ROOT / "CITATION.cff").read_text())
    for key in ("name", "version", "journal", "volume", "year", "doi"):
        assert found[key] in CITATION


def test_the_packages_have_no_links():
    assert not [path for package in ("deli", "solvers") for path in (ROOT / package).rglob("*") if path.is_symlink()]
