"""Fixtures of the tests that run something."""

import pytest

from deli.integrators.stepper import Stepper


@pytest.fixture
def at_step(monkeypatch):
    """Make the steppers do something in place of their n-th step (and of every later one)."""
    plain = Stepper.advance

    def install(number, action):
        calls = []

        def advance(self, block, steps, every, deadline):
            def take():
                return plain(self, block, steps, every, 0.0)  # a deadline long past: one step

            calls.append(None)
            return take() if len(calls) < number else action(take)

        monkeypatch.setattr(Stepper, "advance", advance)

    def restore():
        monkeypatch.setattr(Stepper, "advance", plain)

    install.restore = restore
    return install


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty current directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
