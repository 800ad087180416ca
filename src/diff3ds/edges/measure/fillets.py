"""Arcs between two lines that meet them smoothly, made exactly tangent: the rounded corners of a drawing."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves, sampled
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.curves.shapes.smooth_joints import TURN
from diff3ds.curves.shapes.straight_lines import meeting, outward_tangent, resampled
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import SAMPLES, crowded, inliers
from diff3ds.edges.measure.equal_radii import agreed
from diff3ds.edges.measure.offsets import STEP_ALONG, Shape, fitted, near_joints

# [px; empirical] An arc and a line that go on in each other are meant to be tangent; for that, the arc moves to the
# side by at most so much.
MOST_MOVE = 0.7
# [rounds; empirical] Two fillets share a line, so that each moves the other a little; it settles fast.
ROUNDS = 12
# [parts; empirical] Parts of an arc that are measured, each with the samples of a part.
ARC_PARTS = 3
# [px; numerical] Spacing of samples for distances.
DENSE = 0.2
# [px; measured] Scatter of the radii of rounded corners: root mean square of 196 of 70 generated parts, clipped at a
# pixel.
SCATTER = 0.15
# [ratio; empirical] Lengths of a fillet's tangents to try, in parts of the longer way from the lines' common point to
# where they end.
GUESSES = np.linspace(0.3, 1.3, 51)


@dataclass(frozen=True)
class Fillet:
    """An arc, and for each of its ends the line that it meets, with the end of the line (0 or 1) there."""

    arc: int
    lines: tuple[int, int]
    ends: tuple[int, int]

    def away(self, points: Float[Array, "N 4 3"]) -> list[Array]:
        """The other ends of the lines."""
        return [points[line][3 if end == 0 else 0] for line, end in zip(self.lines, self.ends, strict=True)]


def with_fillets(curves: Curves, views: EdgeViews, outward: float) -> Curves:
    """Curves whose arcs between two lines meet both of them at no angle, wherever they nearly do.

    The tangents from the lines' common point to a circle are equally long; so are those of the new arc, and its ends
    lie on the lines. How long they are is measured in the views.

    Args:
        outward: offset of outlines that the detector has, pixels.
    """
    start = curves.constrained(curves.points)[0].double().numpy()
    fillets = fillets_of(curves, start)
    old = sampled(curves)
    while fillets:
        points = start.copy()
        lengths = [_guessed(points, fillet, old[fillet.arc]) for fillet in fillets]
        _settle(points, fillets, lengths)
        lengths = [_measured(points, fillet, views, outward) for fillet in fillets]
        _settle(points, fillets, lengths)
        _settle(points, fillets, _alike(points, fillets, lengths, views.pixel))
        kind = curves.kind.clone()
        kind[[fillet.arc for fillet in fillets]] = int(Kind.ARC)
        smooth = replace(curves, points=torch.from_numpy(points).to(curves.points.dtype), kind=kind)
        moved = [_beside(curves, smooth, fillet, views.pixel) for fillet in fillets]
        if max(moved) <= MOST_MOVE:
            return smooth
        fillets = [f for f, move in zip(fillets, moved, strict=True) if move <= MOST_MOVE]
    return curves


def _alike(
    points: Float[Array, "N 4 3"], fillets: list[Fillet], lengths: list[float | None], pixel: float
) -> list[float | None]:
    """The tangents' lengths for which nearly equal radii are equal."""
    halves = [np.arccos(np.clip(np.dot(*_ways(points, fillet)), -1, 1)) / 2 for fillet in fillets]
    known = [k for k, length in enumerate(lengths) if length is not None]
    radii = agreed([float(lengths[k] * np.tan(halves[k])) for k in known], SCATTER * pixel)
    found = list(lengths)
    for k, radius in zip(known, radii, strict=True):
        found[k] = radius / float(np.tan(halves[k]))
    return found


