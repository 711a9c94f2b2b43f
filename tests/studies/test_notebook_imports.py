"""Notebooks use what is public: names that ``deli`` or one of its packages lists in ``__all__``."""

import ast
from importlib import import_module
from pathlib import Path
from types import ModuleType

import nbformat
import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "studies").glob("*.ipynb"))
OURS = ("deli", "solvers")


def code_of(path):
    cells = [cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
    return "\n".join(line for cell in cells for line in cell.splitlines() if not line.startswith(("%", "!")))


def listed(module, name):
    """Whether a module's list of public names has a name, or it is one of deli's packages itself."""
    return name in getattr(module, "__all__", ()) or (
        module.__name__ == "deli" and hasattr(find(f"deli.{name}"), "__all__")
    )


def find(name):
    try:
        return import_module(name)
    except ModuleNotFoundError:
        return None


def private_names(tree):
    """Names of ours that are imported or reached into and that nothing lists."""
    modules = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.partition(".")[0] in OURS:
                    modules[alias.asname or alias.name] = import_module(alias.name)
                    if "." in alias.name:
                        yield alias.name
        elif isinstance(node, ast.ImportFrom) and node.module.partition(".")[0] in OURS:
            module = import_module(node.module)
            for alias in node.names:
                if not listed(module, alias.name):
                    yield f"{node.module}.{alias.name}"
                elif isinstance(value := getattr(module, alias.name, None), ModuleType):
                    modules[alias.asname or alias.name] = value
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        chain, root = [node.attr], node.value
        while isinstance(root, ast.Attribute):
            chain, root = [root.attr, *chain], root.value
        if isinstance(root, ast.Name) and root.id in modules:
            module = modules[root.id]
            for name in chain:
                if not listed(module, name):
                    yield f"{module.__name__}.{name}"
                    break
                module = getattr(module, name, None)
                if not isinstance(module, ModuleType):
                    break


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_uses_public_names(path):
    assert not sorted(set(private_names(ast.parse(code_of(path)))))


@pytest.mark.parametrize(
    ("code", "private"),
    [
        ("from deli.plotting.lines import color", "deli.plotting.lines.color"),
        ("import deli.plotting.lines", "deli.plotting.lines"),
        ("import deli\ndeli.plotting.lines.color(0)", "deli.plotting.lines"),
        ("from deli import figures\nfigures.drawing.color(0)", "deli.figures.drawing"),
        ("from deli.metrics import drift\nimport deli\ndeli.plotting.color(1)", None),
    ],
)
def test_a_private_name_is_found(code, private):
    assert set(private_names(ast.parse(code))) == ({private} if private else set())


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_has_a_title(path):
    cells = [cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "markdown"]
    headings = [line for source in cells for line in source.splitlines() if line.startswith("#")]
    assert headings[0].startswith("# ")
    assert not [heading for heading in headings if heading.lstrip("# ").strip() == "" or "# #" in heading]
