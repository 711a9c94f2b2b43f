"""Perturbed initial states: one seed, one state, and a config that makes it again."""

import numpy as np
import pytest
from running import call, refused

import deli
from deli.config import parse
from deli.mechanics.tables import table_rates
from deli.recording.provenance import scene_of

ALL = deli.scenes.available()
NOISE = {"seed": 7, "momentum": 1e-3}


@pytest.mark.parametrize("name", ALL)
def test_a_perturbed_scene_is_made_again_by_its_own_config(name):
    build = deli.scenes.get(name)
    plain, scene, again = build(), build(perturbation=NOISE), build(perturbation=NOISE)
    np.testing.assert_array_equal(scene.momentum, again.momentum)
    assert not np.array_equal(scene.momentum, plain.momentum)
    assert np.abs(scene.momentum - plain.momentum).max() < 0.01
    config = parse({"scene": {"name": name, "perturbation": NOISE}}).plan().config()
    np.testing.assert_array_equal(parse(config).plan().scene.momentum, scene.momentum)
    assert config["scene"]["name"] == name


def test_noise_is_numpys_of_the_seed_whatever_the_scales():
    noise = np.random.default_rng(3).standard_normal((2, 2))
    plain = deli.scenes.pogo_stick()
    for position in (0.0, 0.25):
        scene = deli.scenes.pogo_stick(perturbation={"seed": 3, "position": position, "momentum": 2.0})
        np.testing.assert_array_equal(scene.position, plain.position + position * noise[0])
        np.testing.assert_array_equal(scene.momentum, plain.momentum + 2.0 * noise[1])


def test_bilateral_constraints_hold_after_a_perturbation():
    scene = deli.scenes.chain_on_cylinder(perturbation={"seed": 1, "momentum": 5.0})
    rates = table_rates(scene.bilateral.table, scene.position, scene.momentum / scene.mass)
    assert np.abs(rates).max() < 1e-12 * np.abs(scene.momentum).max()


def test_a_recorded_run_knows_its_perturbation():
    scene = deli.scenes.point_mass(perturbation={"seed": 5, "position": 0.1})
    run = deli.simulate(scene, deli.GVI(), step_size=0.01, steps=5)
    assert scene_of(run).position == scene.position


def test_what_is_refused(folder):
    refused(call("run", "point_mass", "--set", "scene.perturbation.sed=1"), "scene.perturbation.sed", "'seed'")
    refused(call("run", "point_mass", "--set", "scene.perturbation.position=-1.0"), "scene.perturbation.position")
    touching = ("run", "newtons_cradle", "--set", "scene.perturbation.position=0.01")
    refused(call(*touching), "perturbation (seed 0)", "unilateral constraint")
    with pytest.raises(deli.InputError, match=r"perturbation: found \{'sed': 1\}"):
        deli.scenes.point_mass(perturbation={"sed": 1})
