"""Edges: where the samples of two forms touch, the path on which these meet, cut where a third form ends it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.parallel.in_copies import in_copies
from diff3ds.surfaces.form.exact_meets import FREE_STEPS, STEPS, Path, Surface, exact_paths, marched, onto
from diff3ds.surfaces.form.free import NONE, FreeForm
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import within
from diff3ds.surfaces.form.thread_points import threaded

# Forms that meet at less than this, degrees, go on in each other: no edge. Empirical.
SMOOTH = 18.0
# A place where samples touch says something of the path where it is so near, in spacings and in reaches. Empirical.
NEAR_SPACINGS, NEAR_REACHES = 2.5, 2.0
# A gap of the places along a path that is longer, in spacings, is no edge. Empirical.
GAP = 3.5
# How far from the end of its places an edge may have its corner, in spacings and in reaches. Empirical.
CORNER_SPACINGS, CORNER_REACHES = 3.5, 2.0
# An edge touches in so many places at least. Empirical.
LEAST = 4
# Corners nearer than this, in reaches and in spacings, are one. Empirical.
SAME_REACHES, SAME_SPACINGS = 1.5, 0.5
# Ends of edges of one form that no other form cuts are one where they are nearer than this, in spacings. Empirical.
LOOSE = 2.5
# An edge that ends where no other does is a scrap where it is shorter than this, in spacings. Empirical.
SCRAP = 6.0
# Forms touch that come so near to each other, in longest sides: those that are tangent are so but for rounding.
TOUCHING = 1e-6
# Pairs of forms for which a copy of the process is worth its start. Empirical.
WORTH_COPY = 8
# Points of a path that are looked at for a corner, to each side.
LOOKED = 24


@dataclass(frozen=True)
class Rounding:
    """What an edge between two forms is rounded by: what a ball that touches both leaves.

    Attributes:
        radius: of the ball, world units.
        sides: signs of the distances of its middle from both forms.
        cosine: of the angle between the normals of both that point away from it.
    """

    radius: float
    sides: tuple[float, float]
    cosine: float


@dataclass(frozen=True, eq=False)
class Edge:
    """A part of a path on which two forms meet.

    Attributes:
        forms: the numbers of the two forms.
        path: on which it lies.
        start, stop: parameters of its ends; of a closed one a whole period apart.
        closed: whether it runs round.
        corner: for each end the number of the third form that it ends at, NONE where none is.
        turn: between the normals of the two forms, degrees, median along it.
        places: how many pairs of neighbouring samples it lies between.
        rounding: that it stands for; None where it is sharp.
    """

    forms: tuple[int, int]
    path: Path
    start: float
    stop: float
    closed: bool
    corner: tuple[int, int]
    turn: float
    places: int
    rounding: Rounding | None = None

    @property
    def length(self) -> float:
        """About how long it is, world units."""
        return (self.stop - self.start) * self.path.speed

    @property
    def ends(self) -> Float[Array, "2 3"]:
        """Its ends, world units."""
        return self.path.at(np.array([self.start, self.stop]))


def edges_between(samples: Samples, forms: Sequence[Surface], label: Int[Index, " N"]) -> list[Edge]:
    """The edges between forms whose samples touch.

    Args:
        label: of the samples, carried on over what lies between forms.
    """
    places = list(_touching(samples, label).items())
    near = _Near(samples, label)

    def of_pair(row: int) -> list[Edge]:
        pair, (middles, apart) = places[row]
        edges = _along(samples, pair, forms, middles, max(apart, samples.spacing))
        return [_cornered(samples, edge, forms, near) for edge in edges]

    found = in_copies(of_pair, len(places), max(1, len(places) // WORTH_COPY))
    return [edge for edges in found for edge in edges]


def without_scraps(samples: Samples, edges: list[Edge], vertex: Int[Index, "E 2"]) -> list[int]:
    """The numbers of the edges but for short ones that end where no other edge does, and those of no length."""
    keep = list(range(len(edges)))
    while True:
        ends = np.bincount(vertex[keep].ravel(), minlength=int(vertex.max(initial=0)) + 1)
        short = SCRAP * samples.spacing
        left = [
            k
            for k in keep
            if edges[k].closed
            or (edges[k].stop > edges[k].start and (ends[vertex[k]].min() > 1 or edges[k].length > short))
        ]
        if len(left) == len(keep):
            return left
        keep = left


def _touching(samples: Samples, label: Int[Index, " N"]) -> dict[tuple[int, int], tuple[Float[Array, "C 3"], float]]:
    """The middles between neighbouring samples of two forms, and how far these are apart, median."""
    i, j = samples.pairs.T
    a, b = np.minimum(label[i], label[j]), np.maximum(label[i], label[j])
    rows = np.flatnonzero((a != b) & (a != NONE))
    count = int(label.max()) + 2
    key = a[rows] * count + b[rows]
    order = np.argsort(key, kind="stable")
    if not len(rows):
        return {}
    keys, first = np.unique(key[order], return_index=True)
    out = {}
    for k, part in zip(keys, np.split(rows[order], first[1:]), strict=True):
        one, other = samples.points[i[part]], samples.points[j[part]]
        apart = float(np.median(np.linalg.norm(one - other, axis=1)))
        out[int(k // count), int(k % count)] = ((one + other) / 2, apart)
    return out


def _along(
    samples: Samples, pair: tuple[int, int], forms: Sequence[Surface], middles: Float[Array, "C 3"], apart: float
) -> Iterator[Edge]:
    """The edges of two forms through the places where they touch, of neighbours that are so far apart."""
    a, b = forms[pair[0]], forms[pair[1]]
    if len(middles) < LEAST:
        return
    free = isinstance(a, FreeForm) or isinstance(b, FreeForm)
    on = onto([a, b], middles, FREE_STEPS if free else STEPS)
    limit = NEAR_SPACINGS * apart + NEAR_REACHES * within(samples)
    off = np.abs(np.stack([a.distance(on), b.distance(on)])).max(0)
    turn = _turns(a, b, on)
    good = (
        (np.linalg.norm(on - middles, axis=1) < limit)
        & (off < (1e-3 if free else 1e-6) * samples.size)
        & (turn > SMOOTH)
    )
    on, turn = on[good], turn[good]
    if len(on) < max(LEAST, 0.3 * len(middles)):
        return
    for path, rows in _paths(samples, a, b, on, GAP * apart):
        for start, stop, closed, inside in _intervals(path, on[rows], GAP * apart):
            if len(inside) >= LEAST:
                angle = float(np.median(turn[rows[inside]]))
                yield Edge(pair, path, start, stop, closed, (NONE, NONE), angle, len(inside))


def _turns(a: Surface, b: Surface, points: Float[Array, "C 3"]) -> Float[Array, " C"]:
    """Angles between two forms at points, degrees, to 90."""
    n, m = a.normal(points), b.normal(points)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), np.abs((n * m).sum(1))))


def _paths(
    samples: Samples, a: Surface, b: Surface, on: Float[Array, "C 3"], gap: float
) -> Iterator[tuple[Path, Index]]:
    """Paths of two forms, each with the rows of the points that lie on it."""
    paths = exact_paths(a, b)
    if paths:
        away = np.stack([np.linalg.norm(p.at(p.parameter(on)) - on, axis=1) for p in paths])
        best = away.argmin(0)
        for k, path in enumerate(paths):
            rows = np.flatnonzero(best == k)
            if len(rows):
                yield path, rows
        return
    if isinstance(a, FreeForm) or isinstance(b, FreeForm):
        for line, closed, rows in threaded(on, gap, samples.spacing):
            line = onto([a, b], line, FREE_STEPS)
            yield Path(Kind.FREE, line[0], np.zeros(3), np.zeros(3), line, closed), rows
        return
    from scipy.spatial import cKDTree

    left = np.ones(len(on), bool)
    while left.sum() >= LEAST:
        rows = np.flatnonzero(left)
        tree = cKDTree(on[rows])

        def stops(x: Array, tree: "cKDTree" = tree) -> bool:
            return bool(tree.query(x)[0] > gap)

        path = marched(a, b, on[rows[len(rows) // 2]], 0.3 * samples.spacing, stops)
        assert path.line is not None
        near = cKDTree(path.line).query(on[rows])[0] < samples.spacing
        near[len(rows) // 2] = True
        left[rows[near]] = False
        if len(path.line) > 3:
            yield path, rows[near]


def _intervals(path: Path, points: Float[Array, "C 3"], gap: float) -> Iterator[tuple[float, float, bool, Index]]:
    """Parts of a path along which points have no larger gaps: start, stop, whether it runs round, rows of points."""
    t = path.parameter(points)
    order = np.argsort(t, kind="stable")
    s = t[order]
    gap = gap / path.speed
    period = path.period
    cuts = np.flatnonzero(np.diff(s) > gap)
    if np.isfinite(period):
        over = s[0] + period - s[-1] > gap
        if not len(cuts) and not over:
            yield float(s[0]), float(s[0] + period), True, order
            return
        if not over:
            # Begin after a gap.
            first = cuts[0] + 1
            s = np.r_[s[first:], s[:first] + period]
            order = np.r_[order[first:], order[:first]]
            cuts = np.flatnonzero(np.diff(s) > gap)
    for part in np.split(np.arange(len(s)), cuts + 1):
        yield float(s[part[0]]), float(s[part[-1]]), False, order[part]


class _Near:
    """Which forms have samples near to a point."""

    def __init__(self, samples: Samples, label: Int[Index, " N"]) -> None:
        from scipy.spatial import cKDTree

        rows = np.flatnonzero(label != NONE)
        self.label, self.tree = label[rows], cKDTree(samples.points[rows])

    def forms(self, point: Float[Array, " 3"], reach: float, least: int = 2) -> list[int]:
        """Their numbers."""
        found = self.label[self.tree.query_ball_point(point, reach)]
        return [] if not len(found) else np.flatnonzero(np.bincount(found) >= least).tolist()


def _cornered(samples: Samples, edge: Edge, forms: Sequence[Surface], near: _Near) -> Edge:
    """The edge with ends where a third form cuts its path, if one does near to them."""
    if edge.closed:
        return edge
    reach = CORNER_SPACINGS * samples.spacing + CORNER_REACHES * within(samples)
    ends, corner = [edge.start, edge.stop], [NONE, NONE]
    span = (edge.stop - edge.start) * edge.path.speed
    for side, t in enumerate((edge.start, edge.stop)):
        best = np.inf
        point = edge.path.at(np.array([t]))[0]
        # Not beyond the middle of the edge.
        inward = min(reach, 0.45 * span)
        back, ahead = (reach, inward) if side == 0 else (inward, reach)
        grid = t + np.linspace(-back, ahead, 2 * LOOKED) / edge.path.speed
        along = edge.path.at(grid)
        for k in near.forms(point, reach):
            if k in edge.forms:
                continue
            roots = _crossings(grid, forms[k].distance(along)) or _touches(samples, edge.path, forms[k], t, reach)
            for root in roots:
                if abs(root - t) < best:
                    best, ends[side], corner[side] = abs(root - t), float(root), int(k)
    return replace(edge, start=ends[0], stop=ends[1], corner=(corner[0], corner[1]))


def _crossings(grid: Float[Array, " G"], off: Float[Array, " G"]) -> list[float]:
    """Where distances along a path are zero."""
    rows = np.flatnonzero(off[1:] * off[:-1] <= 0)
    return [float(grid[r] - off[r] * (grid[r + 1] - grid[r]) / (off[r + 1] - off[r] or 1)) for r in rows]


def _touches(samples: Samples, path: Path, one: Surface, t: float, reach: float) -> list[float]:
    """Where a path comes near to a form that it does not go through, as fillets do to the planes beside them."""
    if isinstance(one, FreeForm):
        return []
    # Samples on both forms reach so much farther where these are tangent.
    radius = max(float(one.radius), 0.0 if path.kind == Kind.LINE else path.speed)
    reach = (reach + np.sqrt(2 * radius * within(samples))) / path.speed
    grid = t + np.linspace(-reach, reach, 2 * LOOKED)
    off = one.distance(path.at(grid))
    row = int(np.abs(off).argmin())
    if not 0 < row < len(off) - 1:
        return []
    before, here, after = off[row - 1 : row + 2]
    slope, bend = (after - before) / 2, before - 2 * here + after
    if abs(here - slope * slope / (2 * bend or np.inf)) > TOUCHING * samples.size:
        return []
    return [float(grid[row] - slope / (bend or np.inf) * (grid[1] - grid[0]))]


def corners(
    samples: Samples, edges: list[Edge], forms: Sequence[Surface]
) -> tuple[Float[Array, "V 3"], Int[Index, "E 2"]]:
    """The points at which edges end, and those of each edge; ends that lie together are one."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not edges:
        return np.zeros((0, 3)), np.zeros((0, 2), np.int64)
    ends = np.stack([edge.ends for edge in edges])
    for row, edge in enumerate(edges):
        for side, third in enumerate(edge.corner):
            if third != NONE:
                three = [forms[k] for k in sorted((*edge.forms, third))]
                exact = onto(three, ends[row, side][None])[0]
                if np.linalg.norm(exact - ends[row, side]) < samples.spacing:
                    ends[row, side] = exact
    flat = ends.reshape(-1, 3)
    fixed = np.array([k != NONE for edge in edges for k in edge.corner])
    together = SAME_REACHES * within(samples) + SAME_SPACINGS * samples.spacing
    loose = LOOSE * samples.spacing + together
    pairs = cKDTree(flat).query_pairs(loose, output_type="ndarray")
    apart = np.linalg.norm(flat[pairs[:, 0]] - flat[pairs[:, 1]], axis=1)
    cut = fixed[pairs].sum(1)
    shared = np.array([bool({*edges[a].forms} & {*edges[b].forms}) for a, b in pairs // 2], bool)
    # An end that no form cuts is not known well.
    near = np.where(cut == 2, together, np.where(cut == 1, 2 * together, loose * shared))
    # Ends of one edge stay apart.
    pairs = pairs[(apart < near) & (pairs[:, 0] // 2 != pairs[:, 1] // 2)]
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(flat), len(flat)))
    count, vertex = connected_components(graph, directed=False)
    weight = np.where(fixed, 1.0, 1e-6)
    total = np.bincount(vertex, weight, count)
    points = np.stack([np.bincount(vertex, weight * flat[:, k], count) for k in range(3)], 1) / total[:, None]
    return points, vertex.reshape(-1, 2).astype(np.int64)
