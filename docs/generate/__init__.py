"""Pages made from the code at each build: the reference and the gallery, in `docs/generated`."""

from pathlib import Path
from typing import Any

from generate import api, backends, commands, configs, dataset, gallery, scenes

GENERATED = Path(__file__).parents[1] / "generated"
PAGES = {
    "api": api.page,
    "dataset": dataset.page,
    "config": configs.page,
    "commands": commands.page,
    "scenes": scenes.page,
    "backends": backends.page,
    "gallery": gallery.page,
}


def make(app: Any, config: Any) -> None:
    """Write each page that has changed, with its pictures."""
    GENERATED.mkdir(exist_ok=True)
    gallery.draw(GENERATED)
    for name, page in PAGES.items():
        path, text = GENERATED / f"{name}.md", page()
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


def keep_bars(app: Any, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Escape bars in a docstring, so that |x| is the length of x and no substitution of reStructuredText."""
    lines[:] = ["``".join(_escaped(line.split("``"))) for line in lines]


def _escaped(parts: list[str]) -> list[str]:
    return [part if literal % 2 else part.replace("|", "\\|") for literal, part in enumerate(parts)]


def setup(app: Any) -> dict[str, bool]:
    """Let Sphinx make the pages before it looks for files, so that autosummary finds them in the first build."""
    app.connect("config-inited", make)
    app.connect("autodoc-process-docstring", keep_bars, priority=900)  # after numpydoc
    return {"parallel_read_safe": True, "parallel_write_safe": True}
