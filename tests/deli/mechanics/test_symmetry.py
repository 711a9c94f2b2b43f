import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanics_cases import DIMENSIONS, POTENTIALS, configurations, layout, spread

from deli import scenes
from deli.mechanics.potentials import RadialPowers
from deli.mechanics.scene import Scene
from deli.mechanics.symmetry import angular_momentum, linear_momentum

SETTINGS = settings(max_examples=15, deadline=None)


def rates(scene, q, p):
    """Rates of change of the momentum components under the force and a unit impulse of each constraint.

    Columns are the components (linear, then angular), one row for each cause; the first row also has q' = M^-1 p.
    """
    gradients = [scene.potential.gradient(q), *scene.unilateral.jacobian(q), *scene.bilateral.jacobian(q)]
    velocity = p / scene.mass
    rows = []
    for k, gradient in enumerate(gradients):
        torque, motion = angular_momentum(scene, q, gradient), angular_momentum(scene, velocity, p)
        angular = [] if torque is None else np.atleast_1d(torque + (motion if k == 0 else 0.0 * motion))
        rows.append(np.concatenate([linear_momentum(scene, gradient), angular]))
    return np.array(rows)


def check_components(scene, q, p):
    flags = scene.symmetry
    found = np.abs(rates(scene, q, p))
    for component, kept in enumerate([*flags.linear, *flags.angular]):
        if kept:
            assert found[:, component].max() < 1e-12 * (1.0 + found.max()), component
        else:
            assert found[:, component].max() > 1e-6, component


@pytest.mark.parametrize("name", scenes.available())
def test_a_scene_conserves_exactly_the_components_it_declares(name):
    scene, rng = scenes.get(name)(), np.random.default_rng(1)
    moved = scene.position + rng.uniform(-0.05, 0.05, scene.dof)
    check_components(scene, moved, rng.uniform(-1.0, 1.0, scene.dof))


@pytest.mark.parametrize(
    ("name", "linear", "angular"),
    [
        ("point_mass", (False,), ()),
        ("pogo_stick", (False,), ()),
        ("spring_sphere", (False, False), (True,)),
        ("nonlinear_oscillator", (False, False), (True,)),
        ("newtons_cradle", (False, False), (False,)),
        ("lennard_jones", (False, False, False), (True, True, True)),
    ],
)
def test_components_of_the_paper_s_scenes(name, linear, angular):
    flags = scenes.get(name)().symmetry
    assert flags.linear == linear
    assert flags.angular == angular


@pytest.mark.parametrize("potential", POTENTIALS)
@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_a_potential_alone(potential, dimension):
    q = spread(dimension) + np.random.default_rng(2).uniform(-0.4, 0.4, spread(dimension).size)
    mass = layout(dimension).mass
    scene = Scene(mass=mass, position=q, momentum=q, potential=POTENTIALS[potential](dimension), dimension=dimension)
    check_components(scene, q, np.random.default_rng(3).uniform(-1.0, 1.0, q.size))


def test_a_mass_that_differs_by_axis_breaks_rotations_only():
    even = Scene(mass=[1.0, 1.0, 1.0], position=[1.0, 2.0, 3.0], momentum=[1.0, -1.0, 0.5], dimension=3)
    uneven = Scene(mass=[1.0, 1.0, 2.0], position=[1.0, 2.0, 3.0], momentum=[1.0, -1.0, 0.5], dimension=3)
    assert even.symmetry.angular == (True, True, True)
    assert uneven.symmetry.angular == (False, False, True)
    assert uneven.symmetry.linear == (True, True, True)
    check_components(uneven, uneven.position, uneven.momentum)


def test_several_families_conserve_what_all_of_them_conserve():
    central, axial = RadialPowers([1.0], [2.0]), RadialPowers([1.0], [2.0], centre=[0.0, 0.0, 2.0])
    scene = Scene(mass=1.0, position=[1.0, 2.0, 3.0], momentum=np.zeros(3), potential=[central, axial], dimension=3)
    assert scene.symmetry.angular == (False, False, True)


@SETTINGS
@given(data=st.data(), dimension=st.sampled_from(DIMENSIONS))
def test_momenta_are_sums_over_bodies(data, dimension):
    q, p = data.draw(configurations(dimension, (2, 3))), data.draw(configurations(dimension, (2, 3)))
    scene = Scene(mass=1.0, position=q[0, 0], momentum=p[0, 0], dimension=dimension)
    x, y = q.reshape(2, 3, -1, dimension), p.reshape(2, 3, -1, dimension)
    np.testing.assert_allclose(linear_momentum(scene, p), y.sum(axis=2), rtol=1e-14)
    angular = angular_momentum(scene, q, p)
    if dimension == 1:
        assert angular is None
    elif dimension == 2:
        flat = np.concatenate([x, 0.0 * x[..., :1]], axis=-1), np.concatenate([y, 0.0 * y[..., :1]], axis=-1)
        np.testing.assert_allclose(angular, np.cross(*flat).sum(axis=2)[..., 2], rtol=1e-12, atol=1e-12)
    else:
        np.testing.assert_allclose(angular, np.cross(x, y).sum(axis=2), rtol=1e-14)
