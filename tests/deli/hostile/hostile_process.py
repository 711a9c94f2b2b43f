"""The other end of `hostile_child.py`: what tests of hostile input hold in their hands."""

import contextlib
import json
import queue
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

CHILD = Path(__file__).with_name("hostile_child.py")
MEMORY = 1_500_000_000
START_SECONDS = 300.0
"""The first one on a machine compiles."""
CASE_SECONDS = 600.0
"""Guards against a hang and measures nothing: a case takes milliseconds, or the compilation of a program."""


@dataclass(frozen=True)
class Outcome:
    """What became of a command: exit status, what it printed, the traceback of what it raised, memory at its peak.

    `events` are what Python told of it, as audit hooks are told, where that was asked for.
    """

    status: int = 0
    output: str = ""
    errors: str = ""
    fault: str = ""
    grown: int = 0
    events: tuple[tuple[str, str], ...] = ()


class Victim:
    """Carries out command lines in a process of limited memory."""

    def __init__(self, folder: Path) -> None:
        self._errors = folder / "stderr"
        with self._errors.open("w") as errors:
            self._process = subprocess.Popen(
                [sys.executable, CHILD, str(MEMORY)],
                cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True,
            )  # fmt: skip
        self._answers: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        assert self._next(START_SECONDS) == {"ready": True}

    def run(self, folder: Path, *arguments: object, watched: bool = False) -> Outcome:
        """Run `deli` with arguments in a folder, or what the child acts out on purpose."""
        order = {"folder": str(folder), "arguments": [str(argument) for argument in arguments], "watched": watched}
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return Outcome(**self._next(CASE_SECONDS))

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        self._process.stdout.close()
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()

    def _read(self) -> None:
        for line in self._process.stdout:
            self._answers.put(line)
        self._answers.put("")

    def _next(self, seconds: float) -> dict:
        try:
            line = self._answers.get(timeout=seconds)
        except queue.Empty:
            self.close()
            raise AssertionError(f"no answer in {seconds:g} s") from None
        if not line:
            died = f"the process died with status {self._process.wait()}: {self._errors.read_text()[-2000:]}"
            raise AssertionError(died)
        return json.loads(line)
