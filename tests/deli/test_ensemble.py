"""deli.simulate_ensemble: its members are the runs of deli.simulate, to the bit, and none stops another."""

import dataclasses
import signal
import threading
import time
import tomllib

import numpy as np
import pytest
import xarray as xr
from running import CLOCKS

import deli
from deli.errors import InputError
from deli.running import crew


def pogo_sticks(count=6):
    heights = np.linspace(0.5, 2.0, count)
    return [deli.scenes.pogo_stick(position=(5.0 + height, height)) for height in heights]


def kicked(scene, count=5):
    rng = np.random.default_rng(7)
    kicks = rng.normal(size=(count, scene.dof))
    rows = scene.bilateral.jacobian(scene.position)
    if len(rows):
        kicks -= kicks @ np.linalg.pinv(rows) @ rows  # for equal masses
    return [dataclasses.replace(scene, momentum=scene.momentum + kick) for kick in kicks]


def user_made(count=3):
    """Balls in a well, on a floor, all in functions of Python."""
    well = deli.Potential(lambda q: float(q @ q), lambda q: 2.0 * q, lambda q: 2.0 * np.eye(q.size))
    floor = deli.Constraints(lambda q: q[1:] + 0.5, lambda q: np.array([[0.0, 1.0]]))
    return [deli.Scene(1.0, [0.1, k], [0.3, -1.0], well, floor, dimension=2) for k in range(count)]


def failing(at, count=5):
    """Balls in free flight, of which number 2 ends where its potential is no longer defined."""

    def energy(q):
        if q[0] > at:
            raise ValueError("too far")
        return 0.0

    edge = deli.Potential(energy, lambda q: np.zeros(1) * energy(q), lambda q: np.zeros((1, 1)))
    return [deli.Scene(1.0, 0.0, 1.0 if k == 2 else 0.0, edge) for k in range(count)]


def mixed():
    """One ball by two kinds of scene and two shapes of table."""
    one = deli.scenes.point_mass()
    walled = dataclasses.replace(one, unilateral=[deli.Planes([1.0]), deli.Planes([-1.0], offsets=-3.0)])
    return [one, walled, one, dataclasses.replace(one, potential=None), walled]


def numbers():
    """Of several masses, springs and fields: some have a table in common, and others have not."""
    one = deli.scenes.pogo_stick()
    heavy, soft = deli.scenes.pogo_stick(mass=3.0), deli.scenes.pogo_stick(stiffness=2.0)
    return [one, dataclasses.replace(one, momentum=[0.4, -0.2]), heavy, one, soft, heavy]


CASES = {
    "pogo sticks": (pogo_sticks, deli.GVI(scheme="verlet"), 0.1, "auto"),
    "other numbers": (numbers, deli.GVI(scheme="verlet"), 0.1, "auto"),
    "pogo sticks, daqp": (pogo_sticks, deli.GVI(), 0.1, {"backend": "daqp", "polish": True}),
    "cradles": (lambda: kicked(deli.scenes.newtons_cradle(balls=3)), deli.GVI(), 0.01, "native"),
    "cradles, closed loop": (
        lambda: kicked(deli.scenes.newtons_cradle(balls=3)),
        deli.GVI(predictor="closed_loop", reflection="moreau"),
        0.01,
        "auto",
    ),
    "chains": (lambda: [deli.scenes.granular_chain() for _ in range(2)], deli.GVI(), 0.001, "daqp"),
    "smooth": (pogo_sticks, deli.DiscreteSmooth(), 0.01, "auto"),
    "with a memory": (pogo_sticks, deli.NonsmoothAlpha(), 0.05, "auto"),
    "functions, with a memory": (user_made, deli.NonsmoothAlpha(), 0.05, "daqp"),
    "functions": (user_made, deli.GVI(), 0.01, "daqp"),
    "mixed": (mixed, deli.GVI(energy="numerical"), 0.01, "auto"),
}


def assert_member(run, member, alone):
    for group in ("trajectory", "solver_stats"):
        found = run[group].to_dataset(inherit=False).isel(member=member).drop_vars(CLOCKS, errors="ignore")
        xr.testing.assert_identical(found, alone[group].to_dataset().drop_vars(CLOCKS, errors="ignore"))


