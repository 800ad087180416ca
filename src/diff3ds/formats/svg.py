"""SVG files: views of a sketch as vector paths, one path a stroke."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import torch

from diff3ds._files import write_text
from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import subcurve_matrix
from diff3ds.camera import Cameras
from diff3ds.formats.png import grid_columns
from diff3ds.formats.screen_pieces import Pieces, screen_pieces
from diff3ds.project import Strokes2D, project
from diff3ds.sketch import Sketch

# Pixels. An edge that is off by this changes a pixel by as much at most: 13 of 255.
TOLERANCE = 0.05


def save_svg(
    path: str | Path,
    sketch: Sketch,
    cameras: Cameras,
    *,
    background: Sequence[float] | None = (1.0, 1.0, 1.0),
    width_mm: float | None = None,
) -> None:
    """Writes the views of all cameras, side by side in a grid that is about square; whole or not at all.

    Every stroke is one path with round ends and the id "stroke-0", "stroke-1" and so on, by its number in the sketch;
    of several views "view-0-stroke-0". With `width_space="image"` it is a stroked path of cubic Béziers: SVG knows no
    rational ones, so it stays within `TOLERANCE` (.05 px, guaranteed) of the exact curve. With "world", or widths along
    the stroke, it is the filled outline of discs swept along chords, to the same tolerance. What a view cannot show is
    left out: paths are cut where their ink leaves the page.

    SVG has no depth: whole strokes lie over each other in the order of their mean depth. Where the order of two strokes
    changes along them, as in a knot, the file cannot show it. Colours are clamped to [0, 1] and rounded to 8 bits.

    Args:
        background: RGB in [0, 1], or None for a transparent one.
        width_mm: of the page on paper, millimetres; without it a pixel is what the program takes for one.

    Raises:
        ValueError: no cameras, sketch and cameras on different devices, a background that is no colour, or a width that
            is not positive.
        OSError: the file cannot be written.
    """
    if len(cameras) == 0:
        raise ValueError("an SVG file needs at least one view, got none")
    if background is not None and len(background) != 3:
        raise ValueError(f"background must be three numbers in [0, 1] or None, got {background}")
    sketch = sketch.detach()
    sketch.check_values()
    if width_mm is not None and not 0 < width_mm < math.inf:
        raise ValueError(f"width_mm must be positive, got {width_mm}")
    columns = grid_columns(len(cameras))
    height, width = cameras.size
    page = columns * width, math.ceil(len(cameras) / columns) * height
    unit, scale = ("", 1.0) if width_mm is None else ("mm", width_mm / page[0])
    size = f'width="{page[0] * scale:.6g}{unit}" height="{page[1] * scale:.6g}{unit}"'
    size += f' viewBox="0 0 {page[0]} {page[1]}"'
    ground = ""
    if background is not None:
        ground = f'<rect width="{page[0]}" height="{page[1]}" fill="{_hex(background)}"/>\n'
    views = "\n".join(_views(project(sketch, cameras), cameras.size, columns))
    write_text(Path(path), f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{ground}{views}\n</svg>\n')


def _views(strokes: Strokes2D, size: tuple[int, int], columns: int) -> Iterator[str]:
    """The elements of all views; of several, a group each, which keeps the ink of a view off its neighbours."""
    height, width = size
    count = len(strokes.cubics)
    for view in range(count):
        pieces = _on_page(screen_pieces(strokes, view, size, TOLERANCE), size)
        if count == 1:
            yield from _paths(strokes, pieces, "")
            return
        row, column = divmod(view, columns)
        corner = column * width, row * height
        moved = pieces.points + pieces.points.new_tensor([*corner, 0.0])
        place = f'x="{corner[0]}" y="{corner[1]}" width="{width}" height="{height}"'
        yield f'<clipPath id="page-{view}"><rect {place}/></clipPath>'
        yield f'<g id="view-{view}" clip-path="url(#page-{view})">'
        yield from _paths(strokes, pieces._replace(points=moved), f"view-{view}-")
        yield "</g>"


def _on_page(pieces: Pieces, size: tuple[int, int]) -> Pieces:
    """The pieces, cut where their discs leave the page; what lies beyond is left out."""
    limit = pieces.points.new_tensor([size[1], size[0]])
    reach = pieces.points[..., 2].amax(1)
    inside = (pieces.points[..., :2] >= -reach[:, None, None]) & (
        pieces.points[..., :2] <= limit + reach[:, None, None]
    )
    out = (~inside.flatten(1).all(1)).nonzero()[:, 0]
    if not len(out):
        return pieces
    low, high = -reach[out, None], limit + reach[out, None]
    # Where the coordinates of a piece, cubics of its parameter, are those of a border.
    control = pieces.points[out, :, :2]
    borders = [control[..., axis] - border[:, axis, None] for axis in (0, 1) for border in (low.expand(-1, 2), high)]
    crossings = [
        torch.tensor([0.0, *sorted(_roots(torch.stack([b[i] for b in borders]))), 1.0], dtype=control.dtype)
        for i in range(len(out))
    ]
    rows = torch.repeat_interleave(out, torch.tensor([len(c) - 1 for c in crossings]))
    start, stop = torch.cat([c[:-1] for c in crossings]), torch.cat([c[1:] for c in crossings])
    parts = subcurve_matrix(start, stop, 3) @ pieces.points[rows]
    span = pieces.stop[rows] - pieces.start[rows]
    cut = Pieces(
        pieces.stroke[rows],
        pieces.start[rows] + start * span,
        torch.where(stop == 1, pieces.stop[rows], pieces.start[rows] + stop * span),
        parts,
        pieces.depth[rows],
    )
    middle = (parts[:, :, :2] * parts.new_tensor([1.0, 3.0, 3.0, 1.0])[:, None]).sum(1) / 8
    shown = ((middle >= -reach[rows, None]) & (middle <= limit + reach[rows, None])).all(1)
    whole = torch.ones(len(pieces.stroke), dtype=torch.bool)
    whole[out] = False
    kept = Pieces(*(torch.cat([a[whole], b[shown]]) for a, b in zip(pieces, cut, strict=True)))
    order = kept.start.argsort(stable=True)
    order = order[kept.stroke[order].argsort(stable=True)]
    return Pieces(*(column[order] for column in kept))


def _roots(cubics: Float[Tensor, "B 4"]) -> set[float]:
    """Where cubics in Bernstein form are zero, in (0, 1)."""
    b0, b1, b2, b3 = cubics.unbind(-1)
    power = torch.stack([b3 - 3 * b2 + 3 * b1 - b0, 3 * (b2 - 2 * b1 + b0), 3 * (b1 - b0), b0], -1).numpy()
    found: set[float] = set()
    for row in power:
        scale = abs(row).max()
        # Of a line the first coefficients are rounding, and would make roots far away.
        row = np.where(abs(row) > 1e-12 * scale, row, 0) if scale > 0 else row
        roots = np.roots(row)
        found |= {float(r.real) for r in roots if abs(r.imag) < 1e-9 and 0 < r.real < 1}
    return found


def _paths(strokes: Strokes2D, pieces: Pieces, prefix: str) -> list[str]:
    """The path elements of one view, far ones first; among equals the last first, as `render` has it.

    Args:
        prefix: of their ids.
    """
    count = len(strokes.color)
    shown = torch.bincount(pieces.stroke, minlength=count)
    depth = torch.zeros(count, dtype=torch.float64, device=shown.device).index_add(0, pieces.stroke, pieces.depth)
    depth = depth / shown
    visible = shown.nonzero()[:, 0].tolist()
    rows = dict(zip(visible, torch.split(torch.arange(len(pieces.stroke)), shown[visible].tolist()), strict=True))
    elements = []
    for stroke in sorted(visible, key=lambda s: (float(depth[s]), s), reverse=True):
        color, opacity = _hex(strokes.color[stroke].tolist()), float(strokes.opacity[stroke])
        name = f'id="{prefix}stroke-{stroke}"'
        some = Pieces(*(column[rows[stroke]] for column in pieces))
        if strokes.width_space == "image" and strokes.half_width.ndim == 2:
            width = _number(2 * float(some.points[0, 0, 2]))
            style = (
                f'fill="none" stroke="{color}" stroke-width="{width}" stroke-linecap="round" stroke-linejoin="round"'
            )
            style += f' stroke-opacity="{opacity:.6g}"' if opacity < 1 else ""
            elements.append(f'<path {name} d="{_centre_line(some, _closes(strokes, stroke, some))}" {style}/>')
        else:
            style = f'fill="{color}"' + (f' fill-opacity="{opacity:.6g}"' if opacity < 1 else "")
            elements.append(f'<path {name} d="{_outline(some.points)}" {style}/>')
    return elements


def _closes(strokes: Strokes2D, stroke: int, pieces: Pieces) -> bool:
    """Whether the pieces of a stroke run round without a gap."""
    chains = strokes.chains
    if chains is None or not bool(chains.closed[stroke]):
        return False
    whole = (pieces.start[1:] == pieces.stop[:-1]).all()
    return bool(whole & (pieces.start[0] == chains.first[stroke]) & (pieces.stop[-1] == chains.first[stroke + 1]))


def _centre_line(pieces: Pieces, closed: bool) -> str:
    """Path data of cubic Béziers, broken where pieces are not joined."""
    data, stop = [], None
    for start, next_stop, points in zip(
        pieces.start.tolist(), pieces.stop.tolist(), pieces.points[..., :2].tolist(), strict=True
    ):
        if start != stop:
            data.append("M" + _pair(*points[0]))
        data.append("C" + " ".join(_pair(*p) for p in points[1:]))
        stop = next_stop
    return "".join(data) + ("Z" if closed else "")


def _outline(points: Float[Tensor, "P 4 3"]) -> str:
    """Path data of the discs swept along chords; all turn the same way round, so that overlaps fill once."""
    return "".join(_swept_disc(*first, *last) for first, last in points[:, [0, 3]].tolist())


def _swept_disc(x0: float, y0: float, r0: float, x1: float, y1: float, r1: float) -> str:
    """The hull of two discs: two common tangents and two arcs, or the larger disc if it holds the other."""
    distance = math.hypot(x1 - x0, y1 - y0)
    if distance <= abs(r1 - r0):
        x, y, r = (x0, y0, r0) if r0 > r1 else (x1, y1, r1)
        ends = (x + r, y), (x - r, y)
        return f"M{_pair(*ends[0])}{_arc(r, False, *ends[1])}{_arc(r, False, *ends[0])}Z"
    ux, uy = (x1 - x0) / distance, (y1 - y0) / distance
    # The normals of the tangents: along the axis the sine of their slope, across it the cosine.
    sine = (r0 - r1) / distance
    cosine = math.sqrt(1 - sine**2)
    ax, ay = ux * sine - uy * cosine, uy * sine + ux * cosine
    bx, by = ux * sine + uy * cosine, uy * sine - ux * cosine
    return (
        f"M{_pair(x0 + r0 * ax, y0 + r0 * ay)}L{_pair(x1 + r1 * ax, y1 + r1 * ay)}"
        f"{_arc(r1, r1 > r0, x1 + r1 * bx, y1 + r1 * by)}"
        f"L{_pair(x0 + r0 * bx, y0 + r0 * by)}{_arc(r0, r0 > r1, x0 + r0 * ax, y0 + r0 * ay)}Z"
    )


def _arc(radius: float, large: bool, x: float, y: float) -> str:
    return f"A{_number(radius)} {_number(radius)} 0 {int(large)} 0 {_pair(x, y)}"


def _pair(x: float, y: float) -> str:
    return f"{_number(x)},{_number(y)}"


def _number(value: float) -> str:
    """To a thousandth of a pixel."""
    return f"{value:.3f}".rstrip("0").rstrip(".")


def _hex(color: Sequence[float]) -> str:
    return "#" + "".join(f"{round(min(max(float(c), 0.0), 1.0) * 255):02x}" for c in color)
