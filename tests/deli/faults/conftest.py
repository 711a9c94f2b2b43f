"""What tests of faults share: a place where processes begin at once, and undisturbed runs."""

import functools

import pytest
from fault_cases import undisturbed
from nest import Nest


@pytest.fixture(scope="package")
def nest(tmp_path_factory):
    found = Nest(tmp_path_factory.mktemp("nest"))
    yield found
    found.close()


@pytest.fixture(scope="package")
def whole():
    """Undisturbed runs, by the number of steps."""
    return functools.cache(undisturbed)
