"""SVG files to shapes and groups: one group an element, in the order of the file."""

import math
from pathlib import Path as FilePath
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.pydiffvg.scene_classes import (
    Circle,
    Color,
    Ellipse,
    LinearGradient,
    Path,
    Polygon,
    RadialGradient,
    Rect,
    ShapeGroup,
)
from diff3ds.svg.drawing import Drawn, read_drawing
from diff3ds.svg.element_outlines import Contour, contours_of
from diff3ds.svg.matrices import IDENTITY, Matrix
from diff3ds.svg.paints import Gradient, Paint

# How much a transform may turn or stretch one direction more than another and still be a scaling.
ALIKE = 1e-6


def svg_to_scene(filename: str | FilePath) -> tuple[int, int, list[Any], list[ShapeGroup]]:
    """Reads an SVG file.

    Paths come as `Path`, one for each of their subpaths, with their transforms in their points where these only move,
    turn and scale; lines, polylines and polygons as `Polygon`; circles, ellipses and rectangles as such. What an SVG
    file draws with other ends than round ones, dashes, clips or filters comes without; a warning says so of all but
    the ends.

    Returns:
        The canvas' width and height (of the view box, else of the file), the shapes and the groups.

    Raises:
        ValueError: no SVG file, a broken or too large one, or values in it that cannot be read.
        OSError: it cannot be read.
    """
    drawing = read_drawing(FilePath(filename))
    shapes: list[Any] = []
    groups = []
    for drawn in drawing.drawn:
        matrix, found = _shapes(drawn)
        for number, shape in enumerate(found):
            shape.id = drawn.name if len(found) == 1 else f"{drawn.name}-{number}"
        ids = torch.arange(len(shapes), len(shapes) + len(found))
        shapes += found
        groups.append(
            ShapeGroup(
                shape_ids=ids,
                fill_color=_color(drawn.fill),
                use_even_odd_rule=drawn.even_odd,
                stroke_color=_color(drawn.stroke),
                shape_to_canvas=torch.tensor(_rows(matrix)),
                id=drawn.name,
            )
        )
    return max(int(drawing.width), 1), max(int(drawing.height), 1), shapes, groups


def from_svg_path(
    path_str: str, shape_to_canvas: Float[Tensor, "3 3"] | None = None, force_close: bool = False
) -> list[Path]:
    """The subpaths of path data, as paths of half width 1.

    Args:
        path_str: the attribute `d` of a path.
        shape_to_canvas: affine, applied to the points.
        force_close: closes open subpaths with a line.

    Raises:
        ValueError: what is no path data.
    """
    matrix = IDENTITY
    if shape_to_canvas is not None:
        (a, c, e), (b, d, f) = shape_to_canvas[:2].tolist()
        matrix = (a, b, c, d, e, f)
    contours = contours_of("path", {"d": path_str})
    for contour in contours if force_close else ():
        contour.inner += [] if contour.closed else [0]
        contour.closed = True
    return [_path(contour, matrix, 1.0) for contour in contours]


def _shapes(drawn: Drawn) -> tuple[Matrix, list[Any]]:
    """The shapes of an element, and from their coordinates to the canvas."""
    half, values = torch.tensor(drawn.width / 2), drawn.values
    rounded = drawn.tag == "rect" and any(drawn.contours[0].inner)
    if drawn.tag == "path" or rounded:
        a, b, c, d, _, _ = drawn.matrix
        scale = math.hypot(a, b)
        even = abs(a * c + b * d) + abs(a * a + b * b - c * c - d * d) <= ALIKE * scale * scale
        if even or drawn.stroke is None:
            return IDENTITY, [_path(each, drawn.matrix, drawn.width / 2 * scale) for each in drawn.contours]
        return drawn.matrix, [_path(each, IDENTITY, drawn.width / 2) for each in drawn.contours]
    center = torch.tensor([values.get("cx", 0.0), values.get("cy", 0.0)])
    if drawn.tag == "circle":
        return drawn.matrix, [Circle(torch.tensor(values["r"]), center, half)]
    if drawn.tag == "ellipse":
        return drawn.matrix, [Ellipse(torch.tensor([values["rx"], values["ry"]]), center, half)]
    if drawn.tag == "rect":
        low = torch.tensor([values.get("x", 0.0), values.get("y", 0.0)])
        return drawn.matrix, [Rect(low, low + torch.tensor([values["width"], values["height"]]), half)]
    return drawn.matrix, [Polygon(torch.tensor(each.points), each.closed, half) for each in drawn.contours]


def _path(contour: Contour, matrix: Matrix, half_width: float) -> Path:
    a, b, c, d, e, f = matrix
    points = torch.tensor([(a * x + c * y + e, b * x + d * y + f) for x, y in contour.points])
    return Path(torch.tensor(contour.inner, dtype=torch.int32), points, contour.closed, torch.tensor(half_width))


def _color(paint: Paint | None) -> Color | None:
    if paint is None:
        return None
    if not isinstance(paint, Gradient):
        return torch.tensor(paint)
    first, second = torch.tensor(paint.ends[:2]), torch.tensor(paint.ends[2:])
    kind = LinearGradient if paint.linear else RadialGradient
    return kind(first, second, torch.tensor(paint.offsets), torch.tensor(paint.colors))


def _rows(m: Matrix) -> list[list[float]]:
    return [[m[0], m[2], m[4]], [m[1], m[3], m[5]], [0.0, 0.0, 1.0]]
