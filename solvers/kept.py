"""Compiled code on disk: in numba's own folders, or in a temporary folder if those cannot be used."""

import logging
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock
from numba import njit
from numba.core import config
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    NullCache,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
)
from numba.core.ccallback import CFunc
from numba.core.sigutils import normalize_signature

from solvers.code_folder import SETTING, SHARED

logger = logging.getLogger("solvers")


def kept(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile the decorated function at its first call from Python, or load it from disk; see `numba.njit`."""

    def build(function: Callable[..., Any]) -> Any:
        dispatcher = njit(**options)(function)
        dispatcher._cache = cache_of(function)
        return dispatcher

    return build


def kept_callback(function: Callable[..., Any], signature: Any, pipeline: Any, **options: Any) -> Any:
    """Compile a function for calls by its address, or load it from disk; see `numba.cfunc`."""
    callback: Any = CFunc(function, normalize_signature(signature), {}, options, pipeline_class=pipeline)
    callback._cache = cache_of(function)
    callback.compile()
    return callback


def cache_of(function: Callable[..., Any]) -> Any:
    """Return the cache of a function's code; its `cache_path` is None if there is no folder for it."""
    try:
        return _Cache(function)
    except RuntimeError:  # which numba raises if there is no folder
        return NullCache()


def find_room(function: Callable[..., Any], size: int) -> Path | None:
    """Return a folder for the code of a function that has room for `size` bytes; None if there is none."""
    cache = cache_of(function)
    if cache.cache_path is None:
        return None
    try:
        _fill(cache.cache_path, size)
    except OSError as error:
        if isinstance(cache.locator, _Shared):
            return None
        _go_apart(f"{cache.cache_path} has no room for compiled code ({error.strerror})")
        return find_room(function, size)
    return Path(cache.cache_path)


def _fill(folder: str, size: int) -> None:
    os.makedirs(folder, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(os.urandom(size))  # random, because some file systems compress


class _Shared(UserWideCacheLocator):
    """The temporary folder, if this process, its parent or one of its children has made it."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        self._cache_path = os.path.join(os.environ[SHARED], self.get_suitable_cache_subpath(file))

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> Any:
        return super().from_function(function, file) if os.path.isdir(os.environ[SHARED]) else None


class _Temporary(_Shared):
    """The temporary folder as the last resort, made when it is needed."""

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> Any:
        _go_apart(f"{_setting()} cannot be written to" if config.CACHE_DIR else "no folder can be written to")
        return super().from_function(function, file)


class _Places(CompileResultCacheImpl):
    _locator_classes = [_Shared, *CompileResultCacheImpl._locator_classes, _Temporary]  # noqa: RUF012

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        if config.CACHE_DIR and not isinstance(self.locator, UserProvidedCacheLocator | _Shared):
            _tell(f"{_setting()} cannot be written to: compiled code is kept in {self.locator.get_cache_path()}")
            os.environ.pop(SETTING, None)  # children would repeat the message
            config.CACHE_DIR = ""


class _Cache(FunctionCache):
    """Numba's cache, which moves to the temporary folder if a file cannot be read or written."""

    _impl_class = _Places
    _lock: BaseFileLock | None = None

    @property
    def locator(self) -> Any:
        return self._impl.locator

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the code on disk, or None; then other processes wait for `save_overload`, and find it there."""
        found = self._load(signature, context)
        if found is None and self._acquire():
            found = self._load(signature, context)
            if found is not None:
                self._release()
        return found

    def save_overload(self, signature: Any, code: Any) -> None:
        """Put code on disk, for the processes that wait as well."""
        try:
            super().save_overload(signature, code)
        except OSError as error:
            if self._leave("written", error):
                self.save_overload(signature, code)
        finally:
            self._release()

    def _load(self, signature: Any, context: Any) -> Any:
        try:
            return super().load_overload(signature, context)
        except OSError as error:
            self._leave("read", error)
            return None

    def _acquire(self) -> bool:
        """Wait for another process that compiles the function; nobody can be waited for without a folder."""
        try:
            os.makedirs(self.cache_path, exist_ok=True)
            lock = FileLock(os.path.join(self.cache_path, f"{self._impl.filename_base}.lock"))
            lock.acquire()
        except OSError:
            return False
        self._lock = lock
        return True

    def _release(self) -> None:
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _leave(self, verb: str, error: OSError) -> bool:
        """Move to the temporary folder and return True; if that is impossible, keep no code and return False."""
        if not isinstance(self.locator, _Shared):
            _go_apart(f"a file in {self.cache_path} cannot be {verb} ({error.strerror})")
            if os.path.isdir(os.environ[SHARED]):
                super().__init__(self._py_func)
                return True
        self.disable()
        return False


def _setting() -> str:
    return f"{SETTING} is {config.CACHE_DIR}, which"


def _go_apart(why: str) -> None:
    """Make the temporary folder, and log a message."""
    try:
        os.mkdir(os.environ[SHARED], 0o700)
    except FileExistsError:
        return
    except OSError:
        place = "memory only, as there is no temporary folder either"
    else:
        place = "a temporary folder until this process ends"
    _tell(f"{why}: compiled code is in {place}; set {SETTING} to a folder that can keep it")


@cache
def _tell(message: str) -> None:
    """Log a message once."""
    logger.warning(message)
