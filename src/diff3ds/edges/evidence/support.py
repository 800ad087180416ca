"""Which parts of which curves a view shows: those that lie on its ridges, running the same way."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.curves.directions import dot, unit
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.straight_lines import tangents_of
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.render.backends import kernels

# [parts; empirical] Parts of a segment: a curve, or half of a closed one.
PARTS = 6
# [points, fraction; empirical] Sample points of a part, and the fraction of them that has to be inliers.
SAMPLES, AGREEING = 5, 0.6
SEGMENT = PARTS * SAMPLES
# [px, sine; empirical] Inliers are so near to a ridge, and run along it to this angle (25 degrees).
NEAR, SLANT = 2.5, 0.436
# [px; empirical] Lines closer than this in the image pull each other's ridges.
CROWDED = 3.5
# Lines farther apart in space share no inliers: they are two.
APART = 2 * NEAR
# [fraction; empirical] A part keeps all of its views if leaving out those with another line beside it would leave less
# than this fraction.
CLEAR = 0.3
# [px; numerical] Step along the tangent that shows its direction in the image.
STEP = 0.1
# [points in views; speed] So many are looked at in one piece: its numbers stay in a processor's cache.
PIECE = 30_000
# [chords; numerical] Chords that curves are measured by, to take samples of them at even steps.
CHORDS = 32

Flags = Bool[NDArray[np.bool_], "V M"]


def part_support(views: EdgeViews, curves: Curves) -> Bool[Tensor, "V S P"]:
    """Whether each of the `PARTS` equal parts of each segment of the curves lies on an edge in each view."""
    return torch.from_numpy(_by_parts(inliers(views, *samples(curves))))


def clear_support(views: EdgeViews, curves: Curves) -> Bool[Tensor, "V S P"]:
    """As `part_support`, without the views where another line runs so close that neither can be measured."""
    x, tangents = samples(curves)
    found = inliers(views, x, tangents)
    shown = _by_parts(found)
    # Of parts that a view does not show nothing is asked.
    found &= shown.reshape(len(found), -1).repeat(SAMPLES, 1)
    clear = _by_parts(found & ~crowded(views, x, tangents, at=found))
    return torch.from_numpy(np.where(clear.sum(0) >= CLEAR * shown.sum(0), clear, shown))


def samples(curves: Curves) -> tuple[Float[Array, "M 3"], Float[Array, "M 3"]]:
    """Points in the middle of even steps along the segments of curves, segment by segment, and unit tangents."""
    x = evaluate(*curves.segments(curves.points), (torch.arange(SEGMENT) + 0.5) / SEGMENT).double().numpy()
    return x.reshape(-1, 3), tangents_of(x).reshape(-1, 3)


def spaced_samples(
    curves: Curves, step: float
) -> tuple[Float[Array, "D 3"], Float[Array, "D 3"], Int[NDArray[np.int64], " D"]]:
    """Points at even parameters, about a step apart, along all curves, unit tangents there, and whose they are."""
    chords = np.diff(curves.at(torch.linspace(0, 1, CHORDS + 1)).double().numpy(), axis=1)
    counts = np.ceil(np.linalg.norm(chords, axis=2).sum(1) / step).astype(np.int64) + 2
    fine = curves.at(torch.linspace(0, 1, int(counts.max()))).double().numpy()
    owner = np.repeat(np.arange(len(curves)), counts)
    # Of short curves fewer of the points: all of them, for all views, would be too many.
    at = np.concatenate([np.linspace(0, fine.shape[1] - 1, count).round().astype(np.int64) for count in counts])
    return fine[owner, at], tangents_of(fine)[owner, at], owner


def owners(curves: Curves) -> Int[NDArray[np.int64], " M"]:
    """The curve that each of `samples` is of."""
    return np.repeat(curves.owner.numpy(), SEGMENT)


def mean_of_segments(curves: Curves, values: Float[Tensor, " S"]) -> Float[Tensor, " N"]:
    """For each curve the mean of a value of its segments."""
    return values.new_zeros(len(curves)).index_add(0, curves.owner, values) / (1 + curves.closed.long())


def _by_parts(found: Flags) -> Bool[NDArray[np.bool_], "V S P"]:
    return np.asarray(found.reshape(len(found), -1, PARTS, SAMPLES).mean(-1) >= AGREEING)


def inliers(views: EdgeViews, x: Float[Array, "M 3"], tangents: Float[Array, "M 3"], within: float = NEAR) -> Flags:
    """Whether sample points of a curve lie on ridges that run along it.

    Args:
        within: so near lies the ridge, pixels.
    """
    kernel = getattr(kernels(), "edges_shown", None)

    def found(piece: slice) -> Flags:
        if kernel:
            three = views.normals, x[piece], _ahead(views, x[piece], tangents[piece])
            given = [torch.from_numpy(np.ascontiguousarray(values)) for values in three]
            return np.asarray(kernel(views.tables, *given, within, SLANT))
        match = views.match(x[piece])
        heading = headings(views, x[piece], tangents[piece], match.pixel)
        across = np.abs(dot(heading, views.normals.take(match.ridge, 0)))
        return np.asarray((match.distance < within) & (across < SLANT))

    return in_pieces(found, len(views), len(x))


def in_pieces(do: Callable[[slice], NDArray[Any]], views: int, count: int) -> NDArray[Any]:
    """What `do` gives for so many points in views, piece by piece and side by side."""
    pieces = max(1, count * views // PIECE)
    cuts = [count * k // pieces for k in range(pieces + 1)]
    return np.concatenate(side_by_side(lambda k: do(slice(cuts[k], cuts[k + 1])), pieces, pieces), -1)


def headings(
    views: EdgeViews, x: Float[Array, "M 3"], tangents: Float[Array, "M 3"], pixel: Float[Array, "V M 2"]
) -> Float[Array, "V M 2"]:
    """Directions of tangents in the images, unit vectors; `pixel` is where the points are."""
    return unit(views.project(_ahead(views, x, tangents))[0] - pixel)


def _ahead(views: EdgeViews, x: Float[Array, "M 3"], tangents: Float[Array, "M 3"]) -> Float[Array, "M 3"]:
    """Points a small step along tangents."""
    return x + STEP * views.pixel * tangents


def crowded(
    views: EdgeViews,
    x: Float[Array, "M 3"],
    tangents: Float[Array, "M 3"],
    by: Bool[NDArray[np.bool_], " M"] | None = None,
    *,
    at: Flags | None = None,
    within: float = CROWDED,
) -> Flags:
    """Where another of the points, on another line of space, appears beside a point, running the same way.

    Args:
        by: which points count as the other; default all.
        at: which points are asked about in which views; default all.
        within: how far beside it, pixels.
    """
    pixel = views.project(x)[0]
    heading = headings(views, x, tangents, pixel)
    # Of each component all points lie in a row: there are millions of pairs.
    places, along = np.ascontiguousarray(x.T), np.ascontiguousarray(tangents.T)
    apart = (APART * views.pixel) ** 2
    beside: Callable[..., Bool[NDArray[np.bool_], " M"]] = getattr(kernels(), "edges_crowded", None) or _beside

    def beside_another(view: int) -> Bool[NDArray[np.bool_], " M"]:
        seen = (np.abs(pixel[view]) < 1e6).all(1)
        asked, others = (seen if which is None else seen & which for which in (None if at is None else at[view], by))
        rows = np.ascontiguousarray(pixel[view].T), np.ascontiguousarray(heading[view].T)
        given = [torch.from_numpy(values) for values in (asked, others, *rows, places, along)]
        return np.asarray(beside(*given, within, SLANT, apart))

    return np.stack(side_by_side(beside_another, len(views), len(views)))


def _beside(
    asked: Bool[Tensor, " M"],
    by: Bool[Tensor, " M"],
    pixels: Float[Tensor, "2 M"],
    headings: Float[Tensor, "2 M"],
    places: Float[Tensor, "3 M"],
    tangents: Float[Tensor, "3 M"],
    within: float,
    slant: float,
    apart: float,
) -> Bool[NDArray[np.bool_], " M"]:
    """What the compiled kernel says of one view: which points that are asked another line appears beside."""
    from scipy.spatial import cKDTree

    rows = [np.nonzero(which.numpy())[0] for which in (asked, by)]
    # Asked once, trees need not be tidy.
    own, other = (cKDTree(pixels.numpy().T[some], 32, False, balanced_tree=False) for some in rows)
    pairs = own.sparse_distance_matrix(other, within, output_type="ndarray")
    here, beside = rows[0].take(pairs["i"]), rows[1].take(pairs["j"])
    # Most are of one line, or of two that are one.
    far = sum((axis.take(here) - axis.take(beside)) ** 2 for axis in places.numpy()) > apart
    here, beside = here[far], beside[far]
    u, v = headings.numpy()
    same_way = np.abs(u.take(here) * v.take(beside) - v.take(here) * u.take(beside)) < slant
    here, beside = here[same_way], beside[same_way]
    # Which of the two comes first says along which of them they are apart.
    first, second = np.minimum(here, beside), np.maximum(here, beside)
    step = [axis.take(first) - axis.take(second) for axis in places.numpy()]
    # Across the line: a line seen from its end is no other line.
    on = sum(a * axis.take(first) for a, axis in zip(step, tangents.numpy(), strict=True))
    found = np.zeros(len(asked), bool)
    found[here[sum(a * a for a in step) - on**2 > apart]] = True
    return found
