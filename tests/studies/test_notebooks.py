"""The notebooks in ``studies/`` run from a fresh copy, in quick form, and show what they promise."""

import shutil
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

STUDIES = Path(__file__).parents[2] / "studies"
NOTEBOOKS = sorted(path.stem for path in STUDIES.glob("*.ipynb"))
PICTURES = {
    "first_run": 3,
    "impacts": 4,
    "methods": 6,
    "paper_story": 21,
    "reflection": 2,
    "solver_choice": 4,
    "stability": 3,
    "work_precision": 4,
}
STORED = 600_000  # bytes
LONGEST = 600  # seconds for a cell that hangs
ANNOUNCED = "compiling deli for this machine"  # where kernels are not compiled yet


@pytest.fixture
def copy(tmp_path):
    """A copy of the folder, where notebooks may write."""
    return shutil.copytree(STUDIES, tmp_path / "studies", ignore=shutil.ignore_patterns("_output"))


def parameters(notebook):
    """The cells that say what is run, to be overridden (as papermill does)."""
    return [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]


def outputs(notebook, key):
    """All outputs that have a representation of a kind, such as ``image/png``."""
    return [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if key in output.get("data", {}) or output.get("name") == key
    ]


def test_every_notebook_has_its_expectation():
    assert set(PICTURES) == set(NOTEBOOKS)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs(name, copy):
    notebook = nbformat.read(copy / f"{name}.ipynb", as_version=4)
    for cell in notebook.cells:
        cell.update({"outputs": [], "execution_count": None} if cell.cell_type == "code" else {})
    for cell in parameters(notebook):
        assert cell.source.startswith("QUICK = False")
        cell.source = "QUICK = True"
    client = NotebookClient(notebook, timeout=LONGEST, resources={"metadata": {"path": str(copy)}})
    client.execute()  # raises where a cell does
    assert len(outputs(notebook, "image/png")) == PICTURES[name]
    complaints = [output.text for output in outputs(notebook, "stderr") if not output.text.startswith(ANNOUNCED)]
    assert not complaints
    if name == "paper_story":
        figures = {path.stem for path in (STUDIES / "paper").glob("*.toml")}
        for suffix in (".nc", ".png"):
            assert {path.stem for path in (copy / "_output/figures").glob(f"*{suffix}")} == figures


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_what_is_stored_of_a_notebook(name):
    """Outputs are stored, small, of a run from top to bottom, and with no trace of a warning."""
    path = STUDIES / f"{name}.ipynb"
    assert path.stat().st_size < STORED
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))
    assert len(outputs(notebook, "image/png")) == PICTURES[name]
    assert not outputs(notebook, "stderr")
