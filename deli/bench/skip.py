"""The time saved by answering subproblems without a solver if they need none."""

from typing import Any

from deli.bench.part import Column, Measure, Part, Row
from deli.bench.timing import SCENES, Case, race

FULL, QUICK = (5, 0.4), (3, 0.05)  # rounds, seconds of one


def _cases(quick: bool) -> list[tuple[str, Measure]]:
    rounds, seconds = QUICK if quick else FULL
    return [(case.label, lambda case=case: _scene(case, rounds, seconds)) for case in SCENES]  # type: ignore[misc]


def _scene(case: Case, rounds: int, seconds: float) -> list[Row]:
    contenders: dict[str, dict[str, Any]] = {"skip": {"solvers": "daqp"}, "solve": {"solvers": "daqp", "skip": False}}
    costs = race(case, contenders, rounds, seconds)
    skipping, solving = costs["skip"], costs["solve"]
    more = solving.solves - skipping.solves
    return [
        {
            "scene": case.label,
            "us_skip": 1e6 * skipping.seconds,
            "us_solve": 1e6 * solving.seconds,
            "ratio": solving.seconds / skipping.seconds,
            "solves_skip": skipping.solves,
            "solves_solve": solving.solves,
            "us_per_solve": 1e6 * (solving.seconds - skipping.seconds) / more if more > 0.0 else None,
        }
    ]


PART = Part(
    name="skip",
    title="cost of a step with daqp, with skip = true and false",
    keys=("scene",),
    columns=(
        Column("scene", "scene"),
        Column("us_skip", "µs, true", ".2f"),
        Column("us_solve", "µs, false", ".1f"),
        Column("ratio", "false / true", ".1f", compared=True),
        Column("solves_skip", "solves, true", ".2f"),
        Column("solves_solve", "solves, false", ".2f"),
        Column("us_per_solve", "µs a solve more", ".1f"),
    ),
    cases=_cases,
)
