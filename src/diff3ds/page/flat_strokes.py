"""A view as a flat sketch in the page's millimetres: the exact projected curves, cut at the view's border."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import subcurve_matrix
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.page.drawn_paths import TOLERANCE
from diff3ds.page.screen_pieces import Pieces, on_page, screen_pieces
from diff3ds.page.sheet.page_layout import Layout
from diff3ds.project import Strokes2D, project
from diff3ds.sketch import Sketch

# Pixels that a line without width may lie beyond the border.
TOUCHING = 1e-6


class Flat(NamedTuple):
    """A flat sketch, x to the right and y up from the page's lower left corner, and which stroke each of its is of."""

    sketch: Sketch
    strokes: list[int]


def flat_strokes(sketches: Sequence[Sketch], layout: Layout) -> list[Flat]:
    """The centre lines of each view where they lie on the page, as rational cubics at z = 0, float64.

    Args:
        sketches: one a view.
        layout: where the views lie.
    """
    return [_flat(sketch, layout, view) for view, sketch in enumerate(sketches)]


def _flat(sketch: Sketch, layout: Layout, view: int) -> Flat:
    cameras: Cameras = layout.cameras[view]
    strokes = project(sketch.replace(width=0.0), cameras)
    pieces = screen_pieces(strokes, 0, cameras.size, TOLERANCE)
    # What a page is fitted to touches its border, and is not cut there by rounding.
    pieces.points[..., 2] = TOUCHING
    pieces = on_page(pieces, cameras.size)
    curves: list[Tensor] = []
    counts: list[int] = []
    closed: list[bool] = []
    rows: list[int] = []
    for run in _runs(pieces):
        parts = list(_segments(strokes, pieces, run))
        stroke = int(pieces.stroke[run[0]])
        rows.append(stroke)
        counts.append(len(parts))
        closed.append(_closes(strokes, pieces, run, stroke))
        curves += parts
    control = torch.stack(curves) if curves else torch.zeros(0, 4, 3, dtype=torch.float64)
    weights = control[..., 2]
    (x, y), scale = layout.corners[view], 1 / layout.per_mm
    across = (control[..., 0] / weights + x) * scale
    up = layout.size[1] * scale - (control[..., 1] / weights + y) * scale
    points = torch.stack([across, up, torch.zeros_like(up)], -1)
    looks = sketch[rows].to(torch.float64)
    flat = Sketch(
        points,
        weights / weights[:, :1],
        color=looks.color,
        chains=Chains.of(counts, closed),
        names=looks.names,
        kinds=looks.kinds,
    )
    return Flat(flat, rows)


def _runs(pieces: Pieces) -> Iterator[list[int]]:
    """Rows of pieces that follow on each other."""
    run: list[int] = []
    for row in range(len(pieces.stroke)):
        if run and (pieces.stroke[row] != pieces.stroke[run[-1]] or pieces.start[row] != pieces.stop[run[-1]]):
            yield run
            run = []
        run.append(row)
    if run:
        yield run


def _segments(strokes: Strokes2D, pieces: Pieces, run: list[int]) -> Iterator[Float[Tensor, "4 3"]]:
    """What a run shows of each segment, as homogeneous control points; in pieces where weights are negative."""
    by_segment: dict[int, list[int]] = {}
    for row in run:
        by_segment.setdefault(int((pieces.start[row] + pieces.stop[row]) / 2), []).append(row)
    for segment, rows in by_segment.items():
        control = strokes.cubics[0, segment, :, :3].double()

        def part(first: int, last: int, of: int = segment, control: Tensor = control) -> Tensor:
            ends = pieces.start[first, None] - of, pieces.stop[last, None] - of
            return (subcurve_matrix(*ends, 3) @ control)[0]

        whole = part(rows[0], rows[-1])
        yield from [whole] if bool((whole[:, 2] > 0).all()) else [part(row, row) for row in rows]


def _closes(strokes: Strokes2D, pieces: Pieces, run: list[int], stroke: int) -> bool:
    """Whether a run is all of a closed stroke."""
    chains = strokes.chains
    if chains is None or not bool(chains.closed[stroke]):
        return False
    ends = float(pieces.start[run[0]]), float(pieces.stop[run[-1]])
    return ends == (float(chains.first[stroke]), float(chains.first[stroke + 1]))
