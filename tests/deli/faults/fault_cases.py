"""What the tests of faults share: a run that is disturbed, and what must be true of its file at any moment."""

from pathlib import Path

from running import assert_same, groups

import deli

STUDY = """
base = {scene = "newtons_cradle", step_size = 0.01, steps = 20_000, record = {every = 10}}
axes."scene.perturbation" = [{seed = 0, momentum = 1e-3}, {seed = 1, momentum = 1e-3}]
"""
RUN = ("run", "newtons_cradle", "--set", "scene.balls=3", "--set", "step_size=0.01", "--quiet", "-o", "run.nc")


def command(steps, *more):
    return (*RUN, "--set", f"steps={steps}", *more)


def recorded(folder):
    """What a study has recorded that does not depend on the clock, by file."""
    return {path.name: groups(deli.open_run(path)) for path in sorted(Path(folder, "cases").glob("*.nc"))}


def undisturbed(steps):
    return deli.simulate(deli.scenes.newtons_cradle(balls=3), deli.GVI(), step_size=0.01, steps=steps)


def require_right_rows(path, full):
    """Open a file, finished or not, and compare all its rows; returns how many there are."""
    run = deli.open_run(path)
    for found, whole, dimension in zip(groups(run), groups(full), ("time", "step"), strict=True):
        assert found.identical(whole.isel({dimension: slice(found.sizes[dimension])}).assign_attrs(found.attrs))
    return run["trajectory"].sizes["time"]


def require_right_end(path, full):
    """Compare a finished file with the undisturbed run; nothing lies about beside it."""
    path = Path(path)
    run = deli.open_run(path)
    assert run.attrs["outcome"] == "complete"
    assert_same(run, full)
    assert [each.name for each in path.parent.glob(f"{path.name}*.new")] == []
    assert not Path(f"{path}.partial").exists()


def require_said(ended, status, *words):
    """One message that says what happened, and no traceback."""
    assert ended.status == status, ended
    assert ended.err.startswith("deli: "), ended
    assert ended.err.count("\n") == 1, ended
    for word in words:
        assert word in ended.err, ended
