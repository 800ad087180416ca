"""How wide the lines of a drawing are."""

import math

from diff3ds.render.backends import torch_on_one_thread
from diff3ds.tasks.store import Store


def line_width(store: Store) -> float:
    """Mean width of the lines, as a fraction of the image height.

    A line of length L and width w holds w L of ink, and the total variation of its profile is 2 L; summing the
    absolute differences along x and y measures 4 / pi times that, averaged over directions.
    """
    total = variation = 0.0
    # The last bits of sums on several threads depend on their number.
    with torch_on_one_thread():
        for views in store.chunks():
            ink = store.batch(views).alpha
            total += float(ink.sum())
            variation += float((ink[:, 1:] - ink[:, :-1]).abs().sum() + (ink[:, :, 1:] - ink[:, :, :-1]).abs().sum())
    return 2 * (4 / math.pi) * total / variation / store.pixels.shape[1]
