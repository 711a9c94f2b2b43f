"""Values of a compiled problem's Parameters, which are written in place only."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np


class Views(Mapping[str, np.ndarray]):
    """Arrays by Parameter name, to be written into. Another array under a name is refused; no solve would see it."""

    __slots__ = ("_views",)

    def __init__(self, views: Mapping[str, np.ndarray]) -> None:
        self._views = dict(views)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._views[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._views)

    def __len__(self) -> int:
        return len(self._views)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._views!r})"

    def __setitem__(self, name: str, value: Any) -> None:
        if value is not self._views.get(name):  # as it is after ``views[name] += 1``
            raise TypeError(
                f"parameters[{name!r}] cannot be replaced: write into it, parameters[{name!r}][...] = value, "
                f"or give the value to a solve, solve({name}=value)"
            )
