"""Invariances of plain functions are those of the same families; what measuring cannot decide is called unknown."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanics_cases import CONSTRAINTS, DIMENSIONS, POTENTIALS, layout, spread

import deli
from deli.mechanics.functions import Constraints, Potential

KINDS = ("potential", "unilateral", "bilateral")


def pairs(scale, stretch):
    """Springs between all bodies whose force grows with the extension: every rigid motion leaves them unchanged."""

    def forces(q, dimension):
        x = q.reshape(-1, dimension)
        apart = x[:, None] - x[None]
        return apart, np.sqrt((apart**2).sum(axis=2) + stretch**2)

    def energy(q, dimension):
        return 0.25 * scale * (forces(q, dimension)[1] ** 3).sum()

    def gradient(q, dimension):
        apart, length = forces(q, dimension)
        return 1.5 * scale * (length[..., None] * apart).sum(axis=1).reshape(-1)

    return energy, gradient


def scene_of(kind, value, slope, q, dimension):
    """A scene whose only function is in one of the three places, and is zero or positive at q."""
    start = value(q)
    if kind == "potential":
        parts = {"potential": Potential(value, slope)}
    else:
        rows = lambda q: np.array([value(q) - start])  # noqa: E731
        parts = {kind: Constraints(rows, lambda q: slope(q)[np.newaxis])}
    return deli.Scene(mass=1.0, position=q, momentum=np.zeros(q.size), dimension=dimension, **parts)


@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("name", POTENTIALS)
def test_functions_of_a_potential_have_the_invariances_of_the_family(name, dimension):
    q = spread(dimension) + np.random.default_rng(5).uniform(-0.1, 0.1, spread(dimension).size)
    family = POTENTIALS[name](dimension).bind(layout(dimension))
    plain = Potential(family.energy, family.gradient)
    scene = deli.Scene(layout(dimension).mass, q, np.zeros(q.size), potential=plain, dimension=dimension)
    assert scene.potential.invariance() == family.invariance()


@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("name", CONSTRAINTS)
def test_functions_of_constraints_have_the_invariances_of_the_family(name, dimension):
    family = CONSTRAINTS[name](dimension).bind(layout(dimension))
    assert Constraints(family.value, family.jacobian).bind(layout(dimension)).invariance() == family.invariance()


@settings(max_examples=30, deadline=None)
@given(data=st.data(), kind=st.sampled_from(KINDS), dimension=st.sampled_from(DIMENSIONS))
def test_what_depends_on_distances_alone_keeps_all_momenta(data, kind, dimension):
    """At any size and place; a constant force along an axis takes away that axis, and what turns into it."""
    size = 10.0 ** data.draw(st.integers(-6, 6), label="size")
    offset = data.draw(st.sampled_from([0.0, 1.0, 1e3]), label="offset")
    energy, gradient = pairs(10.0 ** data.draw(st.integers(-6, 6), label="scale"), 0.1 * size)
    random = np.random.default_rng(data.draw(st.integers(0, 99), label="seed"))
    q = size * (offset + random.uniform(-1.0, 1.0, 3 * dimension))
    scene = scene_of(kind, lambda q: energy(q, dimension), lambda q: gradient(q, dimension), q, dimension)
    assert scene.symmetry.linear == (True,) * dimension
    assert scene.symmetry.angular == (True,) * (0, 1, 3)[dimension - 1]

    axis, pull = data.draw(st.integers(0, dimension - 1), label="axis"), np.zeros((3, dimension))
    pull[:, axis] = 1e-3 * np.abs(gradient(q, dimension)).max()

    def pulled(q):
        return energy(q, dimension) + pull.reshape(-1) @ q

    scene = scene_of(kind, pulled, lambda q: gradient(q, dimension) + pull.reshape(-1), q, dimension)
    assert scene.symmetry.linear == tuple(other != axis for other in range(dimension))
    assert scene.symmetry.angular == {1: (), 2: (False,), 3: tuple(other == axis for other in range(3))}[dimension]


def springs(q):
    return 0.5 * (q[1] - q[0] - 1.0) ** 2


def slope(q):
    return (q[1] - q[0] - 1.0) * np.array([-1.0, 1.0])


def walled(q):
    return springs(q) + max(0.0, -3.0 - q[0]) ** 2


def slope_of_walled(q):
    return slope(q) + np.array([-2.0 * max(0.0, -3.0 - q[0]), 0.0])


def tilted(q):
    return springs(q) + 1e-9 * q[0]


def slope_of_tilted(q):
    return slope(q) + np.array([1e-9, 0.0])


def wave(q):
    return 1.0 - np.cos(2.0 * np.pi * q[0])


def slope_of_wave(q):
    return np.array([2.0 * np.pi * np.sin(2.0 * np.pi * q[0]), 0.0])


def failing(q):
    if abs(q[0]) > 0.01:
        raise ValueError("outside of the table")
    return springs(q)


@pytest.mark.parametrize(
    ("energy", "gradient", "linear"),
    [
        (springs, slope, True),
        (walled, slope_of_walled, False),
        (tilted, slope_of_tilted, None),
        (lambda q: 0.0, lambda q: 0.0 * q, None),
        (failing, slope, True),
        (lambda q: springs(q) if abs(q[0]) < 1e-5 else np.nan, slope, None),
        (wave, slope_of_wave, False),
    ],
    ids=["springs", "walled", "tilted", "constant", "fails far away", "fails at once", "periodic"],
)
def test_what_is_told_of_one_axis(energy, gradient, linear):
    scene = deli.Scene(1.0, [0.0, 1.5], [0.0, 0.0], potential=Potential(energy, gradient))
    assert scene.symmetry.linear == (linear,)


def test_a_run_names_what_is_kept_and_what_is_unknown(tmp_path):
    def run(potential):
        scene = deli.Scene(1.0, [0.0, 1.5], [0.3, 0.0], potential=potential)
        method, output = deli.GVI(scheme="verlet"), tmp_path / "run.nc"
        return deli.simulate(scene, method, step_size=0.01, steps=50, output=output, overwrite=True)

    kept = run(Potential(springs, slope))
    assert kept.attrs["conserved_linear_momentum"] == "x"
    assert deli.metrics.undecided_momenta(kept) == []
    assert deli.metrics.momentum_error(kept) < 1e-14
    unknown = run(Potential(tilted, slope_of_tilted))
    assert unknown.attrs["conserved_linear_momentum"] == "none"
    assert deli.metrics.undecided_momenta(deli.open_run(tmp_path / "run.nc")) == ["p_x"]
    assert np.isnan(deli.metrics.momentum_error(unknown))
    title = deli.plotting.momenta(unknown).axes[0].get_title(loc="left")
    assert title == "momenta (unknown whether conserved: $p_x$)"