@pytest.mark.parametrize("workers", [1, 3])
@pytest.mark.parametrize("case", CASES)
def test_members_are_their_runs_alone_to_the_bit(case, workers):
    make, method, step_size, solvers = CASES[case]
    scenes, arguments = make(), {"step_size": step_size, "steps": 101, "every": 10, "solvers": solvers}
    run = deli.simulate_ensemble(scenes, method, workers=workers, **arguments)
    assert (run["outcome"] == "complete").all()
    assert run.attrs["outcome"] == "complete"
    for member, scene in enumerate(scenes):
        alone = deli.simulate(scene, method, **arguments)
        assert_member(run, member, alone)
    assert run.attrs["backend_versions"] == alone.attrs["backend_versions"] or case == "mixed"


def test_searched_neighbours_are_each_members_own():
    scenes = kicked(deli.scenes.hard_sphere_gas(spheres=210), count=3)
    arguments = {"step_size": 1e-3, "steps": 12}
    run = deli.simulate_ensemble(scenes, deli.GVI(), workers=2, **arguments)
    for member, scene in enumerate(scenes):
        assert_member(run, member, deli.simulate(scene, deli.GVI(), **arguments))


def test_many_members_are_taken_in_chunks():
    chunks = crew._chunks(1000, 2)
    assert [member for chunk in chunks for member in chunk] == list(range(1000))
    assert len(chunks[0]) == crew._MOST
    assert len(chunks[-1]) == 1


@pytest.fixture(scope="module")
def run():
    labels = {"height": np.linspace(0.5, 2.0, 6), "colour": list("abcdef")}
    return deli.simulate_ensemble(pogo_sticks(), deli.GVI(), step_size=0.1, steps=5, every=2, labels=labels)


class TestTree:
    def test_members_come_first_and_are_labelled(self, run):
        assert run["trajectory"]["position"].dims == ("member", "time", "dof")
        assert run["solver_stats"]["solves"].dims == ("member", "step", "subproblem")
        for group in run.children:
            assert run[group].sel(member=3)["height"] == run["height"][3]
        np.testing.assert_array_equal(run["trajectory"]["time"], [0.0, 0.2, 0.4, 0.5])
        np.testing.assert_array_equal(run["member"], np.arange(6))
        np.testing.assert_array_equal(run["steps_taken"], 5)

    def test_members_may_have_names(self):
        run = deli.simulate_ensemble(pogo_sticks(2), deli.GVI(), step_size=0.1, steps=1, labels={"member": ["a", "b"]})
        assert run["trajectory"]["position"].sel(member="b").shape == (2, 2)

    def test_the_config_is_what_members_share(self, run):
        scene = tomllib.loads(run.attrs["config"])["scene"]
        assert scene["label"] == "6 x pogo_stick"
        assert scene["parameters"]["stiffness"] == 10.0
        assert scene["momentum"] == [0.0, 0.0]
        assert "position" not in scene

    def test_conserved_momenta_are_those_of_all_members(self, run):
        assert run.attrs["conserved_linear_momentum"] == "none"
        scenes = kicked(deli.scenes.newtons_cradle(balls=3), count=2)
        kin = deli.simulate_ensemble(scenes, deli.GVI(), step_size=0.01, steps=1)
        alone = deli.simulate(scenes[0], deli.GVI(), step_size=0.01, steps=1)
        assert kin.attrs["conserved_linear_momentum"] == alone.attrs["conserved_linear_momentum"]

    def test_what_is_written_is_read(self, tmp_path):
        path = tmp_path / "many.nc"
        arguments = {"step_size": 0.1, "steps": 5, "labels": {"height": np.arange(6.0)}, "output": path}
        run = deli.simulate_ensemble(pogo_sticks(), deli.GVI(), **arguments)
        with xr.open_datatree(path, engine="netcdf4") as read:
            xr.testing.assert_equal(read.load(), run)
            assert read.attrs["config"] == run.attrs["config"]
        assert list(tmp_path.iterdir()) == [path]
        with pytest.raises(InputError, match="exists"):
            deli.simulate_ensemble(pogo_sticks(), deli.GVI(), **arguments)
        deli.simulate_ensemble(pogo_sticks(), deli.GVI(), overwrite=True, **arguments)


