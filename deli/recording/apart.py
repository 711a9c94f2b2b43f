"""Reading of a file that may be damaged, in another process: the netCDF library may crash on it, or never end."""

import json
import os
import signal
import subprocess
import sys
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from deli.errors import InputError
from deli.recording.contents import Contents, Stored, load, open_file

SECONDS, BYTES_A_SECOND = 60, 2_000_000
"""Limit on the processor time of a reading: `SECONDS`, and one more for every `BYTES_A_SECOND` bytes of the file."""
MEMORY, COPIES = 1 << 29, 4
"""Limit on the memory of a reading: `MEMORY` bytes, and `COPIES` times the bytes of the file."""

_CODE = "import sys; sys.path[:] = {path!r}; from deli.recording.apart import main; main({file!r}, {values!r})"


def load_apart(path: Path, values: bool) -> Contents:
    """Read a file in a process of its own, with limits on its time and memory; see `deli.recording.contents.load`.

    Raises
    ------
    InputError
        If the file cannot be read, or the process that reads it dies.
    """
    with subprocess.Popen(
        [sys.executable, "-c", _CODE.format(path=sys.path, file=os.fspath(path), values=values)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # the library prints its inner state there
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    ) as process:
        assert process.stdout is not None
        try:
            told, contents = _receive(process.stdout)
        except BaseException:
            process.kill()
            raise
    if "refused" in told:
        raise InputError(told["refused"])
    if contents is None or "end" not in told:
        status = process.returncode
        how = signal.Signals(-status).name if status < 0 else f"exit status {status}"
        raise InputError(f"{path} is damaged: the process that read it died ({how}).")
    return contents


def main(file: str, values: bool) -> None:
    """Read a file in a process of its own, and write its contents to standard output.

    A line of JSON describes the contents. The values of each variable follow a line with their number of bytes. The
    last line says that all was read, or why the file is refused.
    """
    path, output = Path(file), sys.stdout.buffer

    def say(**message: Any) -> None:
        output.write(json.dumps(message).encode() + b"\n")

    try:
        _limit(path.stat().st_size)
        with open_file(path, live=False) as dataset:
            parts = load(dataset, path, values)
            contents = next(parts)
            _require_toml(contents.attributes.get("config"), path)
            say(contents=_described(contents))
            for array in parts:
                say(bytes=array.nbytes)
                output.write(array.reshape(-1).view(np.uint8))
            say(end=True)
            output.flush()
            os._exit(0)  # without cleaning up: the library's memory may be damaged
    except InputError as error:
        say(refused=str(error))
    except FileNotFoundError:
        say(refused=f"{path} is no longer there; is another run writing it?")


def _limit(size: int) -> None:
    """Bound this process's time and memory, where the system can."""
    try:
        import resource
    except ImportError:  # Windows has no such limits
        return
    seconds = SECONDS + size // BYTES_A_SECOND
    signal.alarm(10 * seconds)  # of wall time
    limits = {resource.RLIMIT_CPU: seconds, resource.RLIMIT_AS: MEMORY + COPIES * size, resource.RLIMIT_CORE: 0}
    for kind, most in limits.items():
        with suppress(ValueError, OSError):  # a stricter limit is in force
            resource.setrlimit(kind, (most, most))


def _require_toml(config: Any, path: Path) -> None:
    """Refuse a config that cannot be read within this process's limits: processes without limits read it next."""
    try:
        tomllib.loads(config if isinstance(config, str) else "")
    except (ValueError, RecursionError, MemoryError) as error:
        raise InputError(f"{path} is damaged: its attribute config is not TOML ({type(error).__name__}).") from error


def _described(contents: Contents) -> dict[str, Any]:
    groups = {
        group: {
            name: [one.dims, one.values.dtype.str, one.values.shape, _plain(one.attributes)]
            for name, one in variables.items()
        }
        for group, variables in contents.groups.items()
    }
    return {"attributes": _plain(contents.attributes), "sizes": contents.sizes, "groups": groups}


def _plain(attributes: dict[str, Any]) -> dict[str, Any]:
    """Return attributes in the types of JSON; an array becomes its type and its values."""
    return {
        name: {"dtype": value.dtype.str, "values": value.tolist()} if isinstance(value, np.ndarray) else value
        for name, value in attributes.items()
    }


def _restored(attributes: dict[str, Any]) -> dict[str, Any]:
    return {
        name: np.array(value["values"], value["dtype"]) if isinstance(value, dict) else value
        for name, value in attributes.items()
    }


def _receive(stream: IO[bytes]) -> tuple[dict[str, Any], Contents | None]:
    """Read the output of `main`; return its last line, and the contents of the file."""
    told, contents, empty = _line(stream), None, []
    if "contents" in told:
        found = told["contents"]
        groups: dict[str, dict[str, Stored]] = {}
        for group, variables in found["groups"].items():
            groups[group] = {}
            for name, (dims, dtype, shape, attributes) in variables.items():
                values = np.empty(shape, np.dtype(dtype))
                groups[group][name] = Stored(tuple(dims), values, _restored(attributes))
                empty.append(values)
        contents = Contents(_restored(found["attributes"]), found["sizes"], groups)
        told = _line(stream)
    for values in empty:
        if told.get("bytes") != values.nbytes or stream.readinto(values.reshape(-1).view(np.uint8)) != values.nbytes:  # type: ignore[attr-defined]
            break
        told = _line(stream)
    return told, contents


def _line(stream: IO[bytes]) -> dict[str, Any]:
    line = stream.readline()
    return json.loads(line) if line.endswith(b"\n") else {}
