"""A process that carries out command lines given to it one after the other, and tells what became of each.

It runs the entry point of the `deli` command in place, so that a thousand of them take seconds, with a limit on its
memory: what allocates more than the limit fails where it is seen.
"""

import contextlib
import importlib
import io
import json
import os
import pickle
import resource
import socket
import subprocess
import sys
import traceback
from pathlib import Path

WARM_UP = [
    ["run", "newtons_cradle", "--set", "steps=2", "-o", "warm.nc"],
    ["run", "point_mass", "--set", "steps=2", "--set", "scene.masss=1", "--dry-run"],
    ["run", "point_mass", "--dry-run", "--set", "solvers=osqp"],
    ["study", "none.toml"],
]
WATCHED = (
    "exec", "compile", "import", "pickle.find_class", "marshal.load", "marshal.loads", "os.system", "os.exec",
    "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "subprocess.Popen", "ctypes.dlopen", "socket.connect",
    "socket.bind", "os.symlink", "os.link", "shutil.rmtree", "urllib.Request", "webbrowser.open",
)  # fmt: skip
MODULE = "tabnanny"
ACTS = {
    "eval": lambda: eval("1 + 1"),
    "exec": lambda: exec("1 + 1"),
    "import": lambda: __import__(MODULE),
    "import_module": lambda: importlib.import_module(MODULE),
    "unpickle": lambda: pickle.loads(b"cos\nsystem\n."),
    "system": lambda: os.system("true"),
    "popen": lambda: subprocess.run(["true"], check=True),
    "write": lambda: open("pwned", "w").close(),
    "connect": lambda: socket.socket().connect(("localhost", 1)),
}
"""What a config must not make deli do, done on purpose."""
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


events: list[tuple[str, str]] | None = None


def listen(event: str, arguments: tuple[object, ...]) -> None:
    """Note what Python is about to do, where someone wants to know."""
    if events is None:
        return
    writes = False
    if event == "open":
        _, mode, flags = arguments
        writes = bool(set(mode or "") & set("wax+")) or bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
    if writes or event in WATCHED:
        events.append((event, repr(arguments[:1])[:200]))


def main(memory: int) -> None:
    """Answer lines of JSON on standard input: a folder and arguments in, what happened out."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1, encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    sys.addaudithook(listen)
    for arguments in WARM_UP:
        carry_out(arguments)
    Path("warm.nc").unlink()
    size = int(STATUS.read_text().split("VmSize:")[1].split()[0]) * 1024
    resource.setrlimit(resource.RLIMIT_AS, (size + memory, resource.RLIM_INFINITY))
    answers.write(json.dumps({"ready": True}) + "\n")
    for line in sys.stdin:
        order = json.loads(line)
        os.chdir(order["folder"])
        answers.write(
            json.dumps(watch(order["arguments"]) if order["watched"] else carry_out(order["arguments"])) + "\n"
        )


def watch(arguments: list[str]) -> dict[str, object]:
    """Run one command, and say also what Python told of it."""
    global events
    events = []
    try:
        if arguments[0] == "--act":
            with contextlib.suppress(Exception):
                sys.modules.pop(MODULE, None)
                ACTS[arguments[1]]()
            return {"events": events}
        return {**carry_out(arguments), "events": events}
    finally:
        events = None


def carry_out(arguments: list[str]) -> dict[str, object]:
    """Run one command; say its exit status, what it printed, and how much memory it took at its peak, in bytes."""
    from deli.cli import main as deli

    streams = [io.TextIOWrapper(io.BytesIO(), "utf-8", errors) for errors in ("strict", "backslashreplace")]
    sys.argv, fault, status = ["deli", *arguments], "", 0
    RESET.write_text("5")  # the peak begins anew
    before = _kilobytes("VmRSS")
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        try:
            deli()
        except SystemExit as stop:
            status = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        except BaseException:  # whatever it is, it is what the test looks for
            fault = traceback.format_exc()
    output, errors = (stream.buffer.getvalue().decode("utf-8") for stream in map(_flushed, streams))
    grown = 1024 * (_kilobytes("VmHWM") - before)
    return {"status": status, "output": output, "errors": errors, "fault": fault, "grown": grown}


def _kilobytes(name: str) -> int:
    return int(STATUS.read_text().split(f"{name}:")[1].split()[0])


def _flushed(stream: io.TextIOWrapper) -> io.TextIOWrapper:
    stream.flush()
    return stream


if __name__ == "__main__":
    main(int(sys.argv[1]))
