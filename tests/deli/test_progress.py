"""Bars: on a terminal and in a notebook, with a rate that knows nothing of compiling."""

import io
import os
import re
from types import SimpleNamespace

import nbformat
import pytest
from nbclient import NotebookClient

from deli.running import progress
from deli.running.progress import ProgressBar

WIDGETS = {
    "without ipywidgets": "sys.modules['ipywidgets'] = None",
    "with ipywidgets": "sys.modules['ipywidgets'] = types.ModuleType('ipywidgets')",
}
CELLS = {
    "a run": "run = deli.simulate(ball, deli.GVI(), step_size=0.01, steps=20_000, progress=True)",
    "an ensemble": "many = deli.simulate_ensemble([ball] * 3, deli.GVI(), step_size=0.01, steps=20_000, progress=True)",
    "a replay": "again = deli.replay(backends=['native'], repeat=1, progress=True)",
    "a film": "film = deli.plotting.save_animation(run.isel(time=slice(0, 20)), 'film.gif', progress=True)",
}


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    def __init__(self):
        self.now = 1000.0

    def perf_counter(self):
        return self.now


@pytest.fixture
def terminal(monkeypatch):
    stream = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(progress, "sys", SimpleNamespace(stderr=stream))
    return stream


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(progress, "time", clock)
    return clock


def shown(terminal):
    return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", terminal.getvalue())


def rates(terminal):
    """The rates that were shown, in their order."""
    return list(dict.fromkeys(re.findall(r"starting|[\d,]+ steps/s", shown(terminal))))


def test_the_rate_is_that_of_the_steps_after_the_first_report(terminal, clock):
    with ProgressBar("run", 1000, 0, True) as bar:
        for seconds, step in ((20.0, 10), (1.0, 110), (1.0, 210), (8.0, 1000)):
            clock.now += seconds
            bar.update(step, 1e-3)
    assert rates(terminal) == ["starting", "100 steps/s", "99 steps/s"]
    assert "100%" in shown(terminal)
    assert "energy error +1.0e-03" in shown(terminal)


def test_a_run_that_goes_on_counts_its_own_steps_only(terminal, clock):
    with ProgressBar("run", 1000, 500, True) as bar:
        for seconds, step in ((5.0, 500), (15.0, 510), (1.0, 610)):
            clock.now += seconds
            bar.update(step)
    assert rates(terminal) == ["starting", "100 steps/s"]


def test_a_run_that_is_done_at_the_first_report_has_a_rate_too(terminal, clock):
    with ProgressBar("run", 100, 0, True) as bar:
        clock.now += 0.5
        bar.update(100)
    assert rates(terminal) == ["starting", "200 steps/s"]


def test_nothing_is_shown_elsewhere(capsys):
    with ProgressBar("run", 100, 0, True) as bar:
        assert not bar.active
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("widgets", WIDGETS)
def test_a_notebook_shows_bars(widgets, tmp_path):
    head = f"import sys, types, logging\n{WIDGETS[widgets]}\nimport deli\n"
    head += "logging.getLogger('deli').setLevel(logging.ERROR)\nball = deli.scenes.point_mass()"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code) for code in (head, *CELLS.values())])
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute(env=dict(os.environ))
    assert notebook.cells[0].outputs == []
    for cell, what in zip(notebook.cells[1:], CELLS, strict=True):
        assert len(cell.outputs) == 1, (what, cell.outputs)  # one bar, updated in its place
        (output,) = cell.outputs
        assert output.output_type == "display_data", what
        for kind in ("text/plain", "text/html"):
            assert "━" in output.data[kind], what
            assert "100%" in output.data[kind], what
            assert re.search(r"\d (steps|problems|frames)/s", output.data[kind]), what
