"""A study whose process is killed, and another that comes across it."""

import json
import subprocess
import sys
import time

import psutil
import tomli_w
from running import DONE, call, deli_process, refused
from study_cases import CRADLE

import deli
from deli.studies.expansion import load


def wait_until(what):
    deadline = time.monotonic() + 120
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_killed_study_is_continued_to_the_bit(folder):
    """Its workers notice, write their rows and end."""
    path = folder / "study.toml"
    path.write_text(tomli_w.dumps({"base": {**CRADLE, "steps": 1_200_000}, "cases": [{}]}))
    (case,) = load(path).cases
    partial = folder / "study" / "cases" / f"{case.digest}.nc.partial"
    process = deli_process("study", "study.toml", cwd=folder)
    try:
        wait_until(partial.exists)
        (worker,) = psutil.Process(process.pid).children()
        refused(call("study", "study.toml"), "is being written by another deli study")
        assert "unfinished" in call("study", "study.toml", "--dry-run").stdout
        time.sleep(0.2)
    finally:
        process.kill()
        process.communicate()
    wait_until(lambda: not worker.is_running())
    rows = deli.open_run(partial)["trajectory"].sizes["time"]
    assert 1 < rows < 1501
    assert json.loads((folder / "study" / "manifest.json").read_text())["runs"][case.digest]["state"] == "running"

    result = call("study", "study.toml")
    assert result.exit_code == DONE, result.output
    assert "(unfinished)" in result.stdout
    alone = [sys.executable, "-m", "deli", "run", partial.with_name(f"{case.digest}.toml"), "-o", "alone.nc", "-q"]
    subprocess.run(alone, cwd=folder, check=True)
    one, other = (deli.open_run(file)["trajectory"] for file in ("alone.nc", partial.with_suffix("")))
    assert one.to_dataset().identical(other.to_dataset())
