"""How wide the lines of a drawing are."""

import math

from diff3ds.pictures.store import Batch, Store
from diff3ds.render.backends import torch_on_one_thread


def line_width(store: Store) -> float:
    """Mean width of the lines, as a fraction of the image height.

    A line of length L and width w holds w L of ink, and the total variation of its profile is 2 L; summing the
    absolute differences along x and y measures 4 / pi times that, averaged over directions.
    """
    total = variation = 0.0
    # The last bits of sums on several threads depend on their number.
    with torch_on_one_thread():
        for views in store.chunks():
            batch = store.batch(views)
            total += float(batch.alpha.sum())
            variation += sum(_variation(batch, dim) for dim in (1, 2))
    return 2 * (4 / math.pi) * total / variation / store.pixels.shape[1]


def _variation(batch: Batch, dim: int) -> float:
    """Sum of the differences between neighbours along an axis, both of which are known."""
    count = batch.known.shape[dim] - 1
    both = batch.known.narrow(dim, 0, count) & batch.known.narrow(dim, 1, count)
    return float((batch.alpha.diff(dim=dim).abs() * both).sum())
