"""Where compiled code is kept: found again by later processes, and by children only where nothing can be written to."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULE = """
from solvers.kept import kept

@kept()
def double(x):
    return 2.0 * x
"""
CALL = """
import os, subprocess, sys
import small
assert small.double(1.5) == 3.0
folder = os.environ["DELI_TEMPORARY_CODE"]
print(sum(small.double.stats.cache_hits.values()), folder if os.path.exists(folder) else None)
"""
TOGETHER = """
import small
print(flush=True)
input()
assert small.double(1.5) == 3.0
print(sum(small.double.stats.cache_misses.values()))
"""
PARENT = CALL + "sys.stdout.flush(); subprocess.run([sys.executable, '-c', {call!r}], check=True)"


@pytest.fixture
def package(tmp_path):
    """A module with one function, where a file is in the way of the folder for compiled code."""
    (tmp_path / "small.py").write_text(MODULE)
    (tmp_path / "__pycache__").touch()
    return tmp_path


def run(package, code=CALL, **variables):
    """What a process says that has no home: hits of the cache and temporary folder by line, and standard error."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA", "XDG", "DELI"))}
    homeless = {"HOME": "/proc/none", "XDG_CACHE_HOME": "/proc/none/cache"}
    path = os.pathsep.join([str(package), str(ROOT)])
    environment = kept | homeless | {"PYTHONPATH": path} | variables
    done = subprocess.run([sys.executable, "-B", "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [tuple(line.split(" ", 1)) for line in done.stdout.splitlines()], done.stderr


def test_nowhere_to_write_to_is_said_once_and_children_share_a_folder_that_goes(package):
    (mine, childs), said = run(package, PARENT.format(call=CALL))
    assert (mine[0], childs[0]) == ("0", "1")  # compiled once
    assert mine[1] == childs[1]
    assert not Path(mine[1]).exists()
    assert said.count("\n") == 1
    assert "no folder can be written to: compiled code is in a temporary folder" in said
    assert "set NUMBA_CACHE_DIR" in said


def test_a_folder_that_users_choose_keeps_it(package, tmp_path):
    chosen = {"NUMBA_CACHE_DIR": str(tmp_path / "chosen")}
    assert run(package, **chosen) == ([("0", "None")], "")
    assert run(package, **chosen) == ([("1", "None")], "")


def test_a_chosen_folder_that_cannot_be_written_to_is_named(package, tmp_path):
    (tmp_path / "chosen").touch()
    chosen = {"NUMBA_CACHE_DIR": str(tmp_path / "chosen")}
    (mine, childs), said = run(package, PARENT.format(call=CALL), **chosen)
    assert (mine[0], childs[0]) == ("0", "1")
    assert said.count("\n") == 1
    assert f"NUMBA_CACHE_DIR is {tmp_path / 'chosen'}, which cannot be written to" in said
    (package / "__pycache__").unlink()
    (mine, childs), said = run(package, PARENT.format(call=CALL), **chosen)
    assert (mine, childs) == (("0", "None"), ("1", "None"))
    assert said.count("\n") == 1
    assert f"compiled code is kept in {package / '__pycache__'}" in said


@pytest.mark.parametrize("what", ["read", "written"])
def test_files_that_cannot_be_read_or_written(package, tmp_path, what):
    chosen = {"NUMBA_CACHE_DIR": str(tmp_path / "chosen")}
    run(package, **chosen)
    (index,) = (tmp_path / "chosen").rglob("*.nbi")
    (code,) = (tmp_path / "chosen").rglob("*.nbc")
    in_the_way = index if what == "read" else code
    in_the_way.unlink()
    in_the_way.mkdir()
    (mine, childs), said = run(package, PARENT.format(call=CALL), **chosen)
    assert (mine[0], childs[0]) == ("0", "1")
    assert mine[1] == childs[1] != "None"
    assert said.count("\n") == 1
    assert f"a file in {code.parent} cannot be {what} (" in said


def test_a_folder_without_room_is_left(package, tmp_path):
    """Where nothing of more than a kilobyte can be written, whatever the folder."""
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))\n"
    asked = CALL + "from solvers.kept import find_room; print(find_room(small.double.py_func, 5000), '-')"
    found, said = run(package, limit + asked, NUMBA_CACHE_DIR=str(tmp_path / "chosen"))
    assert found[1:] == [("None", "-")]
    assert said.count("\n") == 1
    assert re.search(r"a file in \S* cannot be written \(File too large\)", said)
    assert not Path(found[0][1]).exists()
    said_of_room = run(
        package,
        "import small\n" + limit + asked.replace(CALL, "") + "\n",
        NUMBA_CACHE_DIR=str(tmp_path / "chosen"),
    )[1]
    assert "has no room for compiled code (File too large)" in said_of_room


def test_no_temporary_folder_either(package):
    (mine, childs), said = run(package, PARENT.format(call=CALL), DELI_TEMPORARY_CODE="/proc/none/code")
    assert (mine, childs) == (("0", "None"), ("0", "None"))
    assert said.count("\n") == 2  # each process compiles by itself
    assert "compiled code is in memory only" in said


def test_nothing_is_kept_by_numba_alone():
    """It ends in a traceback where there is no place."""
    sources = [path for folder in ("deli", "solvers", "studies") for path in (ROOT / folder).rglob("*.py")]
    assert [path for path in sources if re.search(r"cache\s*=\s*True|enable_caching", path.read_text())] == []


def test_processes_that_miss_a_function_at_once_compile_it_once(package):
    (package / "__pycache__").unlink()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(package), str(ROOT)])}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    processes = [subprocess.Popen([sys.executable, "-c", TOGETHER], env=environment, **pipes) for _ in range(4)]
    for process in processes:
        process.stdout.readline()
    for process in processes:
        process.stdin.write("\n")
        process.stdin.flush()
    assert sorted(process.communicate()[0] for process in processes) == ["0\n", "0\n", "0\n", "1\n"]
    assert [process.returncode for process in processes] == [0, 0, 0, 0]
