"""What tests of styles share: simple strokes, and a camera that sees y to the right and z up, 128 px a world unit."""

import torch

import diff3ds as ds
from diff3ds.page.lines import lines_of

CAMERA = ds.orbit(0.0, 0.0, 3.0, height=2.0, size=256)


def lines(sketch, cameras=CAMERA):
    return lines_of(ds.project(sketch, cameras), 0, cameras.size, 1.0)


def stroke(*points, **others):
    """One line or curve through the plane of the page, from (y, z)."""
    return ds.Sketch(torch.tensor([[[0.0, y, z] for y, z in points]], dtype=torch.float64), **others)


def circle(radius, middle=(0.0, 0.0, 0.0), **others):
    points, weights = ds.bezier.circle(middle, radius, (1.0, 0.0, 0.0), dtype=torch.float64)
    return ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], True), **others)
