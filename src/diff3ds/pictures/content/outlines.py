"""How deep in the object's silhouette the pixels of posed pictures lie."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float
from diff3ds.pictures.store import Batch

# Coverage of a pixel at the edge of a silhouette; ink of a pixel on a line.
HALF, INK = 0.5, 0.3
# Depths matter near the outline only, pixels.
DEEPEST = 8.0


def depths(batch: Batch) -> Float[NDArray[np.float32], "B H W"]:
    """Distances from the outline of the object, pixels: positive inside, negative outside, at most `DEEPEST`.

    In coloured pictures the object is where alpha is more than a half. In line drawings and edge maps it is what a
    flood from the border of the picture does not reach without crossing a line, and its outline runs in the middle of
    lines. Infinite where nothing is known.
    """
    drawn = batch.pixels.shape[-1] == 1
    found = [_of_drawing(alpha > INK) if drawn else _signed(alpha > HALF) for alpha in batch.alpha.numpy()]
    return np.where(batch.known.numpy(), np.clip(np.stack(found), -DEEPEST, DEEPEST), np.inf).astype(np.float32)


def _of_drawing(ink: Bool[NDArray[np.bool_], "H W"]) -> Float[NDArray[np.float64], "H W"]:
    from scipy.ndimage import label

    # A line runs around the picture, so that what lies outside is one piece.
    regions, _ = label(np.pad(~ink, 1, constant_values=True))
    outside = (regions == regions[0, 0])[1:-1, 1:-1]
    # Half the width of a line: its area over its length, which its pixels' mean depth gives (a quarter of the width).
    across = _signed(ink)[ink]
    inset = 2 * float(across.mean()) if len(across) else 0.0
    return _signed(~outside) - inset


def _signed(inside: Bool[NDArray[np.bool_], "H W"]) -> Float[NDArray[np.float64], "H W"]:
    """Distances from the boundary between pixels inside and outside; beyond the picture nothing is known."""
    from scipy.ndimage import distance_transform_edt

    if inside.all() or not inside.any():
        return np.full(inside.shape, np.inf if inside.all() else -np.inf)
    # Between middles of pixels there is half a pixel to the boundary.
    depth: NDArray[np.float64] = np.where(
        inside, distance_transform_edt(inside) - 0.5, 0.5 - distance_transform_edt(~inside)
    )
    return depth
