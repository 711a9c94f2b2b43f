"""What a study says while it runs: how long is left follows from steps that were taken warm."""

import re
from types import SimpleNamespace

import pytest
from study_cases import study

from deli.studies import display
from deli.studies.display import Board
from deli.studies.running import plan_study

STEPS = 1000


@pytest.fixture
def clock(monkeypatch):
    clock = SimpleNamespace(now=50.0)
    monkeypatch.setattr(display, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.fixture
def decisions(tmp_path):
    """Four runs of a thousand steps."""
    base = {"scene": "point_mass", "step_size": 0.01, "steps": STEPS}
    return plan_study(study(tmp_path, base=base, axes={"scene.mass": [1.0, 2.0, 3.0, 4.0]}), tmp_path / "out")


def left(capsys):
    """The estimate of the remaining time in the last line."""
    return capsys.readouterr().out.splitlines()[-1].partition("; ")[2]


def end(board, decision, state="done"):
    board.ended(decision, {"state": state, "seconds": 2.0, "reason": ""})


@pytest.mark.parametrize("compiling", [0.0, 90.0])
def test_compiling_counts_in_no_estimate(decisions, clock, capsys, compiling):
    board = Board(decisions)
    board.started(decisions[0])
    clock.now += compiling
    board.step(decisions[0], 0)
    clock.now += 2.0
    end(board, decisions[0])
    assert left(capsys) == "about 6 s left"


def test_runs_at_once_share_what_is_left(decisions, clock, capsys):
    board = Board(decisions)
    for decision in decisions[:2]:
        board.started(decision)
    clock.now += 90.0
    board.step(decisions[0], 0)
    clock.now += 2.0
    end(board, decisions[0])
    assert left(capsys) == "about 3 s left"
    for decision in decisions[1:3]:
        board.started(decision)
        board.step(decision, 0)
    clock.now += 2.0
    for decision in decisions[1:3]:
        end(board, decision)
    assert left(capsys) == "about 2 s left"  # one run is left, and none beside it


def test_steps_of_earlier_sessions_took_no_time_now(decisions, clock, capsys):
    board = Board(decisions)
    board.started(decisions[0])
    clock.now += 90.0
    board.step(decisions[0], 900)
    clock.now += 2.0
    end(board, decisions[0])
    assert left(capsys) == "about 60 s left"


def test_nothing_is_known_before_a_run_is_warm(decisions, clock, capsys):
    board = Board(decisions)
    board.started(decisions[0])
    clock.now += 90.0
    end(board, decisions[0], "failed")
    assert left(capsys) == "compiling and loading"


def test_a_terminal_says_which_runs_compile(decisions, clock, monkeypatch, tmp_path):
    with (tmp_path / "terminal").open("w+") as stream:
        monkeypatch.setenv("TTY_COMPATIBLE", "1")
        monkeypatch.setenv("COLUMNS", "120")
        monkeypatch.setattr(display, "sys", SimpleNamespace(stderr=stream))
        with Board(decisions) as board:
            for decision in decisions[:2]:
                board.started(decision)
            clock.now += 90.0
            board.tick()
            board.step(decisions[0], 0)
            clock.now += 1.0
            board.step(decisions[0], 500)
            board.tick()
        stream.seek(0)
        shown = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", stream.read())
    first, second = shown.split("running")[1:3]
    assert first.count("compiling, loading") == 2
    assert "compiling and loading" in first
    assert second.count("compiling, loading") == 1
    assert "50 %" in second
    assert "about 3.5 s left" in second
