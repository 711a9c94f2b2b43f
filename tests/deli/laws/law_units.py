"""The scenes of the laws again in other units: lengths, masses and times multiplied by factors of one's own."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from law_cases import CASE_BY_NAME, discs

import deli


@dataclass(frozen=True)
class Units:
    """Factors by which the numbers of a scene grow."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @property
    def momentum(self) -> float:
        return self.mass * self.length / self.time

    @property
    def acceleration(self) -> float:
        return self.length / self.time**2

    @property
    def energy(self) -> float:
        return self.mass * self.length**2 / self.time**2


def _point_mass(units: Units) -> deli.Scene:
    return deli.scenes.point_mass(
        mass=units.mass, gravity=9.8 * units.acceleration, position=units.length, momentum=0.0
    )


def _quartic_wall(units: Units) -> deli.Scene:
    return deli.scenes.quartic_wall(
        mass=units.mass, stiffness=units.energy / units.length**4, position=units.length, momentum=0.0
    )


def _pogo_stick(units: Units) -> deli.Scene:
    return deli.scenes.pogo_stick(
        mass=units.mass,
        stiffness=10.0 * units.energy / units.length**2,
        rest_length=5.0 * units.length,
        gravity=9.8 * units.acceleration,
        position=np.array([6.0, 1.0]) * units.length,
    )


def _spring_sphere(start: str) -> Callable[[Units], deli.Scene]:
    def build(units: Units) -> deli.Scene:
        return deli.scenes.spring_sphere(
            start=start,
            mass=units.mass,
            radius=5.0 * units.length,
            repulsion=50.0 * units.energy * units.length**2,
            stiffness=units.energy / units.length**2,
            rest_length=np.sqrt(8.0) * units.length,
            speed=units.momentum,
        )

    return build


def _nonlinear_oscillator(units: Units) -> deli.Scene:
    return deli.scenes.nonlinear_oscillator(
        mass=units.mass,
        radius=units.length,
        strength=units.energy / units.length**6,
        well=units.length,
        clearance=0.4 * units.length,
        speed=units.momentum,
    )


def _newtons_cradle(units: Units) -> deli.Scene:
    return deli.scenes.newtons_cradle(
        mass=units.mass, radius=0.25 * units.length, length=units.length, gravity=9.8 * units.acceleration
    )


def _lennard_jones(units: Units) -> deli.Scene:
    given = CASE_BY_NAME["lennard_jones"].build().parameters
    lengths = {name: given[name] * units.length for name in ("sigma", "radius", "container", "length", "rise")}
    return deli.scenes.lennard_jones(
        mass=units.mass,
        epsilon=given["epsilon"] * units.energy,
        speed=given["speed"] * units.length / units.time,
        **lengths,
    )


def _discs(units: Units) -> deli.Scene:
    plain = discs()
    (spring,), (apart,), (rod,) = plain.potential.families, plain.unilateral.families, plain.bilateral.families
    return deli.Scene(
        mass=plain.mass * units.mass,
        position=plain.position * units.length,
        momentum=plain.momentum * units.momentum,
        potential=replace(
            spring,
            stiffness=spring.stiffness * units.energy / units.length**2,
            rest_length=spring.rest_length * units.length,
        ),
        unilateral=replace(apart, distance=apart.distance * units.length),
        bilateral=replace(rod, length=rod.length * units.length),
        dimension=2,
    )


IN_UNITS: dict[str, Callable[[Units], deli.Scene]] = {
    "point_mass": _point_mass,
    "quartic_wall": _quartic_wall,
    "pogo_stick": _pogo_stick,
    "spring_sphere_smooth": _spring_sphere("smooth"),
    "spring_sphere_mixed": _spring_sphere("mixed"),
    "nonlinear_oscillator": _nonlinear_oscillator,
    "newtons_cradle": _newtons_cradle,
    "lennard_jones": _lennard_jones,
    "discs": _discs,
}


def rescaled_constraints(scene: deli.Scene, factor: float) -> deli.Scene:
    """The scene with all constraints multiplied by a number: other functions for the same admissible set."""

    def times(stack: object) -> deli.Constraints | None:
        if not stack.rows:
            return None
        return deli.Constraints(value=lambda q: factor * stack.value(q), jacobian=lambda q: factor * stack.jacobian(q))

    return replace(scene, unilateral=times(scene.unilateral), bilateral=times(scene.bilateral))
