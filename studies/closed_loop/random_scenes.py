"""Random scenes of balls in a room, some of them on rods and springs, that start without violation."""

import dataclasses
from random import Random

import numpy as np

import deli

SPACING, DIAMETERS = 1.0, (0.3, 0.5, 0.6)
NEAREST = 0.4  # least distance of two random positions
MARGINS = (0.0, 0.002, 0.2)  # between a ball at its site and the wall


def random_scene(random: Random) -> tuple[deli.Scene, float]:
    """Return a scene, and a step in which no body can move farther than three times the smallest distance in it."""
    dimension = random.randint(1, 3)
    side = 3 if dimension > 1 else 5
    sites = np.stack(np.meshgrid(*[np.arange(side)] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    bodies = random.randint(1, 5)
    chosen = SPACING * sites[random.sample(range(len(sites)), bodies)]
    diameter = random.choice(DIAMETERS)
    jitter = random.choice((0.0, 0.02, 0.5 * (SPACING - 0.6)))
    position = chosen + np.array([[random.uniform(-jitter, jitter) for _ in range(dimension)] for _ in range(bodies)])
    mass = np.array([random.choice((0.2, 1.0, 3.0)) for _ in range(bodies)])
    speed = random.choice((0.0, 0.2, 2.0))
    velocity = speed * np.array([[random.uniform(-1.0, 1.0) for _ in range(dimension)] for _ in range(bodies)])

    room = random.choice(("box", "ball", "none"))
    reach = jitter + random.choice(MARGINS)
    gravity = random.choice((0.0, 1.0, 9.8)) if room != "none" else 0.0
    stiffness = random.choice((0.0, 1.0, 30.0)) if bodies > 1 else 0.0
    rods = random.randint(0, bodies - 1) if dimension > 1 and random.random() < 0.4 else 0
    chain = np.array([(i, i + 1) for i in range(bodies - 1)])
    size = SPACING * (side - 1)

    unilateral: list[object] = []
    if bodies > 1:
        unilateral.append(deli.SpheresApart(pairs=None, distance=diameter))
    if room == "box":
        inward = np.vstack([np.eye(dimension), -np.eye(dimension)])
        offsets = np.concatenate([np.full(dimension, -reach), np.full(dimension, -size - reach)])
        every = np.repeat(np.arange(bodies), len(inward))
        unilateral.append(deli.Planes(np.tile(inward, (bodies, 1)), np.tile(offsets, bodies), every))
    elif room == "ball":
        centre = np.full(dimension, 0.5 * size)
        unilateral.append(
            deli.SpheresInside(radius=0.5 * size * np.sqrt(dimension) + reach * np.sqrt(dimension), centre=centre)
        )
    potential: list[object] = [deli.Gravity([0.0] * (dimension - 1) + [-gravity])]
    stored = 0.0
    if stiffness:
        apart = np.linalg.norm(position[chain[:, 0]] - position[chain[:, 1]], axis=1)
        length = random.uniform(0.2, 1.5)
        potential.append(deli.Springs(pairs=chain, stiffness=stiffness, rest_length=length))
        stored = 0.5 * stiffness * ((apart - length) ** 2).sum()
    bilateral = []
    if rods:
        lengths = np.linalg.norm(position[chain[:rods, 0]] - position[chain[:rods, 1]], axis=1)
        bilateral.append(deli.Rods(pairs=chain[:rods], length=lengths))
    at_rest = deli.Scene(
        mass=mass,
        position=position,
        momentum=np.zeros_like(position),
        potential=potential,
        unilateral=unilateral,
        bilateral=bilateral,
        dimension=dimension,
        name="random",
    )
    scene = dataclasses.replace(at_rest, momentum=_tangent(at_rest, velocity.reshape(-1)))
    available = 0.5 * (scene.momentum**2 / scene.mass).sum() + stored + mass.sum() * gravity * (size + 2.0 * reach)
    fastest = np.sqrt(2.0 * available / mass.min()) if available > 0.0 else 1.0
    step_size = random.choice((0.2, 1.0, 3.0)) * min(diameter, NEAREST) / fastest
    if stiffness:
        step_size = min(step_size, random.choice((0.1, 0.5)) * np.sqrt(mass.min() / (4.0 * stiffness)))
    return scene, float(f"{step_size:.2g}")


def _tangent(scene: deli.Scene, velocity: np.ndarray) -> np.ndarray:
    """Return the momentum of a velocity, projected so that no rod stretches."""
    scaled = np.sqrt(scene.mass) * velocity
    stretch = scene.bilateral.jacobian(scene.position) / np.sqrt(scene.mass)
    momentum: np.ndarray = np.sqrt(scene.mass) * (scaled - np.linalg.pinv(stretch) @ (stretch @ scaled))
    return momentum
