"""Refusal of a file that does not hold what deli writes."""

from pathlib import Path
from typing import NoReturn

from deli.errors import InputError


class Damaged(InputError):
    """A file does not hold what deli writes; `what` says where."""

    def __init__(self, path: Path, what: str) -> None:
        super().__init__(f"{path} is damaged: {what}. Run it again; --overwrite starts anew.")
        self.what = what


def refuse(path: Path, what: str) -> NoReturn:
    """Refuse a damaged file.

    Raises
    ------
    Damaged
    """
    raise Damaged(path, what)
