"""Files that are written as a whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import xarray as xr

from deli.recording.contents import LIBRARY
from deli.recording.holding import RecordingError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the path of a new file beside `path`, which replaces `path` once it is written and on the disk.

    Raises
    ------
    RecordingError
        If the new file cannot be written; a file at `path` stays as it was.
    """
    fresh = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        yield fresh
        with fresh.open("rb+") as file:  # some systems flush only files that are open for writing
            os.fsync(file.fileno())
        os.replace(fresh, path)
    except OSError as error:
        raise RecordingError(f"{path} could not be written ({error}). Is the disk full, or the folder gone?") from error
    finally:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole, see `replacing`."""
    with replacing(path) as fresh:
        fresh.write_text(text, encoding="utf-8")


def write_tree(path: Path, data: xr.DataTree | xr.Dataset) -> None:
    """Write a netCDF file as a whole, see `replacing`."""
    with replacing(path) as fresh, LIBRARY:
        data.to_netcdf(fresh, engine="netcdf4")
