"""Reading of TOML: files of bounded size, and tables of bounded depth with values that a config can use."""

import math
import re
import stat
import tomllib
import unicodedata
from collections.abc import Iterator, Mapping
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from deli.errors import InputError

MOST_BYTES = 16_000_000
"""The largest size of a file, which takes half a minute to read."""
MOST_DEPTH = 32
"""The deepest nesting of tables and lists; no config needs ten, and Python's stack holds a thousand."""
LARGEST_INTEGER = 2**63 - 1
"""The largest integer that every reader of TOML has to accept."""

_KEY = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_KEY}[ \t]*\.[ \t]*){{{MOST_DEPTH}}}")
"""A key of too many parts; the time to read a dotted key grows with the square of the number of its parts."""
_DIGITS = re.compile(r"\d[\d_]{4000,}")
_WHITE = "\n\t"


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """Read a TOML file; return its text and its table.

    Raises
    ------
    InputError
        If the file cannot be read, is not a plain file or is too large, or `parse_toml` refuses its text.
    """
    text = _text(path)
    try:
        return text, parse_toml(text)
    except InputError as error:
        raise InputError(f"{path} is not valid TOML: {error}.") from error


def _text(path: Path) -> str:
    try:
        found = path.stat()
        plain, small = stat.S_ISREG(found.st_mode), found.st_size <= MOST_BYTES
        if plain and small:
            return path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path} cannot be read: {error.reason} (at line {line}).") from error
    except (OSError, ValueError) as error:  # a ValueError comes of an impossible file name
        raise InputError(f"{path} cannot be read: {error}.") from error
    why = f"it has {found.st_size:,} bytes, allowed: {MOST_BYTES:,}" if plain else "it is not a plain file"
    raise InputError(f"{path} cannot be read: {why}.")


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML.

    Raises
    ------
    InputError
        If the text is not TOML, with the line of the error, or if it is nested beyond `MOST_DEPTH`.
    """
    too_long = _LONG_KEY.search(text)
    if too_long is not None:
        line = text.count("\n", 0, too_long.start()) + 1
        raise InputError(f"a key of more than {MOST_DEPTH} parts (at line {line})")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(error)) from error
    except RecursionError as error:
        raise InputError(f"tables or lists nested more than {MOST_DEPTH} deep") from error
    except ValueError as error:  # Python reads no integer of thousands of digits
        digits = _DIGITS.search(text)
        line = text.count("\n", 0, digits.start()) + 1 if digits else 1
        raise InputError(f"a number of too many digits (at line {line})") from error


def refuse_unusable(table: Mapping[str, Any]) -> None:
    """Refuse values that TOML allows and that no config can use, anywhere in a table.

    Such values are nan and infinity, integers beyond 64 bits, dates and times, control characters in keys and strings
    (except line ends and tabs in strings), and nesting beyond `MOST_DEPTH`.

    Raises
    ------
    InputError
        With the key, the value found and the values allowed.
    """
    open_ends: list[tuple[str, Iterator[tuple[Any, Any]]]] = [("", iter(table.items()))]
    while open_ends:
        prefix, entries = open_ends[-1]
        for key, value in entries:
            if isinstance(key, str) and (control := _control(key, "")):
                raise InputError(f"{prefix}{key} is a key with the control character {control}; use letters.")
            path = f"{prefix}{key}"
            if isinstance(value, Mapping | list | tuple):
                if len(open_ends) > MOST_DEPTH:
                    raise InputError(f"{path} is nested more than {MOST_DEPTH} deep; use flat lists and tables.")
                inner = value.items() if isinstance(value, Mapping) else enumerate(value)
                open_ends.append((f"{path}.", iter(inner)))
                break
            _refuse_value(path, value)
        else:
            open_ends.pop()


def _refuse_value(path: str, value: Any) -> None:
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InputError(f"{path} is {value}; allowed: finite numbers.")
    elif isinstance(value, str):
        if control := _control(value, _WHITE):
            raise InputError(f"{path} has the control character {control}; leave it out.")
    elif isinstance(value, int):
        if abs(value) > LARGEST_INTEGER:
            raise InputError(
                f"{path} is an integer of {value.bit_length()} bits; allowed: {-LARGEST_INTEGER} to {LARGEST_INTEGER}."
            )
    elif isinstance(value, date | datetime | time):
        raise InputError(f"{path} is the date or time {value}; no key of a config takes one.")


def _control(text: str, allowed: str) -> str | None:
    """Return the code of the first control character or lone surrogate, or None."""
    if text.isprintable():
        return None
    for letter in text:
        if letter not in allowed and unicodedata.category(letter) in ("Cc", "Cs"):
            return f"U+{ord(letter):04X}"
    return None
