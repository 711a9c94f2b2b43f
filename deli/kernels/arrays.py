"""Types of the arrays in the records that kernels read and write."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = Annotated[NDArray[np.float64], 2]
Numbers = NDArray[np.int64]
Flags = NDArray[np.bool_]
