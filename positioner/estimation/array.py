"""The array of floats that all of this room is written in."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
