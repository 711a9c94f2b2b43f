"""A profile of compiled steps, by differences.

    python studies/benchmarks/profile_kernels.py [--seconds S] [--backend NAME ...]

Prints a Markdown table. cProfile does not see compiled code, so each figure compares runs over the same stretches of a
trajectory. "a row" is the difference between recording every step and every 10th. "solver" and "around" are clocked at
the calls of solvers. "kernels" is the rest of a step without rows. Scenes in flight and scenes that bounce differ by
the cost of a contact; backends differ by the cost of Python around a solver.
"""

import argparse

import numpy as np

from deli.bench.timing import EVERY, SCENES

STRETCHES = 20


def fastest(runner, state, steps, every):
    """Return seconds a step: in all, in solvers, and around them; of the fastest of three passes over one stretch."""
    found = []
    for _ in range(3):
        runner.place(*state)
        runner.counter.reset()
        seconds = runner.run(steps, every=every)
        found.append((seconds, runner.counter.solver_seconds, runner.counter.overhead_seconds))
    return np.array(min(found)) / steps


def measure(runner, state, steps):
    """Return the cost of steps on stretches of a given length, from a state on."""
    sparse, dense, counts = [], [], []
    for _ in range(STRETCHES):
        runner.place(*state)
        runner.counter.reset()
        runner.run(steps, every=1)
        following = runner.state
        counts.append((runner.counter.touching / steps, runner.counter.solves / steps))
        sparse.append(fastest(runner, state, steps, EVERY))
        dense.append(fastest(runner, state, steps, 1)[0])
        state = following
    step, inside, around = np.mean(sparse, axis=0)
    touching, solves = np.mean(counts, axis=0)
    row = np.median(np.array(dense) - np.array(sparse)[:, 0]) / (1.0 - 1.0 / EVERY)
    return {
        "µs a step": step,
        "kernels": step - row / EVERY - inside - around,
        "solver": inside,
        "around": around,
        "a row": row,
        "solves": solves * 1e-6,
        "steps with a contact": touching,
    }


def text(name, value):
    return f"{value:.1%}" if name == "steps with a contact" else f"{1e6 * value:.2f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=2.0, help="of one pass over each scene (default: 2)")
    parser.add_argument("--backend", action="append", help="only this backend; may be repeated")
    options = parser.parse_args()
    header = None
    for case in SCENES:
        runners = {backend: case.runner(solvers=backend) for backend in options.backend or ["native", "daqp"]}
        start = next(iter(runners.values())).state
        pace = max(runner.pace() for runner in runners.values())
        steps = max(EVERY, round(options.seconds / STRETCHES / pace / EVERY) * EVERY)
        for backend, runner in runners.items():
            found = measure(runner, start, steps)
            if header is None:
                header = list(found)
                print(f"| scene | backend | {' | '.join(header)} |")
                print("|---" * (len(header) + 2) + "|")
            cells = " | ".join(text(name, value) for name, value in found.items())
            print(f"| {case.label} | {backend} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
