"""Stopping a run between two steps instead of in the middle of one."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(KeyboardInterrupt):
    """A run was stopped from outside.

    Attributes
    ----------
    run : xarray.DataTree
        All rows until then.
    """

    def __init__(self, message: str, run: "xr.DataTree") -> None:
        super().__init__(message)
        self.run = run


class StopRequests:
    """While active, SIGINT and SIGTERM ask for a stop after the current step; a second signal stops at once.

    What must not be left half done is not stopped by the second either, see `patience`.

    Signals reach Python's main thread only: in any other thread this does nothing.

    Attributes
    ----------
    reason : str or None
        Name of the signal that asked, or None.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self._patient = 0
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> "StopRequests":
        if threading.current_thread() is threading.main_thread():
            self._previous = {number: signal.signal(number, self._handle) for number in SIGNALS}
        return self

    def __exit__(self, *exception: object) -> None:
        for number, handler in self._previous.items():
            # None stands for a handler that was not installed by Python and cannot be put back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)

    @contextmanager
    def patience(self) -> Iterator[None]:
        """Let no signal stop what is done in here."""
        self._patient += 1
        try:
            yield
        finally:
            self._patient -= 1

    def _handle(self, number: int, frame: FrameType | None) -> None:
        asked_before, self.reason = self.reason is not None, self.reason or signal.Signals(number).name
        if asked_before and not self._patient:
            raise KeyboardInterrupt
