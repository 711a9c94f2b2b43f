"""The documents tell readers what they can type: each block of Python, shell or TOML does what its page says."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    path
    for pattern in ("README.md", "CONTRIBUTING.md", "docs/**/*.md", "studies/**/*.md")
    for path in ROOT.glob(pattern)
    if "generated" not in path.parts
)
RUN, SHOWN = {"python", "sh", "toml"}, {"", "console", "text"}
"""Languages of blocks that are run, and of those that a reader only looks at."""
OF_THE_GATE = "python3 -m venv"
"""Commands that begin so set up an environment; .ci/run runs them as they are written."""


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return language and text of a page's blocks, without directives of Sphinx."""
    fences = [token for token in MarkdownIt().parse(page.read_text()) if token.type == "fence"]
    return [(token.info.split(" ")[0], token.content) for token in fences if not token.info.startswith("{")]


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


WITH_BLOCKS = [page for page in PAGES if any(language in RUN for language, _ in blocks(page))]


def test_blocks_have_a_language_that_says_whether_they_run():
    found = {(name(page), language) for page in PAGES for language, _ in blocks(page)}
    assert not {entry for entry in found if entry[1] not in RUN | SHOWN}
    assert len(WITH_BLOCKS) >= 5


@pytest.mark.parametrize("page", WITH_BLOCKS, ids=name)
def test_the_blocks_of_a_page_run_in_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    for shared in ("studies", "docs"):
        (tmp_path / shared).symlink_to(ROOT / shared)
    names = {"__name__": "documented"}
    for language, text in blocks(page):
        if language == "python":
            exec(compile(text, name(page), "exec"), names)
        elif language == "toml":
            tomllib.loads(text)
        elif language == "sh" and not text.startswith(OF_THE_GATE):
            subprocess.run(["bash", "-euo", "pipefail", "-c", text], check=True, timeout=300, stdin=subprocess.DEVNULL)
    plt.close("all")
