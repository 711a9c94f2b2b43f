"""What all commands share: where they print, and how they fail."""

import functools
import logging
import sys
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import typer
from rich.console import Console

from deli.errors import DeliError, InputError

RUN_FAILED, INPUT_AT_FAULT = 1, 2
PLAIN_WIDTH = 120

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def console() -> Console:
    """Return a console on standard output: plain text of a fixed width where that is not a terminal."""
    terminal = sys.stdout.isatty()
    return Console(file=sys.stdout, highlight=False, width=None if terminal else PLAIN_WIDTH)


def complain(message: object) -> None:
    """Print one message to standard error."""
    typer.echo(f"deli: {message}", err=True)


def guarded(command: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Turn deli's errors into one message and an exit status: 2 where the input is at fault, 1 where the run is."""

    @functools.wraps(command)
    def wrapped(*args: Parameters.args, **keywords: Parameters.kwargs) -> Result:
        logging.getLogger("deli").addHandler(logging.NullHandler())  # commands say themselves how a run ended
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
        except KeyboardInterrupt as error:  # before a run began, or after it
            complain(str(error) or "stopped by SIGINT.")
            raise typer.Exit(RUN_FAILED) from error

    return wrapped
