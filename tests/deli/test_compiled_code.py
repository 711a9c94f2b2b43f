"""An installation that cannot be written to, and no home: everything runs, and kernels are compiled once for all."""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

STUDY = """
base = { scene = "point_mass", step_size = 0.01, steps = 5 }
axes = { step_size = [0.01, 0.02] }
"""
CODE = """
import os, subprocess, sys
from pathlib import Path
import deli, solvers

def made():
    return {path: path.stat().st_mtime_ns for path in Path(os.environ["DELI_TEMPORARY_CODE"]).rglob("*.nbc")}

subprocess.run([sys.executable, "-B", "-m", "deli", "study", "two.toml"], check=True, stdout=subprocess.DEVNULL)
before, arguments = made(), {"step_size": 0.01, "steps": 3}
print(deli.simulate(deli.scenes.point_mass(), deli.GVI(), **arguments).attrs["outcome"])
print(deli.simulate_ensemble([deli.scenes.point_mass()] * 2, deli.GVI(), **arguments).attrs["outcome"])
print(len(before) > 5, before == made(), os.environ["DELI_TEMPORARY_CODE"])
"""


def test_everything_runs_where_nothing_can_be_written_to(tmp_path):
    site, work = tmp_path / "site", tmp_path / "work"
    work.mkdir()
    for package in ("deli", "solvers"):
        origin = Path(find_spec(package).origin).parent
        shutil.copytree(origin, site / package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [path for path in site.rglob("*") if path.is_dir()]:
        (folder / "__pycache__").touch()  # in the way, of the superuser too
    (work / "two.toml").write_text(STUDY)
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA", "XDG", "DELI"))}
    homeless = {"HOME": "/proc/none", "XDG_CACHE_HOME": "/proc/none/cache", "MPLCONFIGDIR": str(tmp_path)}
    environment = kept | homeless | {"PYTHONPATH": str(site)}
    command = [sys.executable, "-B", "-c", CODE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=work)
    assert done.returncode == 0, done.stderr
    *outcomes, told = done.stdout.splitlines()
    assert outcomes == ["complete", "complete"]
    many, same, folder = told.split()
    assert (many, same) == ("True", "True")
    assert not Path(folder).exists()
    said = done.stderr.splitlines()
    assert len(said) == 2
    assert "compiled code is in a temporary folder" in said[0]  # said by a worker, and passed on
    assert said[1].startswith("deli: compiling deli")
