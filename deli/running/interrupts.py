"""Stops of a run between two steps instead of in the middle of one."""

import _thread
import math
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

SIGNALS = (signal.SIGINT, signal.SIGTERM)
PATIENCE_SECONDS = 5.0
"""Seconds after a signal in which a step may go on to its end."""


class Interrupted(KeyboardInterrupt):
    """The stop of a run by a signal, such as Ctrl-C.

    Attributes
    ----------
    run : xarray.DataTree
        All rows up to the stop.

    Examples
    --------
    A mass falls, and its force raises the signal of Ctrl-C on the way:

    >>> import signal
    >>> import deli
    >>> def gradient(q):
    ...     if 0.89 < q[0] < 0.897:
    ...         signal.raise_signal(signal.SIGINT)
    ...     return [9.8]
    >>> weight = deli.Potential(energy=lambda q: 9.8 * q[0], gradient=gradient)
    >>> fall = deli.Scene(mass=1.0, position=[1.0], momentum=[0.0], potential=weight)
    >>> try:
    ...     run = deli.simulate(fall, deli.DiscreteSmooth("midpoint"), step_size=0.01, steps=1_000_000, every=1000)
    ... except deli.Interrupted as stop:
    ...     run = stop.run
    >>> run.attrs["outcome"].split(" after ")[0]
    'interrupted by SIGINT'
    """

    def __init__(self, message: str, run: "xr.DataTree") -> None:
        super().__init__(message)
        self.run = run


class StopRequests:
    """A context in which SIGINT and SIGTERM ask for a stop after the current step; a second signal stops at once.

    Work that must not be left half done is not stopped by the second signal either, see `undisturbed`.

    Signals reach Python's main thread only: in any other thread the context does nothing. Python code and its sleep can
    be stopped in the middle; a call of a library in C cannot, not even by the second signal.

    Parameters
    ----------
    patience : float
        Seconds after which the first signal acts like a second one.

    Attributes
    ----------
    reason : str or None
        Name of the signal that asked for a stop, or None.
    """

    def __init__(self, patience: float = math.inf) -> None:
        self.reason: str | None = None
        self._disturbing = True
        self._patience, self._over, self._lock = patience, False, threading.Lock()
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> "StopRequests":
        if threading.current_thread() is threading.main_thread():
            self._previous = {number: signal.signal(number, self._handle) for number in SIGNALS}
        return self

    def __exit__(self, *exception: object) -> None:
        self._over = True
        with self._lock:  # from here on no signal of our own can reach the earlier handlers
            pass
        for number, handler in self._previous.items():
            # None stands for a handler that was not installed by Python and cannot be put back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Keep signals from stopping the work in this context."""
        before, self._disturbing = self._disturbing, False
        try:
            yield
        finally:
            self._disturbing = before

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.reason is None:
            self.reason = signal.Signals(number).name
            if self._patience < math.inf:
                _thread.start_new_thread(self._lose_patience, (number,))  # takes no lock that this thread may hold
        elif self._disturbing and not self._over:
            raise KeyboardInterrupt

    def _lose_patience(self, number: int) -> None:
        time.sleep(self._patience)
        with self._lock:
            if self._over:
                return
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(threading.main_thread().ident or 0, number)
            else:  # without pthread_kill a sleep is not broken off
                _thread.interrupt_main(signal.Signals(number))
