import math

import pytest

from deli import InputError, scenes


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: scenes.get("pogo"), r"scene: found 'pogo'; choose one of lennard_jones, newtons_cradle, "),
        (lambda: scenes.get(["pogo"]), r"scene: found \['pogo'\]; choose one of"),
        (lambda: scenes.defaults(""), r"scene: found ''; choose one of"),
        (
            lambda: scenes.pogo_stick(stifness=1.0),
            r"scene pogo_stick: found 'stifness'; its parameters, .*: mass, stiffness,",
        ),
        (
            lambda: scenes.newtons_cradle(5),
            r"scene newtons_cradle: found a value without a name, 5; its parameters, by key",
        ),
        (lambda: scenes.point_mass(mass=-1.0), r"mass: found -1.0; it must be > 0"),
        (
            lambda: scenes.point_mass(position=-1.0),
            r"position: unilateral constraint 0 \(plane under body 0\) has value -1",
        ),
        (lambda: scenes.point_mass(gravity="9.8"), r"gravity: found '9.8' .*; pass real numbers"),
        (lambda: scenes.pogo_stick(position=[6.0, -1.0]), r"\(plane under body 1\) has value -1 at the start"),
        (lambda: scenes.pogo_stick(position=[6.0]), r"momentum: found 2 entries, position has 1"),
        (
            lambda: scenes.spring_sphere(start="fast"),
            r"start of spring_sphere: found 'fast'; choose one of 'smooth', 'mixed'",
        ),
        (lambda: scenes.spring_sphere(radius=0.0), r"radius of spring_sphere: found 0.0; it must be > 0"),
        (
            lambda: scenes.spring_sphere(position=[1.0, 2.0, 3.0]),
            r"position of spring_sphere: found shape \(3,\); pass",
        ),
        (
            lambda: scenes.spring_sphere(position=[[0.0, 0.0], [3.0, 4.0]]),
            r"position of spring_sphere: .* at the origin",
        ),
        (lambda: scenes.nonlinear_oscillator(clearance=-0.5), r"\(gap body 0 - body 1\) has value -1 at the start"),
        (lambda: scenes.nonlinear_oscillator(speed=math.nan), r"speed of nonlinear_oscillator: found nan"),
        (lambda: scenes.newtons_cradle(balls=0), r"balls of newtons_cradle: found 0; it must be >= 1"),
        (lambda: scenes.newtons_cradle(balls=2.5), r"balls of newtons_cradle: found 2.5; pass a whole number >= 1"),
        (lambda: scenes.newtons_cradle(balls=True), r"balls of newtons_cradle: found True; pass a whole number >= 1"),
        (
            lambda: scenes.newtons_cradle(mass=[1.0, 2.0]),
            r"mass: found shape \(2,\); pass one number, one for each of 5",
        ),
        (lambda: scenes.lennard_jones(rise=1.0), r"rise of lennard_jones: found 1.0; it must be smaller than the rod"),
        (lambda: scenes.lennard_jones(turn=0.0), r"turn of lennard_jones: found 0.0; a full turn leaves no helix"),
        (lambda: scenes.lennard_jones(spheres=1), r"spheres of lennard_jones: found 1; it must be >= 2"),
        (
            lambda: scenes.lennard_jones(container=0.2),
            r"container of lennard_jones: found 0.2; it must be > .*radius 0.3",
        ),
        (lambda: scenes.lennard_jones(container=1.0), r"\(container gap body 0\) has value -0.\d+ at the start"),
        (lambda: scenes.lennard_jones(sigma=-1.0), r"sigma of LennardJones: found -1.0; it must be > 0"),
        (lambda: scenes.lennard_jones(momentum=[1.0]), r"momentum: found 1 entries|momentum: found shape \(1,\)"),
    ],
)
def test_bad_input_is_refused_with_what_to_do(make, message):
    with pytest.raises(InputError, match=message):
        make()
