"""Studies on a Dask cluster: the same runs to the bit, whatever becomes of its workers."""

import json
import os
import signal
import subprocess
import sys

import pytest
from running import call, refused
from study_cases import SEEDS, Watch, assert_same_runs, interrupt, recorded, run

PROGRAM = """
import json, sys
from distributed import LocalCluster
if __name__ == "__main__":
    options = dict(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with LocalCluster(**options) as cluster:
        print(json.dumps([cluster.scheduler_address, [nanny.pid for nanny in cluster.workers.values()]]), flush=True)
        sys.stdin.read()
"""


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Address of a scheduler with two workers, and the workers' processes."""
    script = tmp_path_factory.mktemp("cluster") / "cluster.py"
    script.write_text(PROGRAM)
    process = subprocess.Popen(
        [sys.executable, script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    yield json.loads(process.stdout.readline())
    process.communicate("", timeout=60)
    assert process.returncode == 0


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    folder = tmp_path_factory.mktemp("local")
    run(folder, SEEDS)
    return recorded(folder)


def test_limits_and_interruptions_hold_there_too(folder, cluster, local):
    address, _ = cluster
    endless = {"label": "endless", "steps": 10**9, "record.every": 10**6}
    limited = {"base": SEEDS["base"], "cases": [endless, {"steps": 300}], "limits": {"time": 3.0}}
    assert run(folder, limited, address=address).states == {"timed out": 1, "done": 1}
    stopped = folder / "stopped"
    stopped.mkdir()
    first = run(stopped, SEEDS, address=address, watcher=Watch(interrupt))
    assert first.stopped == "SIGINT"
    assert first.states["interrupted"] >= 1
    assert run(stopped, SEEDS, address=address).states == {"done": 2}
    assert_same_runs(recorded(stopped), local)


def test_a_killed_worker_changes_no_bit(folder, cluster, local):
    address, workers = cluster
    watch = Watch(lambda: os.kill(workers[0], signal.SIGKILL))
    assert run(folder, SEEDS, address=address, watcher=watch).states == {"done": 2}
    assert [what for what, _, _ in watch.log].count("started") == 3
    assert_same_runs(recorded(folder), local)


def test_a_scheduler_that_is_not_there_is_refused(folder, monkeypatch):
    monkeypatch.setattr("deli.studies.cluster.CONNECT_SECONDS", 0.5)
    (folder / "study.toml").write_text('base.scene = "point_mass"\naxes.scene.mass = [1.0]\n')
    refused(call("study", "study.toml", "--scheduler", "tcp://127.0.0.1:9"), "no Dask scheduler answers")


def test_a_missing_extra_is_named(folder):
    (folder / "study.toml").write_text('base.scene = "point_mass"\naxes.scene.mass = [1.0]\n')
    code = (
        "import sys; sys.modules['distributed'] = None; from deli.cli import app; "
        "app(['study', 'study.toml', '--scheduler', 'tcp://127.0.0.1:9'])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert found.returncode == 2
    assert "pip install '.[distributed]'" in found.stderr
