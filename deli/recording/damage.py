"""Refusal of a file with contents that deli does not write."""

from pathlib import Path
from typing import NoReturn

from deli.errors import InputError


class Damaged(InputError):
    """A file with contents that deli does not write; `what` names the fault."""

    def __init__(self, path: Path, what: str) -> None:
        super().__init__(f"{path} is damaged: {what}. Repeat the run; --overwrite starts anew.")
        self.what = what


def refuse(path: Path, what: str) -> NoReturn:
    """Refuse a damaged file.

    Raises
    ------
    Damaged
    """
    raise Damaged(path, what)
