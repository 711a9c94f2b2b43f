import subprocess
import sys

import pytest

import deli
from solvers.registry import BUILTIN

HEAVY = {"cvxpy", "jax", "matplotlib", "netCDF4", "numba", "pandas", "pydantic", "scipy", "xarray"}
SOLVERS = {package for _, package in BUILTIN.values()}


def loaded(command):
    """Top-level packages that a fresh interpreter has loaded after `command`."""
    script = f"{command}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(found.stdout.splitlines()[-1].split())


def running(*arguments):
    return f"from deli.cli import app\napp({list(arguments)}, standalone_mode=False)"


def test_what_is_exported_exists():
    for name in deli.__all__:
        assert hasattr(deli, name), name


def test_a_stranger_called_solvers_is_named(tmp_path):
    stranger = tmp_path / "solvers.py"
    stranger.write_text("")
    found = subprocess.run([sys.executable, "-c", "import deli"], cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 1
    assert "ImportError: deli needs its own package 'solvers', but Python found another one first" in found.stderr
    assert str(stranger) in found.stderr


def test_a_stray_folder_called_solvers_is_named(tmp_path):
    (tmp_path / "solvers").mkdir()
    (tmp_path / "solvers" / "__init__.py").write_text("")
    found = subprocess.run([sys.executable, "-c", "import deli"], cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 1
    assert str(tmp_path / "solvers" / "__init__.py") in found.stderr


def test_importing_deli_loads_nothing_heavy():
    assert not loaded("import deli") & (HEAVY | SOLVERS | {"numpy", "rich", "solvers", "typer"})


def test_help_loads_nothing_heavy():
    assert not loaded(running("--help")) & (HEAVY | SOLVERS | {"numpy", "solvers"})


@pytest.mark.parametrize("command", ["scenes", "methods", "backends"])
def test_listing_loads_no_solver(command):
    # typer reads arguments with pydantic where that is installed.
    assert not loaded(running(command)) & (HEAVY | SOLVERS) - {"pydantic", "scipy"}


def test_each_name_is_found_first_and_again():
    script = "\n".join(
        f"first = deli.{name}\nfrom deli import {name}\nassert first is {name} is deli.{name}" for name in deli.__all__
    )
    subprocess.run([sys.executable, "-c", f"import deli\n{script}"], check=True)


def test_names_not_yet_used_are_listed():
    listed = "import deli\nassert set(deli.__all__) <= set(dir(deli))"
    subprocess.run([sys.executable, "-c", listed], check=True)


def test_a_wrong_name_is_refused():
    with pytest.raises(AttributeError, match="module 'deli' has no attribute 'simulator'"):
        deli.simulator  # noqa: B018
