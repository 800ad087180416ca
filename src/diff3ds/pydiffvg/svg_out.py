"""Shapes and groups to SVG files that read back to the same scene."""

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path as FilePath
from typing import Any

import torch

from diff3ds._checks import users_level
from diff3ds._files import write_text
from diff3ds._shapes import Tensor
from diff3ds.pydiffvg.scene_classes import (
    Circle,
    Color,
    Ellipse,
    LinearGradient,
    Path,
    Polygon,
    Rect,
    ShapeGroup,
)
from diff3ds.pydiffvg.scene_tables import read_scene

# What linear colours become in a picture.
GAMMA = 2.2


def prettify(elem: ET.Element) -> str:
    """The text of an element, with a line for each element in it."""
    ET.indent(elem)
    return '<?xml version="1.0" ?>\n' + ET.tostring(elem, "unicode") + "\n"


def save_svg(
    filename: str | FilePath,
    width: int,
    height: int,
    shapes: Sequence[Any],
    shape_groups: Sequence[Any],
    use_gamma: bool = False,
) -> None:
    """Writes an SVG file, whole or not at all, that `svg_to_scene` reads back as the same scene.

    SVG knows one width a stroke: of one width for each point, the mean is written, with a warning. A group of several
    shapes is one path where their widths are alike, else a path for each stroke and one for the filling, which looks
    the same unless the stroke is translucent.

    Args:
        width: of the canvas.
        height: see there.
        use_gamma: adds a filter that takes the colours for linear ones.

    Raises:
        TypeError, ValueError: as `RenderFunction.serialize_scene`.
        OSError: the file cannot be written.
    """
    # Its checks are those of what is drawn.
    read_scene((float(width), float(height)), shapes, shape_groups)
    root = ET.Element("svg", xmlns="http://www.w3.org/2000/svg", version="1.1", width=str(width), height=str(height))
    root.set("viewBox", f"0 0 {width} {height}")
    defs, body = ET.SubElement(root, "defs"), ET.SubElement(root, "g")
    if use_gamma:
        _add_gamma(defs)
        body.set("style", "filter:url(#gamma)")
    for number, group in enumerate(shape_groups):
        _add_group(defs, body, number, group, [shapes[int(k)] for k in group.shape_ids.flatten().tolist()])
    write_text(FilePath(filename), prettify(root))


def _add_gamma(defs: ET.Element) -> None:
    frame = {"id": "gamma", "x": "0", "y": "0", "width": "100%", "height": "100%"}
    transfer = ET.SubElement(ET.SubElement(defs, "filter", frame), "feComponentTransfer")
    transfer.set("color-interpolation-filters", "sRGB")
    for channel in "RGBA":
        ET.SubElement(transfer, f"feFunc{channel}", type="gamma", amplitude="1", exponent=str(1 / GAMMA))


def _add_group(defs: ET.Element, body: ET.Element, number: int, group: ShapeGroup, shapes: list[Any]) -> None:
    """The elements of a group: one, or several where strokes of different widths are."""
    if not shapes:
        return
    matrix = group.shape_to_canvas.detach().cpu().double()
    common = {"fill-rule": "evenodd" if group.use_even_odd_rule else "nonzero"}
    if not torch.equal(matrix, torch.eye(3, dtype=matrix.dtype)):
        common["transform"] = f"matrix({_texts(matrix[:2].T.flatten())})"
    fill = {"fill": "none"}
    if group.fill_color is not None:
        fill = _paint(defs, f"fill-{number}", "fill", group.fill_color, matrix)
    strokes: dict[str, str] = {}
    if group.stroke_color is not None:
        strokes = _paint(defs, f"stroke-{number}", "stroke", group.stroke_color, matrix)
        strokes |= {"stroke-linecap": "round", "stroke-linejoin": "round"}
    widths = [_width(shape) for shape in shapes]
    if len(set(widths)) > 1 and strokes:
        for shape, width in zip(shapes, widths, strict=True):
            _add(body, [shape], common | {"fill": "none"} | strokes | {"stroke-width": width}, group.id)
        strokes = {}
    if strokes:
        strokes["stroke-width"] = widths[0]
        # The filling lies over the inner half of the stroke here; SVG has it the other way round.
        strokes |= {"paint-order": "stroke"} if group.fill_color is not None else {}
    if strokes or group.fill_color is not None:
        _add(body, shapes, common | fill | strokes, group.id)


def _add(body: ET.Element, shapes: list[Any], attributes: dict[str, str], name: str) -> None:
    tag, own = _outline(shapes[0]) if len(shapes) == 1 else ("path", {"d": " ".join(_data(s) for s in shapes)})
    name = name or (shapes[0].id if len(shapes) == 1 else "")
    ET.SubElement(body, tag, own | ({"id": name} if name else {}) | attributes)


