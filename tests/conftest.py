"""The parts of the suite: tests of the gate are those that start many processes, or draw and run whole studies."""

from pathlib import PurePath

import pytest

GATE = (
    "studies/test_notebooks.py::test_a_notebook_runs",
    "studies/test_choice_and_reflection.py",
    "studies/test_long_runs.py",
    "studies/test_work_and_stability.py",
    "deli/faults/test_kills.py",
    "deli/faults/test_lying_backends.py",
    "deli/faults/test_outer_faults.py",
    "deli/faults/test_stalling_backends.py",
    "deli/faults/test_write_order.py",
    "deli/hostile/test_damaged_files.py",
    "deli/hostile/test_damaged_studies.py",
    "deli/hostile/test_hostile_code.py",
    "deli/hostile/test_hostile_configs.py",
    "deli/hostile/test_hostile_names.py",
    "deli/hostile/test_hostile_studies.py",
    "deli/studies/test_study_cluster.py",
    "deli/studies/test_study_survival.py",
    "deli/test_animation.py",
    "deli/test_bench.py",
    "deli/test_compiled_code.py",
    "deli/test_progress.py",
    "solvers/test_kept_code.py",
    "docs/test_documents.py",
)
"""Beginnings of the names of tests that take minutes together; the default selection has short relatives of each."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests of the gate; notebooks begin first, because they are the long tail of a run on several cores."""
    for item in items:
        if PurePath(item.nodeid).as_posix().removeprefix("tests/").startswith(GATE):
            item.add_marker(pytest.mark.gate)
    items.sort(key=lambda item: "test_notebooks" not in item.nodeid)
