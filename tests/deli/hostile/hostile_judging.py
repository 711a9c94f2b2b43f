"""What may become of hostile input: a refusal in one line that names the key, or a run."""

import re

import pytest
from hostile_process import Outcome
from hypothesis import HealthCheck, Phase, given, settings

MOST_GROWTH = 400_000_000
LONGEST = 4100
DONE, FAILED, REFUSED = 0, 1, 2
KEYS = (
    "step_size", "steps", "duration", "skip", "contact_tolerance", "solvers", "record", "scene", "method", "name",
    "every", "backend", "tolerance", "polish", "options", "warm_start", "output", "subproblems", "perturbation", "axes",
    "zip",
    "cases", "exclude", "reference", "limits", "workers", "plots", "title", "base", "values", "labels", "label",
    "count", "panels", "view", "runs", "config", "quick", "claim", "notes", "dimension", "--set",
)  # fmt: skip
PLACE = re.compile(r"at line \d+|at end of document|nested more than|is a key with the control character")


def judge(outcome: Outcome, *keys: str) -> Outcome:
    """Assert that a command did its work, or refused in one line that names one of some keys or a place in the file."""
    assert not outcome.fault, outcome.fault
    assert outcome.grown < MOST_GROWTH
    assert outcome.status in (DONE, FAILED, REFUSED)
    if outcome.status == DONE:
        assert outcome.errors == ""
        return outcome
    line, end, rest = outcome.errors.partition("\n")
    assert (end, rest) == ("\n", ""), outcome.errors
    assert line.startswith("deli: ")
    assert line.isprintable()
    assert len(line) < LONGEST
    if outcome.status == FAILED:
        assert "failed in step" in line, line
    else:
        assert PLACE.search(line) or any(key in line for key in (*KEYS, *keys)), line
    return outcome


def words(content):
    """Words of a file that a refusal may name."""
    text = content if isinstance(content, str) else content.decode(errors="replace")
    return re.findall(r"[A-Za-z_]\w{2,}", text)[:200]


def sizes(few, many):
    """How many cases are tried: few by default, many in the long form."""
    return pytest.mark.parametrize("examples", [few, pytest.param(many, marks=pytest.mark.long)])


def try_all(strategy, examples, check):
    """Check so many cases of a strategy, the same ones each time; a case that fails is made smaller first."""
    phases = (Phase.explicit, Phase.generate, Phase.shrink)

    @settings(
        max_examples=examples, derandomize=True, deadline=None, database=None, phases=phases,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(strategy)
    def one(case):
        check(case)

    one()
