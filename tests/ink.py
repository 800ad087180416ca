"""Where pictures have ink: means over a picture let a short line pass that only one of two has."""

import numpy as np
from scipy.ndimage import maximum_filter

# Ink that both pictures must have, and what is ink at all: faint lines have a quarter.
STRONG, WEAK = 0.2, 0.1


def ink_apart(one, other, reach: int = 2) -> int:
    """Pixels that have ink in one of two pictures, (H, W, 3) in [0, 1], and none near by in the other.

    Args:
        reach: pixels that ink may be apart along either axis: two for antialiasing.
    """
    some, others = (1 - np.asarray(picture).min(-1) for picture in (one, other))
    missing = 0
    for here, there in ((some, others), (others, some)):
        missing += int(((here > STRONG) & (maximum_filter(there, 2 * reach + 1) < WEAK)).sum())
    return missing
