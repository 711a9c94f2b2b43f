"""A profile of steps in Python, for checkouts up to commit 8e65818.

    git worktree add /tmp/deli-python-steps 8e65818
    PYTHONPATH=/tmp/deli-python-steps python studies/benchmarks/profile_python_steps.py [--seconds S]

Prints a Markdown table: microseconds a step without the profiler, and cProfile's shares by kind of work (own time by
function; functions without a file count to their callers).
"""

import argparse
import cProfile
import pstats
import time

import deli
from deli.recording.recorder import Memory, Recorder
from deli.scenes.registry import defaults

EVERY = 10
CASES = {
    "ball": ("point_mass", {}),
    "pogo_stick": ("pogo_stick", {}),
    "newtons_cradle, 3": ("newtons_cradle", {"balls": 3, "pulled": 1}),
    "newtons_cradle, 5": ("newtons_cradle", {}),
    "lennard_jones": ("lennard_jones", {}),
    "spring_sphere, smooth": ("spring_sphere", {"start": "smooth"}),
    "spring_sphere, mixed": ("spring_sphere", {"start": "mixed"}),
    "nonlinear_oscillator": ("nonlinear_oscillator", {}),
}
GROUPS = {  # by the outermost of these functions that a call is in; the first that matches counts
    "recording": ("recorder.py:add", "recorder.py:flush"),
    "solver calls": ("compiled.py:solve",),
    "around solves": ("program.py:solve",),
    "stats": ("stats.py:skip", "stats.py:measure", "stats.py:add", "stats.py:reset"),
    "gaps, gradients": (
        "contacts.py:touching",
        "contacts.py:crossed",
        "contacts.py:gradients",
        "contacts.py:bilateral",
    ),
    "reflection": ("reflection.py:apply",),
    "prediction": ("position.py:predict",),
    "position": ("position.py:solve",),
    "projection": ("projection.py:solve",),
}


def build(name, parameters):
    usual = defaults(name)
    scene = getattr(deli.scenes, name)(**parameters)
    stepper = deli.GVI(scheme=usual["scheme"]).stepper(scene, usual["step_size"], solvers="daqp")
    return scene, stepper, Recorder(scene, Memory())


def take(stepper, recorder, state, steps):
    q, p = state
    for number in range(1, steps + 1):
        q, p = stepper.step(q, p)
        if number % EVERY == 0:
            recorder.add(float(number), q, p, stepper.stats)
            stepper.stats.reset()
    recorder.flush()
    return q, p


def group_times(profile):
    """Return seconds by group: inclusive times of its functions, less those of groups that they call."""
    stats = pstats.Stats(profile).stats
    names = {function: f"{function[0].rsplit('/', 1)[-1]}:{function[2]}" for function in stats}
    group_of = {
        function: group for function, name in names.items() for group, members in GROUPS.items() if name in members
    }
    times = dict.fromkeys((*GROUPS, "the rest"), 0.0)
    # The own time of every function goes to the groups of its callers, in proportion to their time in it.
    shares = {function: {group: 1.0} for function, group in group_of.items()}

    def share(function, path):
        if function in shares:
            return shares[function]
        callers = stats[function][4]
        total = sum(entry[3] for caller, entry in callers.items() if caller not in path)
        found = {}
        for caller, entry in callers.items():
            if caller in path or caller not in stats or total == 0.0:
                continue
            for group, part in share(caller, (*path, caller)).items():
                found[group] = found.get(group, 0.0) + part * entry[3] / total
        if not found:
            found = {"the rest": 1.0}
        shares[function] = found
        return found

    for function, (_, _, own, _, _) in stats.items():
        for group, part in share(function, (function,)).items():
            times[group] += own * part
    return times


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each measurement (default: 2)")
    seconds = parser.parse_args().seconds
    columns = ("prediction", "gaps, gradients", "reflection", "position", "projection")
    columns += ("solver calls", "around solves", "stats", "recording", "the rest")
    print("| scene | µs a step | " + " | ".join(columns) + " |")
    print("|---" * (len(columns) + 2) + "|")
    for label, (name, parameters) in CASES.items():
        scene, stepper, recorder = build(name, parameters)
        state = take(stepper, recorder, (scene.position, scene.momentum), 100)
        began = time.perf_counter()
        state = take(stepper, recorder, state, 100)
        steps = max(100, int(seconds / (time.perf_counter() - began) * 100))
        began = time.perf_counter()
        take(stepper, recorder, state, steps)
        plain = (time.perf_counter() - began) / steps
        profile = cProfile.Profile()
        profile.enable()
        take(stepper, recorder, state, steps)
        profile.disable()
        times = group_times(profile)
        total = sum(times.values())
        cells = " | ".join(f"{times[group] / total:.0%}" for group in columns)
        print(f"| {label} | {1e6 * plain:.0f} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
