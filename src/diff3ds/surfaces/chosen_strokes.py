"""The strokes that say most about a surface from all sides: its feature curves, and contours from some directions.

A smooth thing has no line that is there from everywhere, but a drawing of it in space has: outlines from the front,
from the side, from above, as one bends them of wire. Candidates are the feature curves and the visible contours from
six sides and eight corners. Drawings of the surface from there are what is to be shown; one candidate after the other
is taken, each time the one that shows most of what was not yet shown, less what it draws where no line is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.page.parts import cut_sketch
from diff3ds.sketch import PLAIN, Sketch
from diff3ds.surfaces.draw import Lines, lines_for_pixels
from diff3ds.surfaces.hidden.visibility import FOR_MEASURES
from diff3ds.surfaces.line_drawings import LinePoints, points_along, sides_and_corners
from diff3ds.surfaces.shape.coarse import without_specks
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# A line is shown by a stroke that lies so near, pixels, in its direction: a quarter turn counts as so many pixels. A
# stroke is false where no line lies so near. Empirical, as all that follows.
NEAR, TURNED, FALSE = 1.5, 4.0, 3.0
# So much the false length of a stroke counts against what it shows.
AGAINST = 0.4
# The least that a stroke must show, as a share of all lines of all drawings; less what counts against it where nobody
# has asked for so many.
LEAST = 0.002
# Contours shorter than this share of the surface's size are no candidates.
SHORT = 0.05


@dataclass(frozen=True, eq=False)
class ChosenStrokes:
    """Strokes in the order in which they were taken.

    Attributes:
        sketch: float64, black, of the default width.
        kinds: of each stroke: what the caller has called it, or "contour".
        shown: the share of the lines of all drawings that this one and those before it show, in [0, 1].
    """

    sketch: Sketch
    kinds: tuple[str, ...]
    shown: tuple[float, ...]


def choose_strokes(
    mesh: TriangleMesh,
    features: Sketch,
    kinds: Sequence[str],
    count: int,
    keep: bool,
    report: Callable[[int, int], None] = lambda done, of: None,
) -> ChosenStrokes:
    """Chooses strokes of a surface.

    Args:
        mesh: what is drawn.
        features: its feature curves.
        kinds: what each of these is.
        count: strokes at most; fewer where more show nothing.
        keep: whether all features are taken first, whatever they show, and do not count; then there are fewer strokes
            where more would draw most where no line is.
        report: told the drawings that are done, and their number.
    """
    cameras = sides_and_corners(mesh)
    targets, found, whose = [], [features.to(torch.float64)], [*kinds]

    def drawn(lines: Lines, view: int) -> tuple[LinePoints, Sketch]:
        contours = without_specks(lines.strokes(True, "contour"), SHORT * mesh.size)
        return points_along(lines.strokes(True), lines.cameras), contours

    drawings = lines_for_pixels(
        drawn,
        features.to(torch.float64),
        cameras,
        mesh,
        FOR_MEASURES,
        kinds=kinds,
        told=lambda done: report(done, 2 * len(cameras)),
    )
    for target, contours in drawings:
        targets.append(target)
        found.append(contours)
        whose += ["contour"] * len(contours)
    candidates = Sketch.concatenate([sketch.detach().replace(**PLAIN, opacity=1.0) for sketch in found])
    shows, false = [], np.zeros(len(candidates))

    def compared(lines: Lines, view: int) -> tuple[Bool[Mask, "N P"], Float[Array, " N"]]:
        parts = lines.parts[lines.parts.visible]
        seen, owner = cut_sketch(candidates, parts.segment, parts.start, parts.stop)
        return _compared(targets[view], points_along(seen, lines.cameras, owner), len(candidates))

    tries = lines_for_pixels(
        compared,
        candidates,
        cameras,
        mesh,
        FOR_MEASURES,
        contours=False,
        told=lambda done: report(len(cameras) + done, 2 * len(cameras)),
    )

    for shown, wrong in tries:
        shows.append(shown)
        false += wrong
    weights = np.concatenate([target.weight for target in targets])
    order, share = _greedy(np.concatenate(shows, 1), weights, false, count, len(features) if keep else None)
    strokes = candidates[torch.from_numpy(order)]
    return ChosenStrokes(strokes, tuple(whose[i] for i in order), tuple(share.tolist()))


def _compared(target: LinePoints, strokes: LinePoints, count: int) -> tuple[Bool[Mask, "N P"], Float[Array, " N"]]:
    """Which points of a drawing each of so many strokes shows, and how much of it is false, pixels."""
    from scipy.spatial import cKDTree

    shown: NDArray[np.bool_] = np.zeros((count, len(target.place)), bool)
    false = np.zeros(count)
    if not len(strokes.place):
        return shown, false
    if not len(target.place):
        return shown, np.bincount(strokes.stroke, strokes.weight, count).astype(np.float64)
    lines = cKDTree(_turned(target))
    near = lines.query_ball_point(_turned(strokes), NEAR)
    counts = np.array([len(found) for found in near])
    if counts.any():
        shown[np.repeat(strokes.stroke, counts), np.concatenate([np.array(f, np.int64) for f in near])] = True
    away, _ = cKDTree(target.place).query(strokes.place)
    wrong = away > FALSE
    return shown, np.bincount(strokes.stroke[wrong], strokes.weight[wrong], count).astype(np.float64)


def _turned(points: LinePoints) -> Float[Array, "P 4"]:
    """Places, and directions of either sign as points on a circle, `TURNED` across."""
    x, y = points.direction.T
    return np.column_stack([points.place, TURNED / 2 * (x**2 - y**2), TURNED * x * y])


def _greedy(
    shows: Bool[Mask, "N P"], weights: Float[Array, " P"], false: Float[Array, " N"], count: int, kept: int | None
) -> tuple[Int[Index, " M"], Float[Array, " M"]]:
    """The candidates that are taken, and the share that they and those before them show."""
    whole = max(float(weights.sum()), 1e-12)
    first = kept or 0
    order = [*range(first)]
    left = np.where(shows[:first].any(0), 0.0, weights)
    share = [1 - float(left.sum()) / whole] * first
    held = np.zeros(len(shows), bool)
    held[:first] = True
    new = shows @ left
    for _ in range(min(count, len(shows) - first)):
        gain = new - AGAINST * false
        gain[held | (new < LEAST * whole)] = -np.inf
        best = int(gain.argmax())
        if gain[best] == -np.inf or (kept is not None and gain[best] < LEAST * whole):
            break
        held[best] = True
        order.append(best)
        taken = np.flatnonzero(shows[best] & (left > 0))
        new = new - shows[:, taken] @ left[taken]
        left[taken] = 0
        share.append(1 - float(left.sum()) / whole)
    return np.array(order, np.int64), np.array(share)
