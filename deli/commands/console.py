"""The console of all commands, and their messages and exit statuses at failure."""

import functools
import io
import logging
import sys
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import typer
from rich.console import Console

from deli.errors import DeliError, InputError
from deli.kernels import LOGGERS

RUN_FAILED, INPUT_AT_FAULT = 1, 2
PLAIN_WIDTH = 120
LONGEST_MESSAGE = 4000

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def console() -> Console:
    """Return a console on standard output, without markup, and of a fixed width unless it is a terminal."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # file names may hold bytes that are not text
    terminal = sys.stdout.isatty()
    return Console(file=sys.stdout, highlight=False, markup=False, width=None if terminal else PLAIN_WIDTH)


def complain(message: object) -> None:
    """Print one message to standard error, on one line of bounded length.

    A message may quote a config: characters that cannot be printed, or that control the terminal, are printed as
    Python's escapes.
    """
    text = str(message)
    if len(text) > LONGEST_MESSAGE:
        half = LONGEST_MESSAGE // 2
        text = f"{text[:half]} ... {text[-half:]}"
    shown = text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    typer.echo(f"deli: {shown}", err=True)


class _Spoken(logging.Handler):
    """A handler that prints log messages like messages of commands."""

    def emit(self, record: logging.LogRecord) -> None:
        complain(record.getMessage())


_SPOKEN = _Spoken(logging.WARNING)


def guarded(command: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Turn deli's errors into one message and an exit status: 2 for errors of the input, 1 for errors of the run."""

    @functools.wraps(command)
    def wrapped(*args: Parameters.args, **keywords: Parameters.kwargs) -> Result:
        logging.getLogger("deli").addHandler(logging.NullHandler())  # commands report the end of a run themselves
        for name in LOGGERS:  # but not compilation, and the folder of compiled code
            logging.getLogger(name).addHandler(_SPOKEN)
        try:
            return command(*args, **keywords)
        except InputError as error:
            complain(error)
            raise typer.Exit(INPUT_AT_FAULT) from error
        except DeliError as error:
            complain(error)
            raise typer.Exit(RUN_FAILED) from error
        except OSError as error:
            complain(f"{error}. Is the disk full, or a folder gone or not writable?")
            raise typer.Exit(RUN_FAILED) from error
        except MemoryError as error:
            complain("memory ran out; close other programs, or take fewer bodies, rows or workers.")
            raise typer.Exit(RUN_FAILED) from error
        except KeyboardInterrupt as error:  # before a run began, or after it
            complain(str(error) or "stopped by SIGINT.")
            raise typer.Exit(RUN_FAILED) from error

    return wrapped
