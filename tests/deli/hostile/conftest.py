"""Fixtures of the tests with hostile input."""

import sys

import pytest
from hostile_process import Victim


@pytest.fixture(scope="session")
def victim(tmp_path_factory):
    """A process that carries out command lines, with a limit on its memory."""
    if not sys.platform.startswith("linux"):
        pytest.skip("limits of memory and its peak are read as Linux has them")
    found = Victim(tmp_path_factory.mktemp("victim"))
    yield found
    found.close()
