"""Which strokes are drawn at which level of detail, by what each of them is worth."""

import torch

from diff3ds._settings import check_level
from diff3ds._shapes import Bool, Float, Tensor


def share_at(detail: float) -> float:
    """The least share of the drawings that a level of detail keeps: 0 at 0, .49 at .2, .875 at .5, and all at 1.

    Empirical: the many strokes of which each adds little go at the upper end.
    """
    return 1 - (1 - detail) ** 3


def kept(importance: Float[Tensor, " N"], detail: float, most: int | None = None) -> Bool[Tensor, " N"]:
    """Which strokes a level of detail keeps: a lower one keeps some of those that a higher one does.

    Args:
        importance: not negative; of equal strokes the first one comes first.
        detail: 0 to 1. The most important strokes are kept, as few as have together the share of all importance that
            belongs to it, and those that are worth as much as the last of them; at least one, and at 1 all.
        most: strokes at most.

    Raises:
        ValueError: as `check_level`.
    """
    check_level(detail, most)
    order = importance.argsort(descending=True, stable=True)
    worth = importance[order].double()
    count = len(worth)
    if detail < 1 and count and float(worth.sum()) > 0:
        share = worth.cumsum(0) / worth.sum()
        # What is left out by rounding alone is not left out.
        last = min(int((share < share_at(detail) - 1e-9).sum()), count - 1)
        count = int((worth >= worth[last]).sum())
    mask = torch.zeros_like(importance, dtype=torch.bool)
    mask[order[: count if most is None else min(count, most)]] = True
    return mask