class TestEndings:
    @pytest.mark.filterwarnings("ignore")
    def test_a_member_that_fails_does_not_stop_the_others(self):
        scenes = failing(at=0.45)
        arguments = {"step_size": 0.1, "steps": 10, "every": 2}
        run = deli.simulate_ensemble(scenes, deli.GVI(), workers=2, **arguments)
        assert run["outcome"].values[2].startswith("failed in step")
        assert "ValueError: too far" in run["outcome"].values[2]
        assert (run["outcome"].values[[0, 1, 3, 4]] == "complete").all()
        assert run.attrs["outcome"] == "1 of 5 members failed"
        taken = int(run["steps_taken"][2])
        lost = run["trajectory"]["position"].isnull().all("dof").values
        np.testing.assert_array_equal(lost[2], np.arange(6) > taken // 2)
        assert not lost[[0, 1, 3, 4]].any()
        status = run["solver_stats"]["status"].values[2]
        assert (status[taken // 2 :] == 4).all()
        assert (run["solver_stats"]["skipped"].values[2, taken // 2 :] == 0).all()
        assert_member(run, 3, deli.simulate(scenes[3], deli.GVI(), **arguments))

    def test_an_interrupt_returns_what_there_is(self, tmp_path):
        scenes, path = pogo_sticks(4), tmp_path / "cut.nc"
        threading.Timer(0.5, lambda: signal.raise_signal(signal.SIGINT)).start()
        with pytest.raises(deli.Interrupted, match="interrupted by SIGINT with 0 of 4 members") as stopped:
            deli.simulate_ensemble(scenes, deli.GVI(), step_size=1e-3, steps=10**9, every=10**6, workers=2, output=path)
        run = stopped.value.run
        assert run.attrs["outcome"].startswith("interrupted")
        outcomes = run["outcome"].values
        assert sum(outcome.startswith("interrupted after step") for outcome in outcomes) == 2
        assert list(outcomes[2:]) == ["interrupted before step 1"] * 2
        assert run["trajectory"]["position"].isel(time=0).isnull().all("dof").values.tolist() == [
            False,
            False,
            True,
            True,
        ]
        assert path.exists()

    def test_no_thread_is_left(self):
        deli.simulate_ensemble(pogo_sticks(), deli.GVI(), step_size=0.1, steps=1, workers=3)
        time.sleep(0.0)
        assert not [thread for thread in threading.enumerate() if thread.name.startswith("deli")]


class TestRefusals:
    @pytest.mark.parametrize(
        ("scenes", "words"),
        [
            (deli.scenes.point_mass(), "scenes is Scene; pass a list"),
            ([], "scenes is empty"),
            ([deli.scenes.point_mass(), "ball"], "member 1 is 'ball'; expected a deli.Scene"),
            (
                [deli.scenes.point_mass(), deli.scenes.pogo_stick()],
                "member 1 has 2 bodies in dimension 1, member 0 has 1 in dimension 1",
            ),
        ],
    )
    def test_scenes_are_of_one_size(self, scenes, words):
        with pytest.raises(InputError, match=words):
            deli.simulate_ensemble(scenes, deli.GVI(), step_size=0.1, steps=1)

    @pytest.mark.parametrize("workers", [0, 1.5, True, "2"])
    def test_workers_are_counted(self, workers):
        with pytest.raises(InputError, match="workers is"):
            deli.simulate_ensemble(pogo_sticks(2), deli.GVI(), step_size=0.1, steps=1, workers=workers)

    @pytest.mark.parametrize("labels", [{"height": [1.0]}, {"height": 1.0}, {"position": [1.0, 2.0]}, {3: [1, 2]}])
    def test_labels_have_a_value_for_each_member_and_a_name_of_their_own(self, labels):
        with pytest.raises(InputError, match="labels: "):
            deli.simulate_ensemble(pogo_sticks(2), deli.GVI(), step_size=0.1, steps=1, labels=labels)

    def test_more_rows_than_memory(self):
        sticks = pogo_sticks(1) * 100_000
        with pytest.raises(InputError, match=r"100000 members of 100001 rows each need .* GB of memory, and"):
            deli.simulate_ensemble(sticks, deli.GVI(), step_size=0.1, steps=100_000)
