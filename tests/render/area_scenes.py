"""Layers for tests, and their gradients."""

from dataclasses import replace

import pytest
import torch

import diff3ds as ds
from diff3ds.render.areas import EVEN_ODD, LINEAR, NONZERO, PLAIN, RADIAL, STROKE, Layers, draw_layers

NO_CPU = pytest.mark.skipif("cpu" not in ds.available_backends(), reason="installed without compiled kernels")
VALUES = ("points", "half_widths", "transforms", "axes", "offsets", "colors")


def whole(numbers):
    return torch.tensor(numbers, dtype=torch.int32)


def layers(contours, rules, half_width=1.0, colors=None, dtype=torch.float64):
    """One layer a list of contours, each of (points, inner, closed), painted in black or in colors."""
    points, inner, table, rows = [], [], [], []
    for row, (group, rule) in enumerate(zip(contours, rules, strict=True)):
        rows.append([len(table), len(group), rule, 0, row])
        for controls, degrees, closed in group:
            table.append([len(points), len(controls), len(inner), len(degrees), int(closed)])
            points += controls
            inner += degrees
    count = len(rows)
    colors = [[0, 0, 0, 1]] * count if colors is None else colors
    return Layers(
        points=torch.tensor(points, dtype=dtype).reshape(-1, 2),
        half_widths=torch.full((len(points),), half_width, dtype=dtype),
        inner=whole(inner),
        contours=whole(table).reshape(-1, 5),
        layers=whole(rows).reshape(-1, 5),
        transforms=torch.eye(2, 3, dtype=dtype)[None],
        paints=whole([[PLAIN, row, 1, 0] for row in range(count)]).reshape(-1, 4),
        axes=torch.zeros(count, 4, dtype=dtype),
        offsets=torch.zeros(count, dtype=dtype),
        colors=torch.tensor(colors, dtype=dtype).reshape(-1, 4),
    )


def box(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], [0, 0, 0, 0], True


def gradients(scene, size, seed=0, background=None, backend=None):
    """The picture, and gradients of a random sum of it."""
    values = {name: getattr(scene, name).clone().requires_grad_() for name in VALUES}
    below = None if background is None else background.clone().requires_grad_()
    image = draw_layers(replace(scene, **values), *size, below, backend=backend)
    upstream = torch.randn(image.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    (image * upstream.to(image)).sum().backward()
    found = {name: torch.zeros_like(v) if v.grad is None else v.grad for name, v in values.items()}
    return image.detach(), found if below is None else found | {"background": below.grad}


def rich_scene(dtype=torch.float64):
    """A translucent stroke under a fill with a hole of a joined outline, and gradients of both kinds over them."""
    g = torch.Generator().manual_seed(3)
    curve = [[5.1, 5], [20, 2], [28, 20], [10, 28]], [2], False
    wedge = [[8.2, 20], [15, 30.3], [2, 25.1], [12.3, 9]], [1, 0], False
    ring = [[3.3, 3.2], [20.1, 3.2], [20.1, 14.7], [3.3, 14.7]], [0, 0, 0, 0], True
    hole = [[6.2, 5.1], [17, 6.3], [9, 12.2]], [1, 0], True
    scene = layers([[curve, wedge], [ring, hole], [wedge], [ring]], [STROKE, EVEN_ODD, NONZERO, STROKE], 1.3)
    matrix = torch.tensor([[[1.0, 0, 0], [0, 1, 0]], [[0.9, 0.2, 3], [-0.2, -0.8, 25]]])
    return replace(
        scene,
        layers=whole([[*row[:3], k % 2, row[4]] for k, row in enumerate(scene.layers.tolist())]),
        transforms=matrix.to(dtype),
        paints=whole([[PLAIN, 0, 1, 0], [LINEAR, 0, 3, 1], [RADIAL, 1, 3, 0], [PLAIN, 3, 1, 0]]),
        axes=torch.tensor([[0, 0, 0, 0], [2, 3, 18, 16], [9, 12, 7, 11], [0, 0, 0, 0]], dtype=dtype),
        offsets=torch.tensor([0.05, 0.4, 0.9, 1.0], dtype=dtype),
        colors=torch.rand(4, 4, generator=g, dtype=torch.float64).to(dtype),
        **{name: getattr(scene, name).to(dtype) for name in ("points", "half_widths")},
    )
