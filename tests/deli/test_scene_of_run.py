"""Whatever takes a run and its scene refuses the scene of another run."""

import dataclasses
import inspect
from types import FunctionType

import pytest

import deli
from deli import metrics, plotting
from deli.errors import InputError

MODULES = (deli, metrics, plotting)
PUBLIC = [getattr(module, name) for module in MODULES for name in module.__all__]
TAKERS = [
    one
    for one in PUBLIC
    if isinstance(one, FunctionType) and {"run", "scene"} <= inspect.signature(one).parameters.keys()
]


def floor(height=0.0, **changes):
    settings = {"mass": 1.0, "position": [[0.0, 1.0]], "momentum": [[1.0, -2.0]], "dimension": 2, "name": "box"}
    walls = [deli.Planes(normals=[0.0, 1.0], offsets=height)]
    return deli.Scene(**settings | changes, unilateral=walls)


@pytest.fixture(scope="module")
def run():
    return deli.simulate(floor(), deli.GVI(), step_size=0.01, steps=40)


def call(function, run, scene, folder):
    arguments = inspect.signature(function).parameters
    path = folder / ("run.gif" if "fps" in arguments else "run.png")
    found = function(run, scene=scene, **({"path": path} if "path" in arguments else {}))
    if function is plotting.animate:
        found.to_jshtml()  # matplotlib warns of one that is not looked at


def test_these_take_a_run_and_its_scene():
    assert {function.__name__ for function in TAKERS} >= {
        "animate",
        "save",
        "save_animation",
        "shadow_energy",
        "trajectory",
    }


@pytest.mark.parametrize("function", TAKERS, ids=lambda function: function.__name__)
class TestTakers:
    @pytest.mark.parametrize(
        ("other", "where"),
        [
            (floor(height=-0.5), r"offsets of Planes \(unilateral 0\) is 0.0 there and -0.5 now"),
            (floor(mass=2.0), "mass is"),
            (floor(position=[[0.0, 1.5]]), "position is"),
        ],
    )
    def test_another_scene_of_the_same_size_is_refused(self, run, tmp_path, function, other, where):
        from deli.mechanics.content import scene_digest

        both = rf"found 'box' \(digest {scene_digest(other)[:12]}\); the run is of 'box' \(digest "
        both += run.attrs["scene_digest"][:12]
        with pytest.raises(InputError, match=rf"scene: {both}.*{where}.*Pass the scene that was run"):
            call(function, run, other, tmp_path)
        assert not list(tmp_path.iterdir())

    def test_one_of_another_size_is_refused(self, run, tmp_path, function):
        with pytest.raises(InputError, match=r"found 'point_mass' \(1 body in 1 dimension\); the run is of 'box'"):
            call(function, run, deli.scenes.point_mass(), tmp_path)

    def test_the_run_s_own_is_taken(self, run, tmp_path, function):
        call(function, run, floor(), tmp_path)
        (tmp_path / "again").mkdir()
        call(function, run, dataclasses.replace(floor(), name="renamed"), tmp_path / "again")


def test_a_run_without_a_digest_is_known_by_its_size(run):
    bare = run.copy()
    bare.attrs = {key: value for key, value in run.attrs.items() if key != "scene_digest"}
    plotting.trajectory(bare, floor(height=-0.5))
    with pytest.raises(InputError, match="1 body in 1 dimension"):
        plotting.trajectory(bare, deli.scenes.point_mass())
