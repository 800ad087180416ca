"""Fewer, longer, fairer curves: weak and doubled ones dropped, neighbours that are one curve joined."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves, curves_of, sampled
from diff3ds.curves.shapes.ellipses import JOINED, fit_elliptic_arcs
from diff3ds.curves.shapes.primitives import CLOSED_KINDS, FREEDOM, Kind, Primitive
from diff3ds.curves.shapes.simplest import near_enough, simplest
from diff3ds.curves.shapes.straight_lines import pairs_by_ends, resampled
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import mean_of_segments, part_support
from diff3ds.edges.watch import Tick, no_tick

# [px, fraction; empirical] A curve doubles longer ones if this fraction of it lies so near to them.
DOUBLED, DOUBLED_SHARE = 1.2, 0.9
# [px, cosine; empirical] Ends at most so far apart may continue each other, if their tangents agree and one curve fits
# both.
GAP, STRAIGHT_ON = 4.0, 0.96
# [px; numerical] Spacing of the points along curves where doubled ones are looked for.
SPACING = 0.3
# [rad; empirical] An arc that turns by more than this beside a line is a rounded corner.
CORNER = np.deg2rad(60.0)
# [cosine; derived] A narrow ellipse turns its tip within the gap, by up to a right angle.
TIP = 0.0


def pruned(curves: Curves, views: EdgeViews, min_views: float, shortest: float, doubled: float = DOUBLED) -> Curves:
    """Without curves that too few views show, that are too short, or that lie along longer ones.

    Args:
        min_views: so many views have to show a curve, mean over its parts.
        shortest: pixels.
        doubled: so near lies what lies along a curve, pixels.
    """
    support = mean_of_segments(curves, part_support(views, curves).double().sum(0).mean(1)).numpy()
    samples = sampled(curves)
    length = np.linalg.norm(np.diff(samples, axis=1), axis=2).sum(1)
    keep = (support >= min_views) & (length >= shortest * views.pixel)
    from scipy.spatial import cKDTree

    order = [int(i) for i in np.argsort(-length, kind="stable") if keep[i]]
    dense = [resampled(samples[i], SPACING * views.pixel) for i in order]
    if not dense:
        return curves[torch.from_numpy(keep)]
    rank = np.repeat(np.arange(len(order)), [len(line) for line in dense])
    tree = cKDTree(np.concatenate(dense))
    # Of longer curves those that stay: what doubles another goes, and doubles nothing itself.
    longer = np.zeros(len(order), bool)
    for place, i in enumerate(order):
        near = tree.query_ball_point(samples[i], doubled * views.pixel)
        along = [longer[rank[np.asarray(places, np.int64)]].any() for places in near]
        keep[i] = longer[place] = np.mean(along) < DOUBLED_SHARE
    return curves[torch.from_numpy(keep)]


@dataclass(frozen=True, eq=False)
class _Piece:
    """Points along an edge and the curve that it is: one, or two arcs of most of a circle or ellipse."""

    curves: list[Primitive]
    points: Float[Array, "M 3"]

    @property
    def closed(self) -> bool:
        """Whether this is a whole circle or ellipse."""
        return bool(self.curves) and self.curves[0].kind in CLOSED_KINDS

    @property
    def price(self) -> int:
        """Free numbers."""
        return FREEDOM[self.curves[0].kind]


@dataclass(frozen=True, eq=False)
class _Joint:
    """Pieces that one curve fits; the best joints save most free numbers."""

    price: float
    members: tuple[int, ...]
    piece: _Piece


@dataclass(frozen=True)
class Gaps:
    """Which gaps are closed.

    Attributes:
        most: how far ends may be apart, pixels.
        within: so near to the one curve lie nearly all points of both, pixels.
        closed: called with both ends of a gap.
    """

    most: float = GAP
    within: float = JOINED
    closed: Callable[[Float[Array, " 3"], Float[Array, " 3"]], bool] = lambda one, other: True


SHORT = Gaps()


def joined(curves: Curves, pixel: float, tick: Tick = no_tick, gaps: Gaps = SHORT) -> Curves:
    """Curves that continue each other become one, best fits first, until none does; arcs may close to circles."""
    pieces = _pieces(curves, pixel)
    alive = set(range(len(pieces)))
    near = _neighbours(pieces, sorted(alive), gaps.most * pixel)
    joints = [j for k, i in near if (j := _joint(pieces, i, k, pixel, gaps)) is not None]
    tried: dict[tuple[int, ...], _Joint | None] = {}
    while joints or (joints := _elliptic_joints(pieces, sorted(alive), pixel, tried)):
        tick(len(pieces) - len(curves), len(curves))
        best = min(joints, key=lambda joint: (joint.price, joint.members))
        alive -= set(best.members)
        joints = [j for j in joints if alive.issuperset(j.members)]
        pieces.append(best.piece)
        new = len(pieces) - 1
        near_ends = _near_ends(pieces, best.piece.points, sorted(alive), gaps.most * pixel)
        joints += [j for k in near_ends if (j := _joint(pieces, new, k, pixel, gaps)) is not None]
        alive.add(new)
    return curves_of([curve for i in sorted(alive) for curve in pieces[i].curves])


def _ends(pieces: list[_Piece], rows: list[int]) -> Float[Array, "M 2 3"]:
    """First and last points of pieces."""
    return np.array([pieces[i].points[[0, -1]] for i in rows]).reshape(-1, 2, 3)


def _neighbours(pieces: list[_Piece], rows: list[int], gap: float) -> list[tuple[int, int]]:
    """Pairs of pieces with ends so near that one may continue the other, the smaller number first."""
    return [(rows[i], rows[k]) for i, k in pairs_by_ends(_ends(pieces, rows), gap)]


def _near_ends(pieces: list[_Piece], points: Float[Array, "M 3"], rows: list[int], gap: float) -> list[int]:
    """Pieces that end so near to an end of these points that one may continue the other."""
    off = np.linalg.norm(_ends(pieces, rows)[:, :, None] - points[[0, -1]], axis=3).min((1, 2))
    return [rows[i] for i in np.nonzero(off <= gap)[0]]


def _elliptic_joints(
    pieces: list[_Piece], alive: list[int], pixel: float, tried: dict[tuple[int, ...], _Joint | None]
) -> list[_Joint]:
    """Pieces in a row that one ellipse fits: three where two say too little, or two that meet at a narrow tip.

    At most one of them is straight: an arc between lines is a rounded corner.

    Args:
        tried: what came of the rows that were tried before; more are added.
    """
    kind = {i: pieces[i].curves[0].kind for i in alive}
    rows: list[tuple[tuple[int, ...], Array]] = []
    for i, k in _neighbours(pieces, alive, GAP * pixel):
        half = Kind.ELLIPTIC_ARC in (kind[i], kind[k])
        two = _continued(pieces[i], pieces[k], pixel, TIP if half else STRAIGHT_ON)
        if two is None:
            continue
        if half:
            rows.append(((i, k), two))
        near = [m for m in _near_ends(pieces, two, alive, GAP * pixel) if m not in (i, k)]
        third = ((m, _continued(_Piece([], two), pieces[m], pixel)) for m in near)
        rows += [((i, k, m), three) for m, three in third if three is not None]
    for members, points in rows:
        if members not in tried:
            straight = sum(kind[m] == Kind.LINE for m in members)
            strokes = fit_elliptic_arcs(points, pixel) if straight < 2 else []
            good = bool(strokes) and near_enough(strokes, pixel)
            tried[members] = _joint_of(pieces, members, _Piece(strokes, points), pixel) if good else None
    return [joint for members, _ in rows if (joint := tried[members]) is not None]


def _pieces(curves: Curves, pixel: float) -> list[_Piece]:
    """One piece for every curve, as simple as it can be; whole circles and ellipses stay what they are."""
    control = curves.constrained(curves.points)[0].double().numpy()
    pieces = []
    for kind, own, samples in zip(curves.kind.tolist(), control, sampled(curves), strict=True):
        points = resampled(samples, pixel)
        simple = None if kind in CLOSED_KINDS else simplest(points, pixel)
        pieces.append(_Piece(simple or [Primitive(Kind(kind), own, np.zeros(0))], points))
    return pieces


def _joint(pieces: list[_Piece], i: int, k: int, pixel: float, gaps: Gaps) -> _Joint | None:
    """The joint of two pieces, if there is one."""
    points = _continued(pieces[i], pieces[k], pixel, gap=gaps.most)
    strokes = None if points is None else simplest(points, pixel, gaps.within)
    if points is None or strokes is None:
        return None
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    widest = int(steps.argmax())
    if steps[widest] > GAP * pixel and not gaps.closed(points[widest], points[widest + 1]):
        return None
    if strokes[0].kind == Kind.FREE and _are_line_and_corner(pieces[i], pieces[k]):
        return None
    return _joint_of(pieces, (k, i), _Piece(strokes, points), pixel)


def _are_line_and_corner(one: _Piece, other: _Piece) -> bool:
    """Whether these are a line and an arc that rounds a corner: no cubic is simpler than they are."""
    kinds = {piece.curves[0].kind: piece for piece in (one, other)}
    if set(kinds) != {Kind.LINE, Kind.ARC}:
        return False
    points = kinds[Kind.ARC].points
    turn = _end_tangent(points) @ -_end_tangent(points[::-1])
    return bool(turn < np.cos(CORNER))


def _joint_of(pieces: list[_Piece], members: tuple[int, ...], piece: _Piece, pixel: float) -> _Joint:
    saved = sum(pieces[i].price for i in members) - piece.price
    return _Joint(float(np.mean(piece.curves[0].distances)) / pixel - saved, members, piece)


def _continued(
    one: _Piece, other: _Piece, pixel: float, straight: float = STRAIGHT_ON, gap: float = GAP
) -> Float[Array, "M 3"] | None:
    """The points along two pieces that continue each other at their nearest ends; None if they do not.

    Args:
        straight: least cosine between them, and between them and what is between them, where that is wide.
        gap: how far they may be apart, pixels.
    """
    if one.closed or other.closed:
        return None
    a, b = one.points, other.points
    flips = [(x, y) for x in (a, a[::-1]) for y in (b, b[::-1])]
    gaps = [np.linalg.norm(x[-1] - y[0]) for x, y in flips]
    first, second = flips[int(np.argmin(gaps))]
    if min(gaps) > gap * pixel:
        return None
    heading, onwards = -_end_tangent(first[::-1]), _end_tangent(second)
    between = unit(second[0] - first[-1]) if min(gaps) > GAP * pixel else heading
    if min(heading @ onwards, heading @ between) < straight:
        return None
    # Where ends overlap, the second must not turn back.
    beyond = (second - first[-1]) @ heading > 0
    start = int(np.argmax(beyond)) if beyond.any() else len(second)
    return np.concatenate([first, second[start:]])


def _end_tangent(points: Array) -> Float[Array, " 3"]:
    """Unit tangent at the first point, pointing into the curve: that of the parabola through three points."""
    half = min((len(points) - 1) // 2, 2)
    step = 4 * (points[half] - points[0]) - (points[2 * half] - points[0])
    return unit(step if half else points[-1] - points[0])