def _width(shape: Any) -> str:
    width = shape.stroke_width.detach()
    if width.numel() > 1 and float(width.max()) > float(width.min()):
        warnings.warn("SVG knows one width a stroke: the mean of its widths is written", stacklevel=users_level())
    return _texts(2 * width.double().mean()[None])


def _outline(shape: Any) -> tuple[str, dict[str, str]]:
    """The tag of a shape, and its attributes."""
    if isinstance(shape, Circle):
        (r,), (x, y) = _numbers(shape.radius), _numbers(shape.center)
        return "circle", {"cx": x, "cy": y, "r": r}
    if isinstance(shape, Ellipse):
        (rx, ry), (x, y) = _numbers(shape.radius), _numbers(shape.center)
        return "ellipse", {"cx": x, "cy": y, "rx": rx, "ry": ry}
    if isinstance(shape, Rect):
        (x, y), (width, height) = _numbers(shape.p_min), _numbers(shape.p_max.double() - shape.p_min.double())
        return "rect", {"x": x, "y": y, "width": width, "height": height}
    if isinstance(shape, Polygon):
        return "polygon" if shape.is_closed else "polyline", {"points": _texts(shape.points.flatten())}
    return "path", {"d": _data(shape)}


def _data(shape: Any) -> str:
    """Path data of any shape."""
    if isinstance(shape, Circle | Ellipse):
        rx, ry = (float(r) for r in shape.radius.detach().expand(2))
        x, y = shape.center.tolist()
        turn = f"a{rx:.9g} {ry:.9g} 0 0 1"
        return f"M {x + rx:.9g} {y:.9g} {turn} {-2 * rx:.9g} 0 {turn} {2 * rx:.9g} 0 Z"
    if isinstance(shape, Rect):
        (x, y), (z, w) = _numbers(shape.p_min), _numbers(shape.p_max)
        return f"M {x} {y} L {z} {y} L {z} {w} L {x} {w} Z"
    return " ".join(_commands(shape))


def _commands(shape: Path | Polygon) -> Iterator[str]:
    points = [_texts(point) for point in shape.points.detach()]
    if isinstance(shape, Path):
        inner = [int(n) for n in shape.num_control_points.tolist()]
    else:
        inner = [0] * (len(points) - (not shape.is_closed))
    yield f"M {points[0]}"
    at = 1
    for count in inner:
        ends = [points[k % len(points)] for k in range(at, at + count + 1)]
        yield f"{'LQC'[count]} {' '.join(ends)}"
        at += count + 1
    if shape.is_closed:
        yield "Z"


def _paint(defs: ET.Element, name: str, kind: str, color: Color, matrix: Tensor) -> dict[str, str]:
    """The attributes of a paint; a gradient, which lies on the canvas, becomes a definition of this name."""
    if isinstance(color, Tensor):
        return {kind: _rgb(color), f"{kind}-opacity": _texts(color.detach()[3:].clamp(0, 1))}
    back = torch.linalg.inv(matrix)
    units = {"id": name, "gradientUnits": "userSpaceOnUse"}
    if isinstance(color, LinearGradient):
        (x1, y1), (x2, y2) = _numbers(color.begin), _numbers(color.end)
        element = ET.SubElement(defs, "linearGradient", units | {"x1": x1, "y1": y1, "x2": x2, "y2": y2})
    else:
        element = ET.SubElement(defs, "radialGradient", units | {"cx": "0", "cy": "0", "r": "1"})
        placed = torch.eye(3, dtype=back.dtype)
        placed[[0, 1], [0, 1]] = color.radius.detach().to(back)
        placed[:2, 2] = color.center.detach().to(back)
        back = back @ placed
    element.set("gradientTransform", f"matrix({_texts(back[:2].T.flatten())})")
    for offset, stop in zip(_numbers(color.offsets), color.stop_colors, strict=True):
        opacity = _texts(stop.detach()[3:].clamp(0, 1))
        ET.SubElement(element, "stop", {"offset": offset, "stop-color": _rgb(stop), "stop-opacity": opacity})
    return {kind: f"url(#{name})"}


def _rgb(color: Tensor) -> str:
    shares = (100 * color.detach()[:3].double().clamp(0, 1)).tolist()
    return f"rgb({', '.join(f'{share:.7g}%' for share in shares)})"


def _numbers(values: Tensor) -> list[str]:
    """Numbers with all digits of float32."""
    return [f"{value:.9g}" for value in values.detach().flatten().tolist()]


def _texts(values: Tensor) -> str:
    return " ".join(_numbers(values))