def _ways(points: Float[Array, "N 4 3"], fillet: Fillet) -> list[Array]:
    """Unit vectors along the lines, away from where they would meet."""
    near = [points[fillet.arc][0], points[fillet.arc][3]]
    return [unit(f - n) for f, n in zip(fillet.away(points), near, strict=True)]


def _beside(old: Curves, new: Curves, fillet: Fillet, pixel: float) -> float:
    """How far the new arc lies from the old arc and lines, pixels: along them its ends are free to move."""
    from scipy.spatial import cKDTree

    before = sampled(old)[[fillet.arc, *fillet.lines]]
    dense = np.concatenate([resampled(line, DENSE * pixel) for line in before])
    return float(cKDTree(dense).query(sampled(new)[fillet.arc])[0].max()) / pixel


def _settle(points: Float[Array, "N 4 3"], fillets: list[Fillet], lengths: Sequence[float | None]) -> None:
    """Makes all fillets tangent, in place."""
    for _ in range(ROUNDS):
        for fillet, length in zip(fillets, lengths, strict=True):
            _make_tangent(points, fillet, length)


def fillets_of(curves: Curves, points: Float[Array, "N 4 3"]) -> list[Fillet]:
    """The arcs that nearly touch a line at both ends, where nothing else meets."""
    vertex = curves.vertex.numpy()
    found = []
    bent = (curves.kind == Kind.ARC) | (curves.kind == Kind.FREE)
    for arc in np.nonzero(bent.numpy())[0]:
        met = []
        for end in (0, 1):
            curve, at = np.nonzero(vertex == vertex[arc, end])
            others = [(int(c), int(e)) for c, e in zip(curve, at, strict=True) if c != arc]
            if len(others) == 1 and int(curves.kind[others[0][0]]) == Kind.LINE:
                out = outward_tangent(points[others[0][0]], others[0][1])
                into = -outward_tangent(points[arc], end)
                if out @ into > np.cos(TURN):
                    met.append(others[0])
        if len(met) == 2 and met[0][0] != met[1][0]:
            found.append(Fillet(int(arc), (met[0][0], met[1][0]), (met[0][1], met[1][1])))
    return found


def _guessed(points: Float[Array, "N 4 3"], fillet: Fillet, old: Float[Array, "S 3"]) -> float | None:
    """The tangents' length for which the rounded corner lies nearest to what was there; None between parallels.

    The ends of an arc alone say little: whether a line goes on for a few pixels more makes hardly a difference.
    """
    far = fillet.away(points)
    near = [points[fillet.arc][0], points[fillet.arc][3]]
    corner = meeting(far, near)
    if corner is None:
        return None
    ways = [unit(f - corner) for f in far]
    longest = max(float(np.linalg.norm(n - corner)) for n in near)
    lengths = longest * GUESSES
    return float(min(lengths, key=lambda length: (_off_corner(old - corner, ways, length) ** 2).mean()))


def _off_corner(x: Float[Array, "S 3"], ways: list[Array], length: float) -> Float[Array, " S"]:
    """Distances from a corner at the origin between lines along two unit vectors, rounded from this length on."""
    along = np.stack([x @ way for way in ways], 1)
    side = along.argmax(1)
    beside = np.linalg.norm(x - along.max(1)[:, None] * np.stack(ways)[side], axis=1)
    half = np.arccos(np.clip(ways[0] @ ways[1], -1, 1)) / 2
    offset = x - length / np.cos(half) * unit(ways[0] + ways[1])
    height = offset @ unit(np.cross(ways[0], ways[1]))
    around = np.hypot(np.sqrt(np.maximum((offset**2).sum(1) - height**2, 0)) - length * np.tan(half), height)
    return np.where(along.max(1) > length, beside, around)


