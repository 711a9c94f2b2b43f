"""A user's function that raises, at whichever call: the error comes out at once, and the step can be taken again."""

import numpy as np
import pytest
from law_cases import SCHEMES

import deli

STEP_SIZE, STEPS = 0.05, 4
MOST_CALLS = 300  # of a step that are made to raise: all, but where a shadow energy is sought
METHODS = [
    *(deli.GVI(scheme=scheme, predictor=predictor) for scheme in SCHEMES for predictor in ("forward", "closed_loop")),
    *(deli.GVI(energy=energy, predictor="closed_loop") for energy in ("numerical", "shadow4")),
    deli.GVI(linearized=True),
    deli.DiscreteSmooth(),
    deli.Newmark(),
    deli.Newmark(beta=0.0),
    deli.MoreauJean(),
    deli.NonsmoothAlpha(),
    *(deli.Collision(energy=energy) for energy in ("hamiltonian", "discrete", "numerical")),
    deli.Collision(order=4),
]


class Blown(Exception):
    pass


class Fuse:
    """Functions that count their calls together, one of which raises."""

    def __init__(self) -> None:
        self.calls, self.blown = 0, np.inf

    def __call__(self, function):
        def called(q):
            self.calls += 1
            if self.calls == self.blown:
                raise Blown
            return function(q)

        return called


def swing(fuse: Fuse, above: float) -> deli.Scene:
    """Two masses on a rod under gravity: one is on a curved floor, or above it, the other over a flat one."""
    pull = np.array([0.0, 9.8, 0.0, 9.8])

    def gaps(q):
        return np.array([np.hypot(q[0], q[1] + 2.0) - 2.0, q[3] + 0.05])

    def gap_gradients(q):
        length = np.hypot(q[0], q[1] + 2.0)
        return np.array([[q[0] / length, (q[1] + 2.0) / length, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

    def rod(q):
        return np.array([np.hypot(*(q[2:] - q[:2])) - 1.0])

    def rod_gradient(q):
        along = (q[2:] - q[:2]) / np.hypot(*(q[2:] - q[:2]))
        return np.concatenate([-along, along])[np.newaxis]

    return deli.Scene(
        mass=[1.0, 2.0],
        position=[0.0, above, 1.0, above],
        momentum=[0.2, 0.0, 0.4, -1.0],
        dimension=2,
        potential=deli.Potential(
            energy=fuse(lambda q: pull @ q + q[0] ** 4),
            gradient=fuse(lambda q: pull + np.array([4.0 * q[0] ** 3, 0.0, 0.0, 0.0])),
            hessian=fuse(lambda q: np.diag([12.0 * q[0] ** 2, 0.0, 0.0, 0.0])),
        ),
        unilateral=[deli.Constraints(fuse(gaps), fuse(gap_gradients))],
        bilateral=[deli.Constraints(fuse(rod), fuse(rod_gradient))],
    )


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_step_that_raised_can_be_taken_again(method: object) -> None:
    fuse = Fuse()
    scene = swing(fuse, 0.01 if isinstance(method, deli.Collision) else 0.0)  # where contacts may not rest
    stepper = method.stepper(scene, STEP_SIZE)
    state, met = (scene.position, scene.momentum), 0
    for _ in range(STEPS):
        begun = fuse.calls
        after = stepper.step(*state)
        counted = fuse.calls - begun
        for call in range(1, min(counted, MOST_CALLS) + 1):
            fuse.blown = fuse.calls + call
            with pytest.raises(Blown):
                stepper.step(*state)
            assert fuse.calls == fuse.blown
        again = stepper.step(*state)
        for one, other in zip(again, after, strict=True):
            assert one.tobytes() == other.tobytes()
        state = after
        met += stepper.stats.smooth_contacts + stepper.stats.reflected_contacts
    assert met > 0
