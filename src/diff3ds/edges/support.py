"""Which parts of which curves a view shows: those that lie on its ridges, running the same way."""

import numpy as np
import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.edges.curves import Curves
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.ridges import Array

PARTS = 6
# Samples of a part, and the share of them that has to agree.
SAMPLES, AGREEING = 5, 0.6
# Distance from a ridge in pixels, and sine of the angle to it (25 degrees), that still agree. Empirical.
NEAR, SLANT = 2.5, 0.436
# Step along the tangent, relative to the size of a pixel, that shows its direction in the image.
STEP = 0.1


def part_support(views: EdgeViews, curves: Curves, near: float = NEAR) -> Bool[Tensor, "V N P"]:
    """Whether each of the `PARTS` equal parts of each curve lies on an edge in each view.

    Args:
        near: distance from a ridge that still agrees, pixels.
    """
    samples = PARTS * SAMPLES
    t = (torch.arange(samples) + 0.5) / samples
    x = curves.at(t).double().numpy()
    tangent = np.gradient(x, axis=1).reshape(-1, 3)
    agree = agreement(views, x.reshape(-1, 3), tangent, near)
    share = agree.reshape(len(views), len(curves), PARTS, SAMPLES).mean(-1)
    return torch.from_numpy(share >= AGREEING)


def agreement(views: EdgeViews, x: Float[Array, "M 3"], tangent: Float[Array, "M 3"], near: float = NEAR) -> Array:
    """Whether points on a curve lie on ridges that run along it, (V, M)."""
    match = views.match(x)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    ahead = views.project(x + STEP * views.pixel * tangent / np.maximum(length, 1e-12))[0] - match.pixel
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True) + 1e-12
    across = np.abs((ahead * views.normals[match.ridge]).sum(-1))
    return (match.distance < near) & (across < SLANT)
