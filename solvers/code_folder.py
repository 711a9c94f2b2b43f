"""The temporary folder for compiled code, of a process and all its children: named at once, and made at need."""

import atexit
import os
import secrets
import shutil
import tempfile

SETTING, SHARED = "NUMBA_CACHE_DIR", "DELI_TEMPORARY_CODE"
"""Variables of the environment: the folder that users choose, and the temporary one, empty where there can be none."""


def reserve() -> None:
    """Name the folder, unless a parent has, and remove it when this process ends."""
    if SHARED in os.environ:
        return
    try:
        os.environ[SHARED] = os.path.join(tempfile.gettempdir(), f"deli-code-{secrets.token_hex(8)}")
    except OSError:
        os.environ[SHARED] = ""
    else:
        atexit.register(_remove, os.environ[SHARED], os.getpid())


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:  # and no fork of it
        shutil.rmtree(folder, ignore_errors=True)
