"""SVG files: views of a sketch as vector paths, one path a stroke."""

import html
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from diff3ds._files import write_text
from diff3ds.camera import Cameras
from diff3ds.page.drawn_paths import TOLERANCE, DrawnPath, drawn_paths
from diff3ds.page.stroke_outlines import Path as Curve
from diff3ds.page.stroke_outlines import straight
from diff3ds.page.views_grid import check_page, corner, hexadecimal, page_size
from diff3ds.sketch import Sketch

Layers = Literal["color"]
Background = Sequence[float] | Literal["auto"] | None
INKSCAPE = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'


def save_svg(
    path: str | Path,
    sketch: Sketch,
    cameras: Cameras,
    *,
    background: Background = "auto",
    width_mm: float | None = None,
    layers: Layers | Sequence[str] | None = None,
    centerline: bool = False,
    tolerance: float = TOLERANCE,
) -> None:
    """Writes the views of all cameras, side by side in a grid that is about square; whole or not at all.

    Every stroke is one path with round ends and the id "stroke-0", "stroke-1" and so on, by its number in the sketch;
    of several views "view-0-stroke-0"; its name, if it has one, is Inkscape's label. With `width_space="image"` it is a
    stroked path of cubic Béziers: SVG knows no rational ones, so it stays within the tolerance of the exact curve. With
    "world", or widths along the stroke, it is a filled outline, to the same tolerance. What a view cannot show is left
    out: paths are cut where their ink leaves the page.

    SVG has no depth: paths lie over each other as `render` has the strokes where they meet. A stroke that is in front
    of another here and behind it, or behind one that is, there, is cut in between ("stroke-0-part-2"). Colours are
    clamped to [0, 1] and rounded to 8 bits.

    Args:
        background: RGB in [0, 1], or None for a transparent one; by default white, and with `centerline` none, as
            plotters would draw its edge.
        width_mm: of the page on paper, millimetres; without it a pixel is what the program takes for one.
        layers: "color" for an Inkscape layer a colour, or the name of the layer of each stroke; far ones come first,
            and strokes of different layers then lie over each other as the layers do.
        centerline: for plotters: each stroke is one plain path, nothing is filled, hidden or translucent, and there
            is a layer a colour.
        tolerance: pixels.

    Raises:
        ValueError: no cameras, sketch and cameras on different devices, a background that is no colour, a width or
            tolerance that is not positive; another number of layers than of strokes.
        OSError: the file cannot be written.
    """
    background = ground_of(background, centerline)
    sketch = check_page(sketch, cameras, background, width_mm, tolerance)
    named = None if layers is None or isinstance(layers, str) else list(layers)
    if named is not None and len(named) != len(sketch):
        raise ValueError(f"layers must name one for each of the {len(sketch)} strokes, got {len(named)}")
    width, height = page_size(cameras)
    unit, scale = ("", 1.0) if width_mm is None else ("mm", width_mm / width)
    size = f'width="{width * scale:.6g}{unit}" height="{height * scale:.6g}{unit}" viewBox="0 0 {width} {height}"'
    by_color = layers == "color" or centerline
    size += f" {INKSCAPE}" if by_color or named or sketch.names else ""
    ground = ""
    if background is not None:
        ground = f'<rect width="{width}" height="{height}" fill="{hexadecimal(background)}"/>\n'
    lines: list[str] = []
    for view in range(len(cameras)):
        paths = drawn_paths(sketch, cameras, view, centerline=centerline, tolerance=tolerance)
        lines += _view(layered(paths, named) if by_color or named else {"": paths}, cameras, view, sketch.names)
    write_text(
        Path(path), f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{ground}' + "\n".join(lines) + "\n</svg>\n"
    )


def ground_of(background: Background, centerline: bool) -> Sequence[float] | None:
    """RGB of what lies below the strokes, None for nothing."""
    if isinstance(background, str):
        return None if centerline else (1.0, 1.0, 1.0)
    return background


def layered(paths: Sequence[DrawnPath], named: Sequence[str] | None = None) -> dict[str, list[DrawnPath]]:
    """Paths by their colour as "#rrggbb", or by the name of their stroke's layer, in the order of the first of each."""
    groups: dict[str, list[DrawnPath]] = {}
    for path in paths:
        name = named[_stroke(path)] if named else hexadecimal(path.color)
        groups.setdefault(name, []).append(path)
    return groups


def _stroke(path: DrawnPath) -> int:
    """The number of its stroke."""
    return int(path.name.split("-")[1])


def _view(
    groups: Mapping[str, Sequence[DrawnPath]], cameras: Cameras, view: int, names: Sequence[str] | None
) -> Iterator[str]:
    """The elements of a view; of several views, a group each, which keeps the ink of a view off its neighbours."""
    several = len(cameras) > 1
    prefix, (x, y) = f"view-{view}-" if several else "", corner(cameras, view)
    if several:
        place = f'x="{x}" y="{y}" width="{cameras.size[1]}" height="{cameras.size[0]}"'
        yield f'<clipPath id="page-{view}"><rect {place}/></clipPath>'
        yield f'<g id="view-{view}" clip-path="url(#page-{view})">'
    for label, some in groups.items():
        known = re.sub(r"[^A-Za-z0-9]+", "-", label).strip("-")
        said = html.escape(prefix + label)
        name = f'id="{prefix}layer-{known}" inkscape:groupmode="layer" inkscape:label="{said}" ' if label else ""
        yield f'<g {name}stroke-linecap="round" stroke-linejoin="round">'
        yield from (_element(path, prefix, (x, y), names[_stroke(path)] if names else "") for path in some)
        yield "</g>"
    if several:
        yield "</g>"


def _element(path: DrawnPath, prefix: str, at: tuple[float, float], name: str) -> str:
    color = hexadecimal(path.color)
    kind = "fill" if path.width is None else "stroke"
    style = f'{kind}="{color}"' + (f' {kind}-opacity="{path.opacity:.6g}"' if path.opacity < 1 else "")
    if path.width is not None:
        style = f'fill="none" {style} stroke-width="{_number(path.width)}"'
    data = "".join(_data(curve + np.array(at), path.closed) for curve in path.curves)
    called = f' inkscape:label="{html.escape(name)}"' if name else ""
    return f'<path id="{prefix}{path.name}"{called} d="{data}" {style}/>'


def _data(curve: Curve, closed: bool) -> str:
    """Path data of cubic Béziers and lines."""
    texts = [_pair(*point) for point in curve.tolist()]
    parts = [
        f"L{texts[3 * i + 3]}" if line else f"C{' '.join(texts[3 * i + 1 : 3 * i + 4])}"
        for i, line in enumerate(straight(curve).tolist())
    ]
    return f"M{texts[0]}{''.join(parts)}" + ("Z" if closed else "")


def _pair(x: float, y: float) -> str:
    return f"{_number(x)},{_number(y)}"


def _number(value: float) -> str:
    """To a thousandth of a pixel."""
    return f"{value:.3f}".rstrip("0").rstrip(".")
