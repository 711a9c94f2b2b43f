"""Systems without POSIX: everything runs in memory."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import deli

ROOT = Path(deli.__file__).parents[1]
SOURCES = sorted(path for package in ("deli", "solvers") for path in (ROOT / package).rglob("*.py"))
MODULES = {"crypt", "curses", "fcntl", "grp", "nis", "posix", "pty", "pwd", "readline", "resource", "spwd", "syslog"}
MODULES |= {"termios", "tty"}
CALLS = {
    "os": {
        "fork", "forkpty", "getgid", "geteuid", "getuid", "killpg", "mkfifo", "nice", "posix_fallocate", "posix_spawn",
        "pread", "pwrite", "sched_getaffinity", "setpgid", "setsid", "statvfs", "sync", "uname", "wait", "waitid",
        "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "WNOHANG",
    },
    "signal": {
        "SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGSTOP", "SIGUSR1", "SIGUSR2", "SIGXCPU",
        "alarm", "pause", "pthread_kill", "pthread_sigmask", "setitimer", "siginterrupt", "sigtimedwait", "sigwait",
    },
}  # fmt: skip
"""What Windows has not, of the modules that it has."""
BEHIND_AN_IMPORT = {("apart.py", "alarm")}
"""Calls that are reached only where a module of POSIX has been imported."""

BLOCKED = ("fcntl", "resource", "pwd", "grp", "termios")
WITHOUT = f"""
import os, signal, sys
import psutil  # which imports what it needs of the system that it is on
for name in {BLOCKED}:
    sys.modules[name] = None  # so that its import fails
for module, names in ((os, ("posix_fallocate", "sched_getaffinity")), (signal, ("alarm", "pthread_kill"))):
    for name in names:
        delattr(module, name)
import deli
arguments = {{"method": deli.GVI(), "step_size": 0.01, "steps": 20}}
"""


def python(code, folder):
    return subprocess.run([sys.executable, "-c", WITHOUT + code], cwd=folder, capture_output=True, text=True)


def test_in_memory_everything_runs_without_posix(tmp_path):
    found = python(
        """
scene = deli.scenes.newtons_cradle(balls=3)
run = deli.simulate(scene, solvers="daqp", skip=False, subproblems=True, **arguments)
assert run.attrs["outcome"] == "complete" and run["trajectory"].sizes["time"] == 21
assert deli.simulate_ensemble([scene] * 2, output="members.nc", **arguments).sizes["member"] == 2
deli.plotting.history(run), deli.plotting.trajectory(run), deli.metrics.measure(run)
run.to_netcdf("run.nc")
assert deli.open_run("run.nc")["trajectory"].identical(run["trajectory"])
for name in deli.__all__:
    getattr(deli, name)
print("done")
""",
        tmp_path,
    )
    assert (found.returncode, found.stdout) == (0, "done\n"), found.stderr


def test_a_signal_ends_a_run_in_memory_without_posix(tmp_path):
    found = python(
        """
import threading, time
from deli.running.interrupts import StopRequests
with StopRequests(patience=0.2) as stop:
    try:
        signal.raise_signal(signal.SIGINT)
        while True:
            time.sleep(0.01)
    except KeyboardInterrupt:
        print(stop.reason)
""",
        tmp_path,
    )
    assert (found.returncode, found.stdout) == (0, "SIGINT\n"), found.stderr


@pytest.mark.parametrize("command", ["simulate", "run"])
def test_recording_to_a_file_is_refused_in_one_sentence_without_posix(tmp_path, command):
    code = {
        "simulate": """
try:
    deli.simulate(deli.scenes.point_mass(), output="run.nc", **arguments)
except deli.InputError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
""",
        "run": """
from deli.cli import app
app(["run", "point_mass", "--set", "steps=3", "-o", "run.nc"])
""",
    }
    found = python(code[command], tmp_path)
    assert found.returncode == 2, found.stderr
    assert "output run.nc: runs are recorded to files on POSIX systems only" in found.stderr.splitlines()[-1]
    assert not list(tmp_path.iterdir())


def guarded(tree):
    """Nodes that may be missing: in functions, and where a failing import is taken care of."""
    for node in ast.walk(tree):
        caught = isinstance(node, ast.Try) and any(
            isinstance(handler.type, ast.Name) and handler.type.id == "ImportError" for handler in node.handlers
        )
        if caught or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from ast.walk(node)


def imported(node):
    names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
    return {name.partition(".")[0] for name in names}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_module_needs_posix_to_be_imported(path):
    text = path.read_text()
    tree = ast.parse(text)
    excused = set(guarded(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) and node not in excused:
            assert not imported(node) & MODULES, f"line {node.lineno}"
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            owner, name = node.value.id, node.attr
            if name in CALLS.get(owner, ()) and (path.name, name) not in BEHIND_AN_IMPORT:
                assert f'hasattr({owner}, "{name}")' in text, f"{owner}.{name} in line {node.lineno}"


def test_what_the_search_looks_for_it_finds():
    tree = ast.parse(
        "import fcntl\ntry:\n    import pwd\nexcept ImportError:\n    pwd = None\ndef f():\n    import grp"
    )
    excused = set(guarded(tree))
    found = [node for node in ast.walk(tree) if isinstance(node, ast.Import) and node not in excused]
    assert [imported(node) for node in found] == [{"fcntl"}]
