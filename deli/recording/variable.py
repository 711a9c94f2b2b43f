"""Description of a recorded variable, and blocks of values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

RAGGED = ("problem", "variable", "row", "entry", "metric_entry")
"""Dimensions along which the numbers of one subproblem follow those of another."""
GROWING = ("time", "step", *RAGGED)

Block = dict[str, np.ndarray]
"""Arrays by the names of their variables."""


@dataclass(frozen=True)
class Variable:
    """One recorded variable: name, dimensions, dtype and attributes."""

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    extra: Mapping[str, Any] = field(default_factory=dict)

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the variable, the same in a file and in memory."""
        return {"units": self.units, "long_name": self.long_name, **self.extra}

    @property
    def grows(self) -> bool:
        """Whether rows are appended to the variable during the run."""
        return bool(self.dims) and self.dims[0] in GROWING
