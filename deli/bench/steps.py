"""The cost of a step in each scene, with the compiled solver and with other solvers."""

import time

import numpy as np

import deli
from deli.bench.part import Column, Measure, Part, Row
from deli.bench.timing import SCENES, Case, race

BACKENDS = ("auto", "daqp")
OTHERS = ("piqp", "clarabel")
FULL, QUICK = (7, 0.4), (3, 0.05)  # rounds, seconds of one
_FEW = 0.2  # the least number of solves a step from which the cost of one can be computed


def _cases(quick: bool) -> list[tuple[str, Measure]]:
    backends = BACKENDS if quick else (*BACKENDS, *OTHERS)
    rounds, seconds = QUICK if quick else FULL
    cases: list[tuple[str, Measure]] = [
        (case.label, lambda case=case: _scene(case, backends, rounds, seconds))  # type: ignore[misc]
        for case in SCENES
    ]
    return [*cases, ("functions", lambda: _functions(rounds, seconds))]


def _scene(case: Case, backends: tuple[str, ...], rounds: int, seconds: float) -> list[Row]:
    costs = race(case, {backend: {"solvers": backend} for backend in backends}, rounds, seconds)
    native = costs["auto"]
    rows = []
    for backend, cost in costs.items():
        solves = 0.5 * (cost.solves + native.solves)
        told = backend != "auto" and solves >= _FEW
        rows.append(
            {
                "scene": case.label,
                "backend": backend,
                "us_per_step": 1e6 * cost.seconds,
                "share_solving": cost.share,
                "solves_per_step": cost.solves,
                "us_per_solve_more": 1e6 * (cost.seconds - native.seconds) / solves if told else None,
            }
        )
    return rows


class Functions:
    """The pogo stick as functions of a user, which count their calls."""

    def __init__(self) -> None:
        self.calls = {"energy": 0, "gradient": 0, "value": 0, "jacobian": 0}
        self._normal = np.array([[0.0, 1.0]])

    def energy(self, q: np.ndarray) -> float:
        """Return V(q)."""
        self.calls["energy"] += 1
        return float(9.8 * (q[0] + q[1]) + 5.0 * (abs(q[0] - q[1]) - 5.0) ** 2)

    def gradient(self, q: np.ndarray) -> np.ndarray:
        """Return the gradient of V at q."""
        self.calls["gradient"] += 1
        apart = q[0] - q[1]
        pull = 10.0 * (apart - (5.0 if apart > 0.0 else -5.0))
        return np.array([9.8 + pull, 9.8 - pull])

    def value(self, q: np.ndarray) -> np.ndarray:
        """Return g(q)."""
        self.calls["value"] += 1
        return q[1:]

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Return the derivative of g."""
        self.calls["jacobian"] += 1
        return self._normal

    def scene(self) -> deli.Scene:
        """Return the scene of these functions."""
        return deli.Scene(
            mass=1.0,
            position=[6.0, 1.0],
            momentum=[0.0, 0.0],
            potential=deli.Potential(energy=self.energy, gradient=self.gradient),
            unilateral=deli.Constraints(value=self.value, jacobian=self.jacobian),
        )

    def seconds(self, repeat: int = 2000) -> float:
        """Return the seconds that the calls counted so far take by themselves."""
        total, counted = 0.0, dict(self.calls)
        q = np.array([6.0, 1.0])
        for name, calls in counted.items():
            function, times = getattr(self, name), []
            for _ in range(5):
                began = time.perf_counter()
                for _ in range(repeat):
                    function(q)
                times.append((time.perf_counter() - began) / repeat)
            total += calls * float(np.median(times))
        return total


def _functions(rounds: int, seconds: float) -> list[Row]:
    functions = Functions()
    case = Case("pogo_stick, Python functions", "pogo_stick", build=functions.scene)
    cost = race(case, {"auto": {}}, rounds, seconds)["auto"]
    runner, steps = case.runner(), 1000
    functions.calls = dict.fromkeys(functions.calls, 0)
    runner.run(steps)
    inside = functions.seconds() / steps
    return [
        {
            "scene": case.label,
            "backend": "auto",
            "us_per_step": 1e6 * cost.seconds,
            "share_solving": cost.share,
            "solves_per_step": cost.solves,
            "us_of_functions": 1e6 * inside,
            "us_beside_functions": 1e6 * (cost.seconds - inside),
        }
    ]


PART = Part(
    name="steps",
    title="cost of a step, every 10th recorded (auto: compiled where it can)",
    keys=("scene", "backend"),
    columns=(
        Column("scene", "scene"),
        Column("backend", "backend"),
        Column("us_per_step", "µs", ".2f", compared=True),
        Column("share_solving", "solving", ".1%"),
        Column("solves_per_step", "solves", ".3f"),
        Column("us_per_solve_more", "µs a solve more", ".1f"),
        Column("us_of_functions", "in functions", ".1f"),
        Column("us_beside_functions", "beside", ".1f"),
    ),
    cases=_cases,
)
