"""Stipple: tone by dots on a mesh in one view, evenly spread, and the nearer to each other the darker it is to be."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.camera import Cameras
from diff3ds.page.boxes import near_pairs
from diff3ds.page.noise import uniform_at
from diff3ds.page.picture import Picture
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hatching.hatch_lines import SPACING, Hatched, seen_sides
from diff3ds.surfaces.hatching.tones import Hatch, tone_of
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# How wide dots are, in spacings, and by how much longer, in widths: round ends alone would have no direction.
WIDE, LONG = 0.5, 0.2
# Below this tone there are no dots. Empirical.
PALEST = 0.01
# So many places are tried for each dot; of those, dots that keep a distance r from each other become this many in an
# area of r². Measured on a plane.
TRIED, DENSE = 7.5, 0.53
# The share of the page that dots cover, by the sum of their areas: the nearer, the more they overlap. Measured so too.
AREAS = np.array([0.0, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 2.5])
COVERED = np.array([0.0, 0.4, 0.497, 0.585, 0.662, 0.728, 0.784, 0.831, 0.9, 0.957, 0.991, 0.998])
# Whether something hides points of a surface, each on such a face of the mesh.
Hides = Callable[[Float[Array, "Q 3"], Int[Index, " Q"]], Bool[Mask, " Q"]]


class _Places(NamedTuple):
    """Where dots may be: points, the faces they lie on, directions along the surface, areas for each dot, and an order.

    The order belongs to the surface: from one view to the next dots stay where they are.
    """

    points: Float[Array, "P 3"]
    face: Int[Index, " P"]
    ways: Float[Array, "P 3"]
    room: Float[Array, " P"]
    order: Float[Array, " P"]

    def rows(self, some: Int[Index, " Q"] | Bool[Mask, " P"]) -> "_Places":
        """Some of them."""
        return _Places(self.points[some], self.face[some], self.ways[some], self.room[some], self.order[some])


def dot_strokes(mesh: TriangleMesh, cameras: Cameras, hatch: Hatch, hidden: Hides) -> Sketch:
    """Dots that are seen, as short strokes, black, float64, of widths in image heights.

    Args:
        mesh: the surface.
        cameras: one view.
        hatch: how.
        hidden: what asks whether points of the mesh are hidden.
    """
    known, picture = Hatched.of(mesh, hatch), Picture.of(cameras, 0)
    wide = WIDE * (hatch.spacing or SPACING * cameras.size[0])
    right = cameras.world_to_camera[0, 0, :3].detach().double().cpu().numpy()
    sides = [(np.zeros(0, np.int64), np.zeros((0, 3)))]
    for side, chosen in seen_sides(known, picture):
        tone = tone_of(known.fans.points, side * known.fans.normals, hatch, picture, right)
        sides.append((chosen, tone[known.fans.faces[chosen]]))
    chosen, tones = (np.concatenate(column) for column in zip(*sides, strict=True))
    places = _places(known, chosen, tones, picture, wide**2 * (np.pi / 4 + LONG))
    places = places.rows(~hidden(places.points, places.face))
    dots = places.rows(_spread(places, picture))
    depth = np.ones(len(dots.points)) if picture.orthographic else picture.seen(dots.points)[1]
    half = (LONG * wide / 2 * depth / picture.focal)[:, None] * dots.ways
    points = torch.from_numpy(np.stack([dots.points - half, dots.points + half], 1))
    return Sketch(points, width=torch.full(points.shape[:2], wide / picture.size[0], dtype=torch.float64))


def _places(
    known: Hatched, chosen: Int[Index, " F"], tones: Float[Array, "F 3"], picture: Picture, area: float
) -> _Places:
    """Places on faces, as many as their tone wants.

    Args:
        chosen: the faces.
        tones: at their corners.
        area: of a dot, pixels squared.
    """
    fans, corners = known.fans, known.mesh.vertices[known.mesh.faces[chosen]]
    pixels = picture.seen(corners)[0]
    one, other = pixels[:, 1] - pixels[:, 0], pixels[:, 2] - pixels[:, 0]
    on_page = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2
    wanted = TRIED / area * on_page
    count = np.ceil(wanted * np.interp(tones.max(1), COVERED, AREAS)).astype(np.int64)
    row = np.repeat(np.arange(len(chosen)), count)
    nth = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    u, v, rank = (uniform_at(k, chosen[row], nth) for k in range(3))
    # Evenly over a triangle (Osada and others 2002).
    share = np.stack([1 - u**0.5, u**0.5 * (1 - v), u**0.5 * v], 1)
    dark = (tones[row] * share).sum(1)
    rank += nth
    covering = np.interp(dark, COVERED, AREAS)
    kept = (dark > PALEST) & (rank < wanted[row] * covering)
    row, share, rank = row[kept], share[kept], rank[kept]
    points = np.einsum("pk,pki->pi", share, corners[row])
    across = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    ways = known.ways[0][fans.faces[chosen[row], 0]]
    return _Places(points, known.source[chosen[row]], ways, area / covering[kept], rank / across[row])


def _spread(places: _Places, picture: Picture) -> Int[Index, " D"]:
    """Which places get dots: the first in their order, and each that is far enough from those before it."""
    rank = np.argsort(places.order, kind="stable")
    pixels, reach = picture.seen(places.points[rank])[0], np.sqrt(DENSE * places.room[rank]) / 2
    first, second = near_pairs(pixels, reach)
    near = np.linalg.norm(pixels[second] - pixels[first], axis=1) < reach[first] + reach[second]
    first, second = first[near], second[near]
    kept, open_ = np.zeros(len(rank), bool), np.ones(len(rank), bool)
    while open_.any():
        # Those that wait for none before them.
        fresh = open_.copy()
        fresh[second] = False
        kept |= fresh
        taken = fresh[first]
        open_ &= ~fresh
        open_[second[taken]] = False
        left = open_[first] & open_[second]
        first, second = first[left], second[left]
    return rank[kept]
