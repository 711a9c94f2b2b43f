"""Programs of equations alone: linear solves without a solver, counted as such, right for any rods."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest
from law_cases import Case, double_pendulum
from law_runs import Run, difference, growth, run

import deli
import solvers
from solvers import registry

REFLECTION, POSITION, PROJECTION = range(3)
EPSILON = np.finfo(float).eps


def chains(links: int, pivots: tuple[float, ...] = (0.0,), repeated: tuple[int, ...] = ()) -> deli.Scene:
    """Thrown chains of rods that hang from pivots under gravity, each in its own form; some rods are there twice."""
    number = np.arange(links)
    mass, positions, velocities = 1.0 + 0.5 * np.cos(number), [], []
    for pivot in pivots:
        angle, speed = 0.4 + 0.5 * np.sin(3.0 * number + pivot), np.cos(2.0 * number + pivot)
        arms = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
        positions.append(np.array([pivot, 0.0]) + np.cumsum(arms, axis=0))
        velocities.append(np.cumsum(speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), axis=0))
    first = links * np.arange(len(pivots))
    pairs = np.concatenate([np.stack([number[:-1], number[1:]], axis=1) + body for body in first])
    return deli.Scene(
        mass=np.tile(mass, len(pivots)),
        position=np.concatenate(positions),
        momentum=np.tile(mass, len(pivots))[:, None] * np.concatenate(velocities),
        potential=[deli.Gravity([0.0, -9.8])],
        bilateral=[
            deli.AnchoredRods(pivots=np.stack([pivots, np.zeros(len(pivots))], axis=1), length=1.0, bodies=first),
            deli.Rods(pairs=np.concatenate([pairs, pairs[list(repeated)]]), length=1.0),
        ],
        dimension=2,
    )


def pendulums() -> deli.Scene:
    """Three masses, each on a rod of its own."""
    pivots = np.array([[0.0, 0.0], [4.0, 0.0], [8.0, 1.0]])
    return deli.Scene(
        mass=[1.0, 2.0, 0.5],
        position=pivots + np.array([[0.0, -1.0], [0.6, -0.8], [1.0, 0.0]]),
        momentum=[[1.0, 0.0], [0.8, 0.6], [0.0, 0.0]],
        potential=[deli.Gravity([0.0, -9.8])],
        bilateral=[deli.AnchoredRods(pivots=pivots, length=1.0)],
        dimension=2,
    )


def braced(angle: float) -> deli.Scene:
    """A mass in space that swings on two rods from pivots that are near each other."""
    pivots = np.array([[0.0, 0.0, 1.0], [0.0, np.sin(angle), np.cos(angle)]])
    return deli.Scene(
        mass=1.0,
        position=[0.0, 0.0, 0.0],
        momentum=[1.0, 0.0, 0.0],
        potential=[deli.Gravity([0.0, 0.0, -9.8])],
        bilateral=[deli.AnchoredRods(pivots=pivots, length=1.0, bodies=[0, 0])],
        dimension=3,
    )


RODS = [
    Case("one_row_an_island", pendulums, 0.02, 40),
    Case("two_rows", double_pendulum, 0.02, 40),
    Case("five_rows", deli.scenes.lennard_jones, 0.02, 40, "verlet"),
    Case("newton", deli.scenes.lennard_jones, 0.02, 40),
    Case("three_rows_an_island", lambda: chains(3, (0.0, 3.0)), 0.01, 40),
    Case("twelve_rows", lambda: chains(12), 0.005, 40),
    Case("repeated_rows", lambda: chains(4, repeated=(0, 2)), 0.01, 40),
    Case("nearly_dependent_rows", lambda: braced(1e-4), 0.01, 40),
]
EVERY_ROD = pytest.mark.parametrize("case", [pytest.param(case, id=case.name) for case in RODS])


class Counting(solvers.Backend):
    """Answers as daqp does, and counts."""

    name = "counting"
    asked = 0

    def __init__(self, program: solvers.QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self._solver = registry.factory("daqp")(program, tolerance, options)

    def update(self) -> None:
        self._solver.update()

    def solve(self) -> solvers.Answer:
        Counting.asked += 1
        return self._solver.solve()


@pytest.fixture
def counting() -> Iterator[type[Counting]]:
    registry.register("counting", Counting)
    Counting.asked = 0
    yield Counting
    registry.unregister("counting")


def swing(case: Case, **options: Any) -> Run:
    return run(case.build(), deli.GVI(scheme=case.scheme), case.step_size, case.steps, **options)


@EVERY_ROD
def test_linear_solves_ask_no_solver_and_are_counted_as_skipped(case: Case, counting: type[Counting]) -> None:
    found = swing(case, solvers={"backend": "counting", "tolerance": 1e-12})
    assert counting.asked == 0
    assert found.backends == set()
    assert not found.solves.any()
    assert (found.skipped[:, [POSITION, PROJECTION]] == 1).all()
    assert (found.status == 0).all()
    assert np.isfinite(found.residuals[:, :, POSITION]).all()
    assert found.residual <= 1e-13


@EVERY_ROD
def test_without_skipping_every_one_of_them_goes_to_the_solver(case: Case, counting: type[Counting]) -> None:
    found = swing(case, solvers={"backend": "counting", "tolerance": 1e-12}, skip=False)
    assert (found.solves[:, [POSITION, PROJECTION]] >= 1).all()
    assert (found.skipped[:, [POSITION, PROJECTION]] == 0).all()
    assert counting.asked >= found.solves.sum() > 0
    assert found.backends == {"counting"}


@EVERY_ROD
def test_a_linear_solve_has_the_answer_of_a_solver(case: Case) -> None:
    skipping = swing(case, skip=True)
    solving = swing(case, solvers={"backend": "daqp", "tolerance": 1e-12}, skip=False)
    method = deli.GVI(scheme=case.scheme)
    rows = np.linalg.svd(skipping.scene.bilateral.jacobian(skipping.scene.position), compute_uv=False)
    condition = rows[0] / rows[rows > 1e-10][-1]  # by which a residual of the rows is less than the error it leaves
    allowed = growth(skipping, method, case.step_size) * condition * (skipping.rounding + solving.rounding)
    assert difference(skipping, solving) <= allowed < 1e-6


def test_rods_that_are_there_twice_change_nothing() -> None:
    """Rows that depend on each other have no factor, and are left to the active-set method."""
    once, twice = (run(scene, deli.GVI(), 0.01, 100) for scene in (chains(4), chains(4, repeated=(0, 1, 2))))
    np.testing.assert_allclose(twice.position, once.position, rtol=0, atol=1e-11)
    np.testing.assert_allclose(twice.momentum, once.momentum, rtol=0, atol=1e-10)
    assert not twice.solves.any()


def test_steps_with_linear_solves_are_the_same_bits_wherever_they_begin() -> None:
    """No factor, and nothing else, is carried from step to step: rows that are written anew are factorized anew."""
    for case in RODS:
        whole, method = swing(case), deli.GVI(scheme=case.scheme)
        half = case.steps // 2
        rest = run(case.build(), method, case.step_size, half, start=whole.states[half])
        for one, other in zip(whole.states[half:], rest.states, strict=True):
            for mine, theirs in zip(one, other, strict=True):
                np.testing.assert_array_equal(mine, theirs)
