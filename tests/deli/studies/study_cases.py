"""What the tests of studies share: small studies, and ways to look at and disturb them."""

import os
import signal

import psutil
from running import groups

import deli
from deli.studies.expansion import make_study
from deli.studies.running import run_study

BALL = {"scene": "point_mass", "step_size": 0.01, "steps": 20}
CRADLE = {"scene": "newtons_cradle", "step_size": 0.01, "steps": 300_000, "record": {"every": 1000}}
SEEDS = {
    "base": CRADLE,
    "axes": {"scene.perturbation": [{"seed": seed, "momentum": 1e-3} for seed in range(2)]},
}
ENDLESS = 1_000_000_000


def study(folder, **table):
    return make_study({"base": BALL, **table}, folder)


def run(folder, table, *, workers=1, **options):
    return run_study(study(folder, **table), folder / "out", workers=workers, **options)


class Watch:
    """Remembers what it is told, and acts at the first report of a step."""

    def __init__(self, act=None, of=""):
        self.log, self._act, self._of = [], act, of

    def started(self, decision):
        self.log.append(("started", decision.case.title, decision.why))

    def step(self, decision, step):
        if self._act is not None and self._of in decision.case.title and step > 0:
            act, self._act = self._act, None
            act()

    def ended(self, decision, record):
        self.log.append(("ended", decision.case.title, record["state"]))

    def tick(self):
        pass

    @property
    def begun(self):
        return {title: why for what, title, why in self.log if what == "started"}


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


def is_worker(process):
    return "deli.studies.worker" in " ".join(process.cmdline())


def kill_workers():
    """Kill the worker processes that are children of this one, as the system does where memory runs out."""
    for child in filter(is_worker, psutil.Process().children()):
        child.kill()


def recorded(folder):
    """Everything that was recorded and does not depend on the clock, by file."""
    return {path.name: groups(deli.open_run(path)) for path in sorted((folder / "out" / "cases").glob("*.nc"))}


def assert_same_runs(one, other):
    assert list(one) == list(other)
    for name, parts in one.items():
        for mine, theirs in zip(parts, other[name], strict=True):
            assert mine.identical(theirs), name
