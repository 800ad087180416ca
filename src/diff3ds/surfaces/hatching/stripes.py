"""Evenly spaced lines on a surface as one camera sees them: phases at its vertices that grow by 2π from line to line.

Lines are where the phase is a multiple of 2π (Knöppel and others 2015). What is asked of each edge is by how much it
should change there, which is known to the full number of lines; least squares on unit complex numbers find phases that
agree with all edges but for whole lines, and these begin and end where the surface narrows or turns.
"""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import unit
from diff3ds.page.picture import Picture
from diff3ds.surfaces.hatching.agreement import Complex, agreeing, levelling
from diff3ds.surfaces.hatching.fans import Fans

# Steps of inverse iteration from phases that are right where the surface is flat; and how much it is held by those of
# the step before, which keeps what is by itself where it is. Empirical.
ROUNDS, HELD = 8, 1e-4
# A step along the line of sight counts so much of one across it: at outlines lines come nearer to each other than
# asked, where otherwise they would have to end. Empirical.
ALONG_SIGHT = 0.15
# Lines of a piece may be so much nearer or farther than asked, a share in the mean, if then none has to begin or end on
# it; at twice as much none is. Empirical.
EASE = 0.06


@dataclass(frozen=True, eq=False)
class Stripes:
    """Phases on some faces of a surface.

    Attributes:
        edges: the edges of each face between corners 0 and 1, 1 and 2, 2 and 0.
        forwards: whether these go from an edge's first end to its second.
        first: the phase at the first end of each edge, turns.
        change: along the edge, turns; what other edges of a face say of it may be whole turns more or less.
    """

    edges: Int[Index, "F 3"]
    forwards: Bool[Mask, "F 3"]
    first: Float[Array, " E"]
    change: Float[Array, " E"]


def stripes(
    fans: Fans, chosen: Int[Index, " F"], directions: Float[Array, "N 3"], picture: Picture, spacing: float
) -> Stripes:
    """Phases of lines along directions.

    Args:
        fans: the surface.
        chosen: faces that get lines, all of them in front of the near plane.
        directions: unit tangents, of either sign.
        picture: as who sees it.
        spacing: from line to line, pixels.
    """
    used, small = np.unique(fans.faces[chosen], return_inverse=True)
    edge, of_faces = np.unique(fans.edges[1][chosen], return_inverse=True)
    a, b = np.searchsorted(used, fans.edges[0][edge]).T
    places, across = _on_page(fans.points[used], fans.normals[used], directions[used], picture)
    across *= 2 * np.pi / spacing
    # Directions have no sign: where neighbours disagree, the phase of one grows as that of the other falls.
    sign = np.where(np.einsum("ei,ei->e", across[a], across[b]) < 0, -1.0, 1.0)
    wanted = np.einsum("ei,ei->e", (across[a] + sign[:, None] * across[b]) / 2, places[b] - places[a])
    ends, weight = np.stack([a, b], 1), fans.edges[2][edge]
    pieces, piece = _pieces(ends, len(used))
    # On what is flat, or nearly so, lines may all go on: then they are a little nearer or farther here and there.
    more = levelling(places, ends, weight, sign)(wanted) - wanted
    whole = (2 * np.pi / spacing * np.linalg.norm(places[b] - places[a], axis=1)) ** 2
    off = np.bincount(piece[a], more**2, pieces) / np.maximum(np.bincount(piece[a], whole, pieces), 1e-300)
    wanted += np.clip(2 - off**0.5 / EASE, 0, 1)[piece[a]] * more
    solve = agreeing(places, ends, wanted, weight, np.full(len(used), HELD), sign)
    value = _begun(places, across, pieces, piece)
    for _ in range(ROUNDS):
        value = solve(value)
        value /= np.maximum(np.abs(value), 1e-300)
    phase = np.angle(value)
    change = sign * phase[b] - phase[a] - wanted
    change = wanted + (change + np.pi) % (2 * np.pi) - np.pi
    of_faces = of_faces.reshape(-1, 3)
    return Stripes(of_faces, ends[of_faces, 0] == small.reshape(-1, 3), phase[a] / (2 * np.pi), change / (2 * np.pi))


def _on_page(
    points: Float[Array, "N 3"], normals: Float[Array, "N 3"], directions: Float[Array, "N 3"], picture: Picture
) -> tuple[Float[Array, "N 3"], Float[Array, "N 3"]]:
    """Places on a page with some depth, pixels, and there unit vectors across directions, along the surface."""

    def placed(where: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
        pixels, depths = picture.seen(where)
        deep = depths if picture.orthographic else np.log(np.maximum(depths, picture.near))
        return np.column_stack([pixels, ALONG_SIGHT * picture.focal * deep])

    places = placed(points)
    step = 1e-5 * np.ptp(points, axis=0).max()
    along = unit((placed(points + step * directions) - places) / step)
    aside = (placed(points + step * np.cross(normals, directions)) - places) / step
    return places, unit(aside - np.einsum("ni,ni->n", aside, along)[:, None] * along)


def _pieces(ends: Int[Index, "E 2"], count: int) -> tuple[int, Int[Index, " N"]]:
    """How many pieces hang together by edges, and the piece of each of so many fans."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    links = coo_matrix((np.ones(len(ends), bool), ends.T), shape=(count, count))
    pieces, piece = connected_components(links, directed=False)
    return int(pieces), piece.astype(np.int64)


def _begun(places: Float[Array, "N 3"], across: Float[Array, "N 3"], pieces: int, piece: Int[Index, " N"]) -> Complex:
    """Phases from the middle of each piece: those of lines that would all go one way."""
    number = np.bincount(piece, minlength=pieces)[:, None]
    middle = np.stack([np.bincount(piece, places[:, k], pieces) for k in range(3)], 1) / number
    return np.exp(1j * np.einsum("ni,ni->n", across, places - middle[piece]))
