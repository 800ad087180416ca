"""SVG files: views of a sketch as vector paths, one path a stroke."""

import html
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from diff3ds._files import write_text
from diff3ds.camera import Cameras
from diff3ds.formats.vector.page_layers import Layers, PathOptions, a_view, layered_page
from diff3ds.page.drawn_paths import TOLERANCE, DrawnPath
from diff3ds.page.pens.pen_paths import Travel
from diff3ds.page.sheet.page_layout import Layout
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.page.sheet.views_grid import hexadecimal
from diff3ds.page.stroke_outlines import Path as Curve
from diff3ds.page.stroke_outlines import straight
from diff3ds.sketch import Sketch
from diff3ds.svg.layer_groups import INKSCAPE, Group, layer_elements
from diff3ds.svg.path_ids import KEPT, PathIds, said_of_strokes

Background = Sequence[float] | Literal["auto"] | None
ROUND = 'stroke-linecap="round" stroke-linejoin="round"'


def save_svg(
    path: str | Path,
    sketch: Sketch | Sequence[Sketch],
    cameras: Cameras,
    *,
    background: Background = "auto",
    page: PageSetup | None = None,
    layers: Layers | Sequence[str | Group] | Sequence[Sequence[str | Group]] | None = None,
    centerline: bool = False,
    pen_mm: float | None = None,
    tolerance: float = TOLERANCE,
    numbers: Sequence[int] | Sequence[Sequence[int]] | None = None,
    kept: Sequence[str] = KEPT,
    dashes: Sequence[int] | Sequence[Sequence[int]] | None = None,
) -> Travel | None:
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
        sketch: one for all views, or one a view.
        background: RGB in [0, 1], or None for a transparent one; by default white, and with `centerline` none, as
            plotters would draw its edge.
        page: the sheet of paper that the views are laid out on, in exact millimetres; without it the page is the
            pictures, and a pixel is what the program takes for one.
        layers: "color" for an Inkscape layer a colour, or the name of the layer of each stroke, or names of layers
            within layers from the outermost on; far ones come first, and strokes of different layers then lie over each
            other as the layers do. Of several sketches a list for each.
        centerline: for plotters: nothing is filled, hidden or translucent, and each layer is what one pen draws, by
            default one a colour; names of layers begin with the number of the pen, and several views are layers within
            those of the pens. Strokes that meet within the pen's
            width are one path, with the id "strokes-3-7" of strokes 3 and 7, what lies on ink that is there already is
            left out, and paths are in an order of short ways for the pen.
        pen_mm: how wide the lines of pens are, millimetres on paper; by default as those of most paths.
        tolerance: pixels.
        numbers: by which the ids call the strokes, where these are parts of a sketch's: -1 for lines of the view
            alone, "line-1" and so on. Of several sketches a list for each.
        kept: what strokes have as those of the sketch have it, of "color", "opacity" and "width": edits of it can come
            back (`diff3ds apply`).
        dashes: of each stroke the number of the line that it is a dash of, -1 for others: the dashes of a line are one
            path of several parts, but for those that would come to lie below undashed ones that they are above, and
            with `centerline` those that the pen does not draw one after the other. Of several sketches a list for each.

    Returns:
        With `centerline` what the pens travel, in millimetres where the page has a size on paper, else in pixels.

    Raises:
        ValueError: no cameras, sketch and cameras on different devices, a background that is no colour, a tolerance
            that is not positive; another number of layers than of strokes, or of sketches than of views; a pen's width
            without centre lines or without a page; so many views that the page has no room for them.
        OSError: the file cannot be written.
    """
    background = ground_of(background, centerline)
    how = PathOptions(layers, centerline, pen_mm, tolerance, dashes)
    layout, views, travelled = layered_page(sketch, cameras, background, page, how)
    sketches = a_view(sketch, sketch, len(views))
    rows = [range(len(each)) for each in sketches] if numbers is None else a_view(numbers, sketch, len(views))
    labelled = layers is not None or centerline or any(each.names for each in sketches)
    shown: set[int] = set()
    elements: list[dict[Group, list[str]]] = []
    for view, (groups, each) in enumerate(zip(views, sketches, strict=True)):
        shown |= {rows[view][stroke] for paths in groups.values() for path in paths for stroke in path.strokes}
        elements.append(_elements(groups, _prefix(layout, view), layout.corners[view], each.names, rows[view]))
    if centerline:
        lines = list(layer_elements(_by_pen(elements), "", ROUND, numbered=True))
    else:
        lines = [line for view, groups in enumerate(elements) for line in _view(groups, layout, view)]
    kept = [field for field in kept if field == "color" or not centerline]
    of_image = all(each.width_space == "image" for each in sketches) and not centerline
    tall = layout.cameras.size[0] * layout.widen if of_image else None
    head = layout.svg_head(background, INKSCAPE if labelled else "", said_of_strokes(shown, kept, tall))
    write_text(Path(path), "\n".join([head, *lines, "</svg>"]) + "\n")
    return travelled


def ground_of(background: Background, centerline: bool) -> Sequence[float] | None:
    """RGB of what lies below the strokes, None for nothing."""
    if isinstance(background, str):
        return None if centerline else (1.0, 1.0, 1.0)
    return background


def _prefix(layout: Layout, view: int) -> str:
    """Of what belongs to one of several views."""
    return f"view-{view}-" if len(layout.corners) > 1 else ""


def _elements(
    groups: dict[Group, list[DrawnPath]],
    prefix: str,
    corner: tuple[float, float],
    names: Sequence[str] | None,
    numbers: Sequence[int],
) -> dict[Group, list[str]]:
    """The elements of a view in its layers."""
    ids = PathIds(prefix, numbers)
    return {
        group: [_element(path, ids.of(path.strokes), corner, _label(path, names)) for path in paths]
        for group, paths in groups.items()
    }


def _view(groups: dict[Group, list[str]], layout: Layout, view: int) -> Iterator[str]:
    """The elements of a view; of several views, a group each, which keeps the ink of a view off its neighbours."""
    prefix, (x, y) = _prefix(layout, view), layout.corners[view]
    if prefix:
        height, width = layout.cameras.size
        place = f'x="{_number(x)}" y="{_number(y)}" width="{width}" height="{height}"'
        yield f'<clipPath id="page-{view}"><rect {place}/></clipPath>'
        yield f'<g id="view-{view}" clip-path="url(#page-{view})">'
    yield from layer_elements(groups, prefix, ROUND)
    if prefix:
        yield "</g>"


def _by_pen(views: Sequence[dict[Group, list[str]]]) -> dict[Group, list[str]]:
    """Several views as layers within those of the pens: programs for plotters take the outermost groups for pens."""
    if len(views) == 1:
        return views[0]
    groups = [(group, view) for view, some in enumerate(views) for group in some]
    return {(*group[:1], f"view {view}", *group[1:]): views[view][group] for group, view in groups}


def _label(path: DrawnPath, names: Sequence[str] | None) -> str:
    """What a path is called: by its strokes, each name once."""
    return ", ".join(dict.fromkeys(names[stroke] for stroke in path.strokes if names[stroke])) if names else ""


def _element(path: DrawnPath, known: str, at: tuple[float, float], name: str) -> str:
    color = hexadecimal(path.color)
    kind = "fill" if path.width is None else "stroke"
    style = f'{kind}="{color}"' + (f' {kind}-opacity="{path.opacity:.6g}"' if path.opacity < 1 else "")
    if path.width is not None:
        style = f'fill="none" {style} stroke-width="{_number(path.width)}"'
    data = "".join(_data(curve + np.array(at), path.closed) for curve in path.curves)
    called = f' inkscape:label="{html.escape(name)}"' if name else ""
    return f'<path id="{known}"{called} d="{data}" {style}/>'


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
