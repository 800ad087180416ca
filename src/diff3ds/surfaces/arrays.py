"""Types of arrays that are no coordinates: numbers of vertices, faces and the like, and masks."""

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
