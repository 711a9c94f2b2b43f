import importlib.util

import pytest

from solvers import registry

BACKENDS = tuple(registry.BUILTIN)


@pytest.fixture(params=BACKENDS)
def backend(request):
    package = registry.BUILTIN[request.param][1]
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"backend {request.param} is not installed")
    return request.param


@pytest.fixture(params=["dense", "sparse"])
def storage(request, monkeypatch):
    if request.param == "sparse":
        monkeypatch.setattr("solvers.affine.DENSE_LIMIT", 0)
    return request.param


@pytest.fixture
def registered():
    """Register backends for one test."""
    names = []

    def add(name, factory):
        registry.register(name, factory)
        names.append(name)

    yield add
    for name in names:
        registry.unregister(name)
