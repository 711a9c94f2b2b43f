"""The temporary folder for compiled code of a process and its children: named at import, and made when it is needed."""

import atexit
import os
import secrets
import shutil
import tempfile

SETTING, SHARED = "NUMBA_CACHE_DIR", "DELI_TEMPORARY_CODE"
"""Variables of the environment: the folder that users choose, and the temporary one; empty if none can be made."""


def reserve() -> None:
    """Name the folder, unless a parent process has named it, and remove it when this process ends."""
    if SHARED in os.environ:
        return
    try:
        os.environ[SHARED] = os.path.join(tempfile.gettempdir(), f"deli-code-{secrets.token_hex(8)}")
    except OSError:
        os.environ[SHARED] = ""
    else:
        atexit.register(_remove, os.environ[SHARED], os.getpid())


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:  # not in a fork
        shutil.rmtree(folder, ignore_errors=True)
