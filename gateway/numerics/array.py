"""Type of a numeric array."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
