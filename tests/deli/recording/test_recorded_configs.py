"""The config in a run's attributes: it runs again, or its first line says why not, and `deli run` says so too."""

import contextlib
import dataclasses

import pytest
from running import DONE, H, assert_same, call, refused

import deli
import solvers
from solvers.backends.daqp import DAQP


@dataclasses.dataclass(frozen=True)
class Mine(deli.GVI):
    """A method of the user's own."""


@contextlib.contextmanager
def registered(name):
    solvers.register(name, DAQP)
    try:
        yield
    finally:
        solvers.unregister(name)


def text_of(scene, method, **arguments):
    return deli.simulate(scene, method, step_size=H, steps=3, **arguments).attrs["config"]


def again(folder, text):
    (folder / "again.toml").write_text(text)
    return call("run", "again.toml", "-q")


@pytest.mark.parametrize("solver", ["auto", "daqp", "cvxpy:CLARABEL"])
def test_of_a_registered_scene_it_runs_again(folder, solver):
    scene = deli.scenes.newtons_cradle(balls=2)
    text = text_of(scene, deli.GVI(), solvers=solver)
    assert not text.startswith("#")
    assert again(folder, text).exit_code == DONE
    assert_same(deli.open_run("again.nc"), deli.simulate(scene, deli.GVI(), step_size=H, steps=3, solvers=solver))


def changed():
    return dataclasses.replace(deli.scenes.point_mass(), mass=2.0)


@pytest.mark.parametrize("scene", [lambda: deli.Scene(1.0, [0.0], [1.0]), changed])
def test_of_a_scene_of_ones_own_it_says_why_not(folder, scene):
    why = "does not run again: its scene is the user's own, made in Python, and a config holds no families"
    text = text_of(scene(), deli.GVI())
    assert f"# This config {why}" in text.splitlines()[0]
    refused(again(folder, text), f"scene.name is 'custom', and such a recorded run {why}; run the script that made it.")


def test_of_an_ensemble_it_says_why_not(folder):
    run = deli.simulate_ensemble([deli.scenes.point_mass()] * 2, deli.GVI(), step_size=H, steps=3)
    text = run.attrs["config"]
    assert text.startswith("# This config does not run again: it is of an ensemble of scenes")
    refused(again(folder, text), "scene.name is 'ensemble', and such a recorded run does not run again")


def test_of_a_method_of_ones_own_it_says_why_not(folder):
    text = text_of(deli.scenes.point_mass(), Mine())
    assert text.startswith("# This config does not run again: its method mine is the user's own.\n")
    refused(again(folder, text), "method.name is 'mine'")


def test_of_a_backend_of_ones_own_it_says_where_it_runs(folder):
    with registered("mine"):
        text = text_of(deli.scenes.point_mass(), deli.GVI(), solvers={"position": "mine"})
        assert text.startswith("# This config runs again only where these backends are registered: mine.\n")
        assert again(folder, text).exit_code == DONE
    refused(call("run", "again.toml", "-q", "-o", "other.nc"), "solvers.position.backend is 'mine'")
