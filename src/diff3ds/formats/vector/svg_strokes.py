"""SVG drawings read as flat sketches."""

import math
import warnings
from collections.abc import Iterator
from pathlib import Path

import torch

from diff3ds._checks import users_level
from diff3ds._shapes import Float, Tensor
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch
from diff3ds.svg.drawing import Drawn, read_drawing
from diff3ds.svg.element_outlines import Contour
from diff3ds.svg.paints import RGBA, Gradient, Paint


def load_svg(path: str | Path) -> Sketch:
    """Reads the strokes of an SVG drawing: cubics at z = 0, a world unit a pixel, x to the right and y down.

    `ds.sheet` looks at it as it is drawn. Widths are in world units; of a stroke that a transform stretches, the mean
    of both directions. A gradient of colours is its mean. What is filled and has no stroke is left out with a warning.

    Raises:
        ValueError: no SVG file, a broken or too large one, or one without a stroke.
        OSError: it cannot be read.
    """
    path = Path(path)
    drawing = read_drawing(path)
    stroked = [drawn for drawn in drawing.drawn if drawn.stroke is not None]
    if not stroked:
        raise ValueError(f"{path}: nothing in it has a stroke: give its shapes one, or draw it by diff3ds image")
    if len(stroked) < len(drawing.drawn):
        count = len(drawing.drawn) - len(stroked)
        warnings.warn(f"{path}: left out are {count} filled shapes without a stroke", stacklevel=users_level())
    cubics, counts, closed, widths, colors = [], [], [], [], []
    for drawn in stroked:
        a, b, c, d, _, _ = drawn.matrix
        color = _mean(drawn.stroke)
        for contour in drawn.contours:
            cubics.append(_cubics(contour, drawn))
            counts.append(len(contour.inner))
            closed.append(contour.closed)
            widths.append(drawn.width * math.sqrt(abs(a * d - b * c)))
            colors.append(color)
    rgba = torch.tensor(colors)
    return Sketch(
        torch.cat(cubics),
        width=torch.tensor(widths),
        color=rgba[:, :3],
        opacity=rgba[:, 3],
        width_space="world",
        chains=Chains.of(counts, closed),
    )


def _cubics(contour: Contour, drawn: Drawn) -> Float[Tensor, "S 4 3"]:
    """The segments of a contour on the canvas, all of them as cubics."""
    a, b, c, d, e, f = drawn.matrix
    points = [(a * x + c * y + e, b * x + d * y + f, 0.0) for x, y in contour.points]
    return torch.tensor(list(_segments(points, contour.inner)))


def _segments(points: list[tuple[float, float, float]], inner: list[int]) -> Iterator[list[list[float]]]:
    at = 0
    for count in inner:
        first, *between, last = (points[k % len(points)] for k in range(at, at + count + 2))
        # A line is a cubic with its inner points at thirds; a quadratic's lie two thirds of the way to its one.
        begin, end, share = (last, first, 1 / 3) if count == 0 else (between[0], between[-1], 2 / 3)
        if count < 2:
            between = [_between(first, begin, share), _between(last, end, share)]
        yield [list(point) for point in (first, *between, last)]
        at += count + 1


def _between(p: tuple[float, float, float], q: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    return p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]), 0.0


def _mean(paint: Paint | None) -> RGBA:
    if not isinstance(paint, Gradient):
        return paint or (0.0, 0.0, 0.0, 1.0)
    red, green, blue, alpha = (sum(values) / len(paint.colors) for values in zip(*paint.colors, strict=True))
    return red, green, blue, alpha
