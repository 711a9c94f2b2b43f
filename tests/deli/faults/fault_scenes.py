"""Scenes, methods and backends that runs are resumed with."""

from dataclasses import dataclass

import deli
import solvers


@dataclass(frozen=True)
class Case:
    """A scene, and a step size with which its contacts come into play within a few steps."""

    build: object
    step_size: float


def _scene(name, step_size, **parameters):
    return Case(lambda: deli.scenes.get(name)(**parameters), step_size)


SCENES = {
    "point_mass": _scene("point_mass", 0.1),
    "quartic_wall": _scene("quartic_wall", 0.3),
    "pogo_stick": _scene("pogo_stick", 0.2),
    "spring_sphere_smooth": _scene("spring_sphere", 0.5, start="smooth"),
    "spring_sphere_mixed": _scene("spring_sphere", 0.25, start="mixed"),
    "nonlinear_oscillator": _scene("nonlinear_oscillator", 0.05),
    "newtons_cradle": _scene("newtons_cradle", 0.05),
    "lennard_jones": _scene("lennard_jones", 0.02, container=1.9, speed=4.0),
    "hard_rods": _scene("hard_rods", 0.2, rods=5),
    "hard_sphere_gas": _scene("hard_sphere_gas", 0.1, spheres=8, filled=0.3, boundary="walls"),
    "disc_pile": _scene("disc_pile", 0.02, rows=3, columns=3),
    "chain_on_cylinder": _scene("chain_on_cylinder", 0.01, masses=6),
    "granular_chain": _scene("granular_chain", 0.1, beads=6),
    "wedge": _scene("wedge", 0.05),
}
METHODS = {
    "gvi": deli.GVI(),
    "gvi_verlet": deli.GVI(scheme="verlet"),
    "gvi_moreau": deli.GVI(reflection="moreau"),
    "gvi_sequential": deli.GVI(scheme="verlet", reflection="sequential"),
    "gvi_numerical": deli.GVI(energy="numerical"),
    "gvi_numerical_verlet": deli.GVI(scheme="verlet", energy="numerical"),
    "gvi_closed_loop": deli.GVI(predictor="closed_loop"),
    "gvi_linearized": deli.GVI(linearized=True),
    "discrete_smooth": deli.DiscreteSmooth(),
    "discrete_smooth_verlet": deli.DiscreteSmooth(scheme="verlet"),
    "collision": deli.Collision(),
    "direct": deli.Direct(),
    "newmark": deli.Newmark(),
    "moreau_jean": deli.MoreauJean(),
    "nonsmooth_alpha": deli.NonsmoothAlpha(),
    "solve_ivp": deli.SolveIvp(),
}
BACKENDS = [info.name for info in solvers.backends() if info.installed]
