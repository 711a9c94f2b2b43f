"""Resuming takes everything from the file and nothing from memory: live state is corrupted before it is loaded."""

import dataclasses
import random

import netCDF4
import numpy as np
import pytest
from fault_scenes import BACKENDS, METHODS, SCENES
from running import assert_same

import deli
import solvers.errors
from deli.integrators.bound import Bound
from deli.recording.netcdf import Writer
from deli.recording.reading import read_unfinished
from deli.recording.schema import STATS, TRAJECTORY, Schema, remembered

SEED = 20120506


def corrupt(bound):
    """Fill everything that a stepper works in with nan, or with numbers that mean something else.

    The step size is a setting and no state, and so is the level of gaps, which is 0, where no contact ever lands.
    """
    kept = {"span"} if bound.recipe.unit == "deli.kernels.step.step" else {"span", "level"}
    for record in (bound.work, bound._mail, bound._program):
        for name, array in record._asdict().items():
            if name not in kept:
                array[...] = np.nan if array.dtype.kind == "f" else 1
    if bound._system.reference.size:
        bound._system.reference[:] = 0.0  # where neighbours were searched, were it remembered


def cut(path, rows):
    """Make an unfinished run of a finished one: of `rows` committed rows, what follows being garbage."""
    found, partial = read_unfinished(path), path.with_name(f"{path.name}.partial")
    path.unlink()
    counts = {TRAJECTORY: rows, STATS: rows - 1}
    groups = {
        group: {
            name: (dims, values[:count] if dims and dims[0] in ("time", "step") else values, attributes)
            for name, (dims, values, attributes) in found.groups[group].items()
        }
        for group, count in counts.items()
    }
    dof, axes = (len(found.groups[TRAJECTORY][name][1]) for name in ("dof", "axis"))
    schema = Schema(dof, axes, remembered(found.groups[TRAJECTORY]))
    attributes = found.attributes | {"outcome": "unfinished"}
    Writer(partial, schema, attributes, dataclasses.replace(found, groups=groups)).abandon()
    with netCDF4.Dataset(partial, "a") as dataset:
        for group, first in counts.items():
            for name in schema.growing(group):
                variable = dataset[group][name]
                garbage = np.nan if variable.dtype.kind == "f" else 77
                variable[first : first + 9] = np.full((9, *variable.shape[1:]), garbage)


def resume_corrupted(monkeypatch, path, place=Bound.place, **arguments):
    """Resume a run; what a stepper works in is garbage until the file's state is put in its place."""
    placed = []

    def corrupted(self, *state):
        corrupt(self)
        placed.append(self)
        place(self, *state)

    with monkeypatch.context() as patch:
        patch.setattr(Bound, "place", corrupted)
        run = deli.simulate(output=path, resume=True, **arguments)
    assert len({id(bound) for bound in placed}) == 1
    return run


def require_same_when_resumed(monkeypatch, path, source, scene, method, backend, **settings):
    """A run, and the same run resumed after a random row, are equal to the bit."""
    case = SCENES[scene]
    steps, every, skip = source.randint(6, 14), source.choice((1, 1, 3)), backend is None or source.random() < 0.5
    arguments = {"step_size": case.step_size, "steps": steps, "every": every, "skip": skip, "method": METHODS[method]}
    arguments |= {"solvers": backend or "auto", **settings}
    try:
        full = deli.simulate(case.build(), output=path, **arguments)
    except deli.InputError as refused:
        pytest.skip(f"{method} refuses {scene}: {refused}")
    rows = source.randint(1, max(full["trajectory"].sizes["time"] - 1, 1))
    print(f"seed {SEED}: {scene}, {method}, {backend}: {arguments}, resumed after {rows} rows")
    cut(path, rows)
    resumed = resume_corrupted(monkeypatch, path, scene=case.build(), **arguments)
    assert resumed.attrs["outcome"] == full.attrs["outcome"]
    assert_same(resumed, full)
    path.unlink()


def combinations():
    """Each scene, method and backend in turn: a covering subset of the product, which is not the same each way."""
    source = random.Random(SEED)
    scenes, methods, backends = list(SCENES), list(METHODS), [None, *BACKENDS]
    for place in range(max(map(len, (scenes, methods, backends)))):
        yield scenes[place % len(scenes)], methods[place % len(methods)], source.choice(backends)
    yield "newtons_cradle", "moreau_jean", None  # rods at the level of velocities
    for place, backend in enumerate(backends):
        yield scenes[(place + 5) % len(scenes)], "gvi", backend


@pytest.mark.parametrize(("scene", "method", "backend"), list(combinations()))
def test_resuming_is_not_seen(tmp_path, monkeypatch, scene, method, backend):
    source = random.Random(f"{SEED} {scene} {method} {backend}")
    require_same_when_resumed(monkeypatch, tmp_path / "run.nc", source, scene, method, backend)


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", SCENES)
def test_resuming_is_not_seen_with_any_backend(tmp_path, monkeypatch, scene, method):
    for backend in (None, *BACKENDS):
        source = random.Random(f"{SEED} {scene} {method} {backend}")
        require_same_when_resumed(monkeypatch, tmp_path / "run.nc", source, scene, method, backend)


@pytest.mark.parametrize("part", ["position", "momentum", "memory"])
def test_what_is_not_loaded_would_be_seen(tmp_path, monkeypatch, part):
    """The corruption reaches each part of the state: a stepper that keeps its own goes wrong."""
    place = Bound.place

    def forgetful(self, position, momentum, memory):
        kept = {"position": self.work.q.copy(), "momentum": self.work.p.copy(), "memory": self.work.memory.copy()}
        place(self, position, momentum, memory)
        if not self.recipe.memory:  # it compares energies
            return
        {"position": self.work.q, "momentum": self.work.p, "memory": self.work.memory}[part][:] = kept[part]

    path, arguments = tmp_path / "run.nc", {"step_size": 0.02, "steps": 8, "method": deli.NonsmoothAlpha()}
    full = deli.simulate(deli.scenes.newtons_cradle(), output=path, **arguments)
    cut(path, 5)
    try:
        resumed = resume_corrupted(monkeypatch, path, forgetful, scene=deli.scenes.newtons_cradle(), **arguments)
    except solvers.errors.ParameterError as error:
        assert "holds nan" in str(error)  # noqa: PT017
    else:
        assert resumed.attrs["outcome"] != full.attrs["outcome"]


def test_warm_starts_resume_to_the_tolerance(tmp_path, monkeypatch):
    """Where answers begin from earlier ones, a resumed run begins without: it is as right, not the same."""
    path, warm = tmp_path / "run.nc", {"backend": "osqp", "warm_start": True}
    arguments = {"step_size": 0.02, "steps": 40, "method": deli.GVI(), "solvers": warm, "skip": False}
    full = deli.simulate(deli.scenes.newtons_cradle(balls=3), output=path, **arguments)
    cut(path, 20)
    resumed = resume_corrupted(monkeypatch, path, scene=deli.scenes.newtons_cradle(balls=3), **arguments)
    assert resumed.attrs["outcome"] == "complete"
    np.testing.assert_allclose(resumed["trajectory"]["position"], full["trajectory"]["position"], atol=1e-7)
