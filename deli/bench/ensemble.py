"""The speed of many runs at once on the cores of a machine."""

import time

import deli
from deli.bench.part import Column, Measure, Part, Row
from deli.bench.store import cores
from deli.scenes.registry import defaults, get

SCENES = ("pogo_stick", "newtons_cradle", "hard_rods")
FULL, QUICK = (16, 20_000), (8, 1000)  # runs, steps of each


def _cases(quick: bool) -> list[tuple[str, Measure]]:
    runs, steps = QUICK if quick else FULL
    return [(name, lambda name=name: [_scene(name, runs, steps)]) for name in SCENES]  # type: ignore[misc]


def _scene(name: str, runs: int, steps: int) -> Row:
    row: Row = {"scene": name, "runs": runs, "steps": steps, "workers": cores()}
    simulate = getattr(deli, "simulate_ensemble", None)
    if simulate is None:
        return {"scene": name, "failed": "this version has no deli.simulate_ensemble"}
    usual = defaults(name)
    method, step_size = deli.GVI(scheme=usual["scheme"]), usual["step_size"]
    seconds = {}
    for workers in (1, cores()):
        scenes = [get(name)() for _ in range(runs)]
        began = time.perf_counter()
        simulate(scenes, method, step_size=step_size, steps=steps, every=10, workers=workers)
        seconds[workers] = time.perf_counter() - began
    alone, together = seconds[1], seconds[cores()]
    return row | {
        "steps_per_second": runs * steps / together,
        "speedup": alone / together,
        "of_ideal": alone / together / cores(),
    }


PART = Part(
    name="ensemble",
    title="runs at once on all cores, over one after another",
    keys=("scene",),
    columns=(
        Column("scene", "scene"),
        Column("runs", "runs"),
        Column("steps", "steps of each"),
        Column("workers", "workers"),
        Column("steps_per_second", "steps/s", ",.0f", compared=True),
        Column("speedup", "speed-up", ".2f"),
        Column("of_ideal", "of the ideal", ".0%"),
    ),
    cases=_cases,
)
