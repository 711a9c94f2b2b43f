"""Fixtures of the tests that run something."""

import pytest

from deli.integrators.stepper import Stepper


@pytest.fixture
def at_step(monkeypatch):
    """Make the steppers do something in place of their n-th step (and of every later one)."""
    plain = Stepper.step

    def install(number, action):
        calls = []

        def step(self, q, p):
            calls.append(None)
            return plain(self, q, p) if len(calls) < number else action(lambda: plain(self, q, p))

        monkeypatch.setattr(Stepper, "step", step)

    def restore():
        monkeypatch.setattr(Stepper, "step", plain)

    install.restore = restore
    return install


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty current directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
