"""Ink on paper: a drawing that was photographed or scanned, on paper that is grainy or unevenly lit."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float

Array = NDArray[np.float64]

# The ink of a drawing is nowhere deeper than this fraction of the picture's side, but for a tenth of it: what is deeper
# is an area. A felt tip of 6 % of the object's size is half as deep.
DEEP = 0.03
# A pixel with this fraction of the darkest ink is a line's.
INKED = 0.5
# Ink that spans less than this fraction of the picture is a speck.
SPECK = 0.03
# Lightness of paper changes slowly, over this fraction of the picture's longer side; grain is smaller than the other.
SLOW, GRAIN = 0.06, 0.002
# Ink is darker than paper by this fraction at least, and by so many times the grain's median deviation; it takes less
# than these fractions of the picture and of its borders. Empirical.
DARKER, DEVIATIONS, MOST, MOST_AT_BORDERS = 0.12, 6.0, 0.25, 0.1


def ink_on_paper(image: Float[NDArray[np.float32], "H W 3"]) -> Float[NDArray[np.float32], "H W"] | None:
    """Ink in [0, 1] of a picture of a drawing; None if it is no drawing."""
    from scipy.ndimage import gaussian_filter, maximum_filter

    side = max(image.shape[:2])
    gray = gaussian_filter(image.mean(-1), max(1.0, GRAIN * side))
    slow = round(SLOW * side)
    paper = gaussian_filter(maximum_filter(gray, 2 * slow + 1), slow)
    darkness = 1 - gray / np.maximum(paper, 1e-3)
    darkness -= np.median(darkness)
    least = max(DARKER, DEVIATIONS * float(np.median(np.abs(darkness))))
    dark = darkness > least
    inked = without_specks(dark)
    borders = np.concatenate([inked[0], inked[-1], inked[:, 0], inked[:, -1]])
    texture = inked.sum() < dark.sum() / 2
    if texture or not 0 < inked.mean() < MOST or borders.mean() > MOST_AT_BORDERS:
        return None
    full = max(2 * least, float(np.quantile(darkness[inked], 0.9)))
    ink = np.clip((darkness - least / 2) / (full - least / 2), 0, 1).astype(np.float32)
    ink[~inked] = 0
    return ink if is_thin(ink) else None


def without_specks(drawn: Bool[NDArray[np.bool_], "H W"]) -> Bool[NDArray[np.bool_], "H W"]:
    """Keeps what hangs together over more than specks do."""
    from scipy.ndimage import find_objects, label

    names, _ = label(drawn, np.ones((3, 3)))
    spans = np.array([0, *(max(a.stop - a.start, b.stop - b.start) for a, b in find_objects(names))])
    kept: NDArray[np.bool_] = spans[names] > SPECK * max(drawn.shape)
    return kept


def is_thin(ink: Float[NDArray[np.float32], "H W"]) -> bool:
    """Whether ink is lines, not areas."""
    depth = depth_in(ink)
    return bool(np.quantile(depth[depth > 0], 0.9) < DEEP * max(ink.shape))


def depth_in(ink: Float[NDArray[np.float32], "H W"]) -> Float[Array, "H W"]:
    """Measures how deep each pixel lies in the ink, pixels."""
    from scipy.ndimage import distance_transform_edt

    return np.asarray(distance_transform_edt(ink > INKED * ink.max()))
