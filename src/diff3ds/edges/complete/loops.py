"""Closed loops of curves in one plane: rims of pockets and holes, outlines of faces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves, sampled
from diff3ds.edges.complete.hypothesis import SAMPLES
from diff3ds.edges.measure.planes import WITHIN

# Chords of a curve: of a half circle they are .2 % of its radius beside it.
CHORDS = SAMPLES
# Curves may lie in a plane if none of their points is farther from it, pixels, before they are measured; two curves
# whose points are this near to one line, twice the root of the mean square, span no plane.
PLANAR = 2 * WITHIN
STRAIGHT = 2 * PLANAR


@dataclass(frozen=True, eq=False)
class Loop:
    """Curves that follow each other around a part of a plane.

    Attributes:
        members: the curves, in order.
        origin: a point of the plane.
        u, v: orthogonal unit vectors in the plane.
        corners: the curves' samples in order around, by their components along u and v.
    """

    members: tuple[int, ...]
    origin: Float[Array, " 3"]
    u: Float[Array, " 3"]
    v: Float[Array, " 3"]
    corners: Float[Array, "K 2"]

    @property
    def normal(self) -> Float[Array, " 3"]:
        """Unit vector across the plane."""
        return np.cross(self.u, self.v)

    def sample_points(self, count: int) -> tuple[Float[Array, "S 3"], Float[Array, "S 3"], Float[Array, "S 3"]]:
        """Places at even steps around, unit tangents there, and unit vectors in the plane to the inner side."""
        closed = np.concatenate([self.corners, self.corners[:1]])
        chord = np.diff(closed, axis=0)
        length = np.concatenate([[0.0], np.linalg.norm(chord, axis=1).cumsum()])
        at = (np.arange(count) + 0.5) / count * length[-1]
        flat = np.column_stack([np.interp(at, length, axis) for axis in closed.T])
        along = unit(chord[np.clip(np.searchsorted(length, at) - 1, 0, len(chord) - 1)])
        # Twice the area, positive if the loop runs from u to v.
        area = (closed[:-1, 0] * closed[1:, 1] - closed[1:, 0] * closed[:-1, 1]).sum()
        across = np.sign(area) * np.column_stack([-along[:, 1], along[:, 0]])
        plane = np.stack([self.u, self.v])
        return self.origin + flat @ plane, along @ plane, across @ plane

    def holds(self, x: Float[Array, "... 3"]) -> Bool[NDArray[np.bool_], "..."]:
        """Whether points of the plane lie within the loop: a ray from there crosses it an odd number of times."""
        px, py = ((x - self.origin) @ axis for axis in (self.u, self.v))
        inside = np.zeros(px.shape, bool)
        for (ax, ay), (bx, by) in zip(self.corners, np.roll(self.corners, -1, 0), strict=True):
            crosses = (ay > py) != (by > py)
            at = ax + (py - ay) * (bx - ax) / (by - ay if by != ay else 1.0)
            inside ^= crosses & (px < at)
        return inside


def find_loops(curves: Curves, pixel: float) -> list[Loop]:
    """The loops in which no more than two of the curves of a plane meet; closed curves are loops of their own."""
    points = sampled(curves, CHORDS + 1)
    closed = curves.closed.numpy()
    # Closed curves meet no others.
    vertex = np.where(closed[:, None], -1, curves.vertex.numpy())
    found: dict[frozenset[int], Loop] = {}
    for i, around in zip(np.nonzero(closed)[0].tolist(), sampled(curves[curves.closed], 2 * CHORDS + 1), strict=True):
        found[frozenset([i])] = _loop((i,), around[:-1])
    for name in np.unique(vertex[~closed]):
        here = np.nonzero((vertex == name).any(1))[0].tolist()
        for k, first in enumerate(here):
            for second in here[k + 1 :]:
                loop = _around(points, vertex, int(first), int(second), int(name), pixel)
                if loop is not None:
                    found.setdefault(frozenset(loop.members), loop)
    return list(found.values())


def _around(
    points: Float[Array, "N S 3"], vertex: NDArray[np.int64], first: int, second: int, name: int, pixel: float
) -> Loop | None:
    """The loop that begins with two curves at a vertex; None if they span no plane, or it does not close."""
    both = np.concatenate([points[first], points[second]])
    origin = both.mean(0)
    _, sizes, axes = np.linalg.svd(both - origin, full_matrices=False)
    if sizes[1] < STRAIGHT * pixel * np.sqrt(len(both)) / 2:
        return None
    off = np.abs((points - origin) @ axes[2]).max(1)
    flat = off < PLANAR * pixel
    members, rows, at = [first], [_towards(points, vertex, first, name)], name
    while True:
        here = np.nonzero((vertex == at).any(1) & flat)[0].tolist()
        if len(here) != 2 or members[-1] not in here:
            return None
        following = here[1 - here.index(members[-1])]
        if following == first:
            break
        members.append(following)
        at = int(vertex[following][1 - vertex[following].tolist().index(at)])
        rows.append(_towards(points, vertex, following, at))
    return _loop(tuple(members), np.concatenate([row[:-1] for row in rows]))


def _loop(members: tuple[int, ...], around: Float[Array, "K 3"]) -> Loop:
    """The loop through these samples of its curves, in the plane of least squares."""
    origin = around.mean(0)
    axes = np.linalg.svd(around - origin, full_matrices=False)[2]
    return Loop(members, origin, axes[0], axes[1], (around - origin) @ axes[:2].T)


def _towards(points: Float[Array, "N S 3"], vertex: NDArray[np.int64], curve: int, name: int) -> Float[Array, "S 3"]:
    """Samples of a curve in the order in which it ends at a vertex."""
    return points[curve] if vertex[curve, 1] == name else points[curve][::-1]
