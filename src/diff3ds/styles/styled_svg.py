"""A sketch in a style, from any cameras: SVG text, and its pixels."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.camera import Cameras
from diff3ds.curves.join import Joined, join_smooth
from diff3ds.page.ink_outlines import TOLERANCE
from diff3ds.page.lines import Line, lines_of
from diff3ds.page.noise import seed_of
from diff3ds.page.union import pathops, svg_data, within
from diff3ds.page.views_grid import check_page, corner, hexadecimal, page_size
from diff3ds.project import project
from diff3ds.sketch import Sketch
from diff3ds.styles.paper import WARM, paper_elements
from diff3ds.styles.style import Mark, Page, Style
from diff3ds.svg.layer_groups import INKSCAPE, Group, layer_elements
from diff3ds.svg.path_ids import KEPT, PathIds, said_of_strokes

# What programs take a pixel for, where no size on paper is asked for (CSS).
PIXELS_PER_MM = 96 / 25.4
# Ends this near to each other, of the sketch's size, are one place, and strokes that turn by less there, radians, go on
# in each other. [empirical: what the eye takes for one line]
NEAR, TURN = 2e-4, math.radians(30)
# px. Half widths below leave no ink.
THINNEST = 0.005
# Half widths of strokes, in pages: larger ones are taken for a mistake.
LARGEST = 4
# Of the way to the colour of the ground that the farthest strokes go, and of their width that they lose, with a depth
# cue of 1.
FADE, THIN = 0.8, 0.6


def styled_svg(
    sketch: Sketch,
    cameras: Cameras,
    style: Style,
    *,
    width: float = 1.0,
    seed: int = 0,
    depth_cue: float = 0.0,
    paper: bool = False,
    background: Sequence[float] | None = (1.0, 1.0, 1.0),
    width_mm: float | None = None,
    layers: Sequence[Group] | None = None,
    numbers: Sequence[int] | None = None,
) -> str:
    """The views of all cameras in a style, side by side in a grid that is about square, as SVG text.

    Every stroke, of however many segments, is drawn as a whole, and is one element with the id "stroke-0", "stroke-1"
    and so on, by its number in the sketch, "strokes-2-5" where two go on in each other; of several views
    "view-0-stroke-0". Its outlines neither cross nor overlap
    themselves. Strokes lie over each other as `render` has them where they meet; none is cut, so that where their order
    goes round in a circle the file cannot show it. The same seed gives the same text.

    Args:
        style: such as `CHARCOAL`, `Ink(taper=(0, 20))`, or `stretched("leaf.svg")`.
        width: times the widths that the style gives to strokes.
        seed: of all that is random.
        depth_cue: from 0 to 1, how much lighter and thinner strokes become with their depth.
        paper: whether the ground has fibres; a white background is then that of warm paper.
        background: RGB in [0, 1], or None for a transparent one.
        width_mm: of the page on paper, millimetres; without it a pixel is a 96th of an inch.
        layers: of each stroke the names of the layers that it is in, from the outermost on: only strokes of one layer
            go on in each other, and the layers lie over each other in the order of the first strokes of each.
        numbers: by which the ids call the strokes, where these are parts of a sketch's, -1 for lines of the view alone.

    Raises:
        ImportError: the extra `styles` is not installed.
        ValueError: no cameras, sketch and cameras on different devices, or a value out of range.
    """
    if not 0 < width < math.inf:
        raise ValueError(f"width must be positive, got {width}")
    if not 0 <= depth_cue <= 1:
        raise ValueError(f"depth_cue must be from 0 to 1, got {depth_cue}")
    sketch = check_page(sketch, cameras, background, width_mm, TOLERANCE)
    pathops()
    extent = float((sketch.points.amax((0, 1)) - sketch.points.amin((0, 1))).max()) if len(sketch) else 0.0
    groups = [()] * len(sketch) if layers is None else list(layers)
    sketch, made = _joined(sketch.replace(width=sketch.width * width), groups, NEAR * extent)
    whole = page_size(cameras)
    unit, scale = ("", 1.0) if width_mm is None else ("mm", width_mm / whole[0])
    page = Page(cameras.size, PIXELS_PER_MM if width_mm is None else 1 / scale, seed_of(seed))
    if paper and background is not None and tuple(background) == (1.0, 1.0, 1.0):
        background = WARM
    drawn = _Drawn(sketch, made, [groups[strokes[0]] for strokes in made], numbers)
    views = "\n".join(_views(drawn, cameras, style, page, depth_cue, background or (1.0, 1.0, 1.0)))
    ground = []
    if background is not None:
        ground.append(f'<rect width="{whole[0]}" height="{whole[1]}" fill="{hexadecimal(background)}"/>')
    if paper:
        ground += paper_elements((whole[1], whole[0]), page.unit, page.seed)
    size = f'width="{whole[0] * scale:.6g}{unit}" height="{whole[1] * scale:.6g}{unit}"'
    rows = range(sum(map(len, made))) if numbers is None else numbers
    told = said_of_strokes(rows, KEPT[:1] if depth_cue == 0 else (), None)
    spaces = "" if layers is None else f" {INKSCAPE}"
    head = f'<svg xmlns="http://www.w3.org/2000/svg"{spaces} {size} viewBox="0 0 {whole[0]} {whole[1]}" {told}>'
    return "\n".join([head, *ground, views, "</svg>"]) + "\n"


class _Drawn(NamedTuple):
    """Strokes that are drawn, which of the sketch's each is made of, in which layer it is, and the sketch's numbers."""

    sketch: Sketch
    made: list[list[int]]
    groups: list[Group]
    numbers: Sequence[int] | None


def _joined(sketch: Sketch, groups: Sequence[Group], gap: float) -> Joined:
    """The strokes of each layer that go on in each other as one."""
    rows: dict[Group, list[int]] = {}
    for stroke, group in enumerate(groups):
        rows.setdefault(group, []).append(stroke)
    if len(rows) < 2:
        return join_smooth(sketch, TURN, gap)
    parts = [join_smooth(sketch[some], TURN, gap) for some in rows.values()]
    made = [
        [some[stroke] for stroke in strokes]
        for part, some in zip(parts, rows.values(), strict=True)
        for strokes in part.strokes
    ]
    return Joined(Sketch.concatenate([part.sketch for part in parts]), made)


def _views(
    drawn: _Drawn,
    cameras: Cameras,
    style: Style,
    page: Page,
    depth_cue: float,
    ground: Sequence[float],
) -> Iterator[str]:
    """The elements of all views; of several, a group each, moved to its place."""
    strokes = project(drawn.sketch, cameras)
    for view in range(len(cameras)):
        lines = lines_of(strokes, view, page.size, style.widest)
        prefix = "" if len(cameras) == 1 else f"view-{view}-"
        groups: dict[Group, list[str]] = {}
        for stroke, element in _strokes(drawn, lines, style, page, depth_cue, ground, prefix):
            groups.setdefault(drawn.groups[stroke], []).append(element)
        if len(cameras) == 1:
            yield from layer_elements(groups, prefix)
            return
        x, y = corner(cameras, view)
        yield f'<g id="view-{view}" transform="translate({x},{y})">'
        yield from layer_elements(groups, prefix)
        yield "</g>"


def _strokes(
    drawn: _Drawn,
    lines: list[Line],
    style: Style,
    page: Page,
    depth_cue: float,
    ground: Sequence[float],
    prefix: str,
) -> Iterator[tuple[int, str]]:
    """Strokes of one view and their elements, in the order of the lines."""
    sketch, ids = drawn.sketch, PathIds(prefix, drawn.numbers)
    far = _Distance(lines)
    by_stroke: dict[int, list[Line]] = {}
    for line in lines:
        if line.half_width.max() < THINNEST:
            continue
        if line.half_width.max() > LARGEST * max(page.size):
            wide = 2 * float(line.half_width.max())
            stroke = min(drawn.made[line.stroke])
            raise ValueError(
                f"stroke {stroke} is {wide:.3g} pixels wide in this view, more than {2 * LARGEST} pages: "
                "make its width smaller, or the camera's `near` larger if it passes there"
            )
        by_stroke.setdefault(line.stroke, []).append(line)
    for stroke, some in by_stroke.items():
        layers: list[list[Mark]] = []
        for k, line in enumerate(some):
            thinned = replace(line, half_width=line.half_width * (1 - THIN * depth_cue * far(line.depth)))
            layers.append(style.marks(thinned, page, seed_of(page.seed, stroke, k)))
        fade = FADE * depth_cue * far.mean(some)
        color = [c + fade * (g - c) for c, g in zip(sketch.color[stroke].tolist(), ground, strict=True)]
        paths = [
            _element(mark, color, float(sketch.opacity[stroke]), page.size)
            for marks in zip(*layers, strict=True)
            for mark in marks
        ]
        paths = [path for path in paths if path]
        if not paths:
            continue
        name = f'id="{ids.of(drawn.made[stroke])}"'
        if len(paths) == 1:
            yield stroke, paths[0].replace("<path", f"<path {name}", 1)
        else:
            yield stroke, f"<g {name}>{''.join(paths)}</g>"


class _Distance:
    """How far depths lie between the nearest and the farthest of a view: from 0 to 1."""

    def __init__(self, lines: list[Line]) -> None:
        self.near = min((float(line.depth.min()) for line in lines), default=0.0)
        self.far = max((float(line.depth.max()) for line in lines), default=0.0)

    def __call__(self, depth: Float[Array, " n"]) -> Float[Array, " n"]:
        return (depth - self.near) / max(self.far - self.near, 1e-9)

    def mean(self, lines: list[Line]) -> float:
        """Along the lines of a stroke; of dots, their own."""
        total = sum(line.length for line in lines)
        if total <= 0:
            return float(np.mean([self(line.depth[:1])[0] for line in lines]))
        middles = [np.diff(line.along) @ self((line.depth[1:] + line.depth[:-1]) / 2) for line in lines]
        return float(sum(middles)) / total


def _element(mark: Mark, color: Sequence[float], opacity: float, size: tuple[int, int]) -> str:
    """A path element, cut at the page's border; empty if the page shows nothing of it."""
    path = mark.path
    height, width = size
    if not list(path.segments):
        return ""
    x0, y0, x1, y1 = path.bounds
    if x0 < 0 or y0 < 0 or x1 > width or y1 > height:
        page = pathops().Path()
        page.moveTo(0, 0)
        for corner in ((width, 0), (width, height), (0, height)):
            page.lineTo(*corner)
        page.close()
        path = within(path, page)
    data = svg_data(path)
    if not data:
        return ""
    style = f'fill="{hexadecimal(color)}"'
    if mark.opacity * opacity < 1:
        style += f' fill-opacity="{mark.opacity * opacity:.4g}"'
    if mark.multiplied:
        style += ' style="mix-blend-mode:multiply"'
    return f'<path d="{data}" {style}/>'