def _make_tangent(points: Float[Array, "N 4 3"], fillet: Fillet, length: float | None) -> None:
    """Moves the ends of the arc along its lines, and bends it, in place; by default to their mean from the corner."""
    far = fillet.away(points)
    near = [points[fillet.arc][0], points[fillet.arc][3]]
    corner = meeting(far, near)
    if corner is None:
        return
    length = length or float(np.mean([np.linalg.norm(corner - p) for p in near]))
    ends = [corner + length * unit(f - corner) for f in far]
    for (line, end), place, away in zip(zip(fillet.lines, fillet.ends, strict=True), ends, far, strict=True):
        stops = (place, away) if end == 0 else (away, place)
        points[line] = stops[0] + np.linspace(0, 1, 4)[:, None] * (stops[1] - stops[0])
    points[fillet.arc] = tangent_arc(corner, [unit(f - corner) for f in far], length)


def _measured(points: Float[Array, "N 4 3"], fillet: Fillet, views: EdgeViews, outward: float) -> float | None:
    """The tangents' length that agrees best with the ridges along the arc and the lines beside it, if they say any."""
    far = fillet.away(points)
    near = [points[fillet.arc][0], points[fillet.arc][3]]
    corner = meeting(far, near)
    if corner is None:
        return None
    length = float(np.linalg.norm(near[0] - corner))
    ways = [unit(f - corner) for f in far]
    beside = [min(length, float(np.linalg.norm(f - n))) for f, n in zip(far, near, strict=True)]
    shape = _rounded_corner(corner, ways, length, beside, STEP_ALONG * views.pixel)
    before, x, after = shape(np.zeros(4))
    tangents = unit(after - before)
    shown = inliers(views, x, tangents)
    shown &= ~crowded(views, x, tangents, at=shown)
    joints = near_joints(x, np.stack([corner + length * way for way in ways]), views.pixel)
    inside = corner + 2 * length * (ways[0] + ways[1])
    found = float(fitted(shape, 4, inside, shown, views, outward, joints=joints)[3])
    # The arc of a right angle moves by √2 - 1 of that.
    return length + found if abs(found) < MOST_MOVE / (np.sqrt(2) - 1) * views.pixel else None


def _rounded_corner(corner: Array, ways: list[Array], length: float, beside: list[float], step: float) -> Shape:
    """Places along line, arc and line by a displacement of the corner and a change of the tangents' length."""
    along = (np.arange(SAMPLES) + 0.5) / SAMPLES
    turns = (np.arange(ARC_PARTS * SAMPLES) + 0.5) / (ARC_PARTS * SAMPLES)
    opening = np.arccos(np.clip(ways[0] @ ways[1], -1, 1))
    out, across = -unit(ways[0] + ways[1]), unit(ways[1] - ways[0])

    def moved(value: Float[Array, " 4"]) -> Float[Array, "3 S 3"]:
        at, tangent = corner + value[:3], length + value[3]
        radius = tangent * np.tan(opening / 2)
        center = at - radius / np.sin(opening / 2) * out
        first, second = (at + (tangent + b * along)[:, None] * w for b, w in zip(beside, ways, strict=True))
        rows = []
        for s in (-step, 0.0, step):
            angle = ((turns - 0.5) * (np.pi - opening) + s / radius)[:, None]
            arc = center + radius * (np.cos(angle) * out + np.sin(angle) * across)
            rows.append(np.concatenate([first[::-1] - s * ways[0], arc, second + s * ways[1]]))
        return np.stack(rows)

    return moved


def tangent_arc(corner: Float[Array, " 3"], ways: list[Array], length: float) -> Float[Array, "4 3"]:
    """Control points of the arc that touches two lines so far from where they meet.

    Args:
        ways: unit vectors along the lines, away from the corner.
    """
    ends = [corner + length * way for way in ways]
    weight = np.linalg.norm(ends[1] - ends[0]) / (2 * length)
    inner = [(end + 2 * weight * corner) / (1 + 2 * weight) for end in ends]
    return np.stack([ends[0], inner[0], inner[1], ends[1]])
