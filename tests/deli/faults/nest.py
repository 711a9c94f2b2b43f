"""Processes of deli's command line that begin at once: forked from one that has loaded everything.

Run as a program, this is that process: it takes orders as lines of JSON, and says of each the process that carries it
out, and how that ended.
"""

import json
import os
import resource
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

WARM_UP = (
    ["run", "newtons_cradle", "--set", "scene.balls=3", "--set", "steps=3", "-o", "warm.nc", "-q"],
    ["animate", "warm.nc", "-q", "--dpi", "20"],
    ["check", "warm.nc"],
)


@dataclass(frozen=True)
class Ended:
    """How a command ended: its exit status (a signal's number, negative), and what it said."""

    status: int
    out: str
    err: str


class Nest:
    """Begins commands in the current folder; what they say goes to one of its own.

    Options of an order: `kill_at`, the line of the writer at which the process kills itself; `file_size`, bytes that a
    file may have; `block_rows`, rows after which they are committed, as soon as they are there; `most_chunks`, chunks
    after which a file needs longer ones.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=folder
        )
        assert self._process.stdout.readline() == "ready\n"

    def close(self) -> None:
        self._process.communicate("", timeout=60)

    def start(self, *arguments: object, **options: int) -> int:
        """Begin a command; returns its process."""
        return int(self._ask(begin=[str(argument) for argument in arguments], folder=os.getcwd(), **options))

    def end(self, pid: int) -> Ended:
        """Wait until a command has ended."""
        said = self._folder / f"{pid}.out", self._folder / f"{pid}.err"
        status = int(self._ask(end=pid))  # one that was killed at once has not made these files yet
        ended = Ended(status, *(file.read_text() if file.exists() else "" for file in said))
        for file in said:
            file.unlink(missing_ok=True)
        return ended

    def call(self, *arguments: object, **options: int) -> Ended:
        """Carry out a command."""
        return self.end(self.start(*arguments, **options))

    def _ask(self, **order: object) -> str:
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, "the process that begins others has died"
        return answer


def serve() -> None:
    from deli.cli import app

    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what commands print is no answer
    for warm_up in WARM_UP:  # imports and compiles what commands need
        app(warm_up, standalone_mode=False)
    print("ready", file=answers, flush=True)
    for line in sys.stdin:
        order = json.loads(line)
        if "end" in order:
            answer = os.waitstatus_to_exitcode(os.waitpid(order["end"], 0)[1])
        else:
            answer = os.fork()
            if answer == 0:
                _carry_out(**order)
        print(answer, file=answers, flush=True)


def _carry_out(begin, folder, kill_at=0, file_size=0, block_rows=0, most_chunks=0):
    os.setpgid(0, 0)
    for descriptor, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(f"{os.getpid()}.{name}", os.O_WRONLY | os.O_CREAT), descriptor)
    os.chdir(folder)
    status = 255
    try:
        from deli.cli import app
        from deli.recording import chunks
        from deli.running import session

        if block_rows:
            session.BLOCK_ROWS, session.FLUSH_SECONDS, session.REFRESH_SECONDS = block_rows, 0.0, 0.0
        if most_chunks:
            chunks.MOST_CHUNKS = most_chunks
        if file_size:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))
        if kill_at:
            _kill_at(kill_at)
        app(begin)
    except SystemExit as end:
        status = end.code or 0
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _kill_at(number):
    """Kill this process before the n-th line of what writes a run."""
    from deli.recording import chunks, netcdf

    writing, count = {netcdf.__file__, chunks.__file__}, 0

    def trace(frame, event, _):
        nonlocal count
        if frame.f_code.co_filename not in writing:
            return None
        count += event == "line"
        if count == number:
            os.kill(os.getpid(), signal.SIGKILL)
        return trace

    sys.settrace(trace)


if __name__ == "__main__":
    serve()
