"""Hatching of a mesh in one view: chains of points on it, with the width that the line has at each."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.camera import Cameras
from diff3ds.page.picture import Picture
from diff3ds.surfaces.hatching.fans import Fans
from diff3ds.surfaces.hatching.hatch_ways import hatch_ways
from diff3ds.surfaces.hatching.isolines import Steps, isolines
from diff3ds.surfaces.hatching.stripes import stripes
from diff3ds.surfaces.hatching.tones import ADDED, THIN, Hatch, covered, tone_of
from diff3ds.surfaces.lines.contours import walks
from diff3ds.surfaces.shape.smooth_surface import finer
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Edges longer than this share of the mesh's size are halved: directions and phases are linear along them. Empirical.
LONGEST = 1 / 40
# The same where a picture is to be seen on it. Empirical.
LONGEST_OF_PICTURES = 1 / 120
# By default, of the picture's height.
SPACING = 0.01
# Lines shorter than so many spacings are specks.
SHORTEST = 0.6


@dataclass(frozen=True, eq=False)
class HatchChains:
    """Lines of hatching.

    Attributes:
        points: of all lines, world units; the first of a closed one comes again at its end.
        first: the first point of each line, and the number of all.
        face: a face of the mesh on which each point lies.
        width: of the line at each, pixels.
    """

    points: Float[Array, "M 3"]
    first: Int[Index, " F"]
    face: Int[Index, " M"]
    width: Float[Array, " M"]


@dataclass(frozen=True, eq=False)
class Hatched:
    """What all views need of a mesh to hatch it.

    Attributes:
        mesh: with short edges.
        source: the face of the given mesh that each face is a part of.
        fans: of it.
        ways: two unit tangents at each fan, along which lines go: the first around what is round.
        is_open: which faces are of pieces with a border, that have no inside.
    """

    mesh: TriangleMesh
    source: Int[Index, " F"]
    fans: Fans
    ways: tuple[Float[Array, "N 3"], Float[Array, "N 3"]]
    is_open: Bool[Mask, " F"]

    @staticmethod
    def of(mesh: TriangleMesh, hatch: Hatch) -> "Hatched":
        """Of a mesh, which keeps the last one."""
        longest = (LONGEST_OF_PICTURES if isinstance(hatch.by, np.ndarray) else LONGEST) * mesh.size
        known, kept = mesh.__dict__.get("_hatched", (None, None))
        if known != longest:
            fine, source = finer(mesh, longest)
            fans = Fans.of(fine)
            ways = hatch_ways(fine, fans)
            across = np.cross(fans.normals, ways)
            kept = Hatched(fine, source, fans, (ways, across), _open_faces(fine))
            mesh.__dict__["_hatched"] = longest, kept
        return cast(Hatched, kept)


def _open_faces(mesh: TriangleMesh) -> Bool[Mask, " F"]:
    """The faces of pieces that have a border."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(mesh.vertices)
    links = coo_matrix((np.ones(len(mesh.edges), bool), mesh.edges.T), shape=(count, count))
    pieces, piece = connected_components(links, directed=False)
    is_open = np.zeros(pieces, bool)
    is_open[piece[mesh.edges[mesh.is_border]]] = True
    return is_open[piece[mesh.faces[:, 0]]]


def hatch_chains(mesh: TriangleMesh, cameras: Cameras, hatch: Hatch) -> HatchChains:
    """The lines on what of a mesh is turned to a camera, hidden ones too.

    Args:
        mesh: the surface.
        cameras: one view.
        hatch: how.
    """
    known, picture = Hatched.of(mesh, hatch), Picture.of(cameras, 0)
    fans = known.fans
    right = cameras.world_to_camera[0, 0, :3].detach().double().cpu().numpy()
    spacing = hatch.spacing or SPACING * cameras.size[0]
    found = []
    for side, chosen in seen_sides(known, picture):
        tone = tone_of(fans.points, side * fans.normals, hatch, picture, right)
        phases = [stripes(fans, chosen, way, picture, spacing) for way in known.ways[: min(hatch.tones, 2)]]
        for number, (way, shift) in enumerate(ADDED[: hatch.tones]):
            share = covered(tone, number)[fans.faces[chosen]]
            found.append(_chains(fans, chosen, isolines(phases[way], shift), share, picture, spacing))
    if not found:
        return HatchChains(np.zeros((0, 3)), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0))
    counts = np.concatenate([np.diff(f.first) for f in found])
    points, face, width = (np.concatenate([getattr(f, name) for f in found]) for name in ("points", "face", "width"))
    return HatchChains(points, np.append(0, np.cumsum(counts)), known.source[face], width)


def seen_sides(known: Hatched, picture: Picture) -> list[tuple[float, Int[Index, " F"]]]:
    """Faces that may be seen from outside (1), and those of open pieces from inside (-1)."""
    mesh = known.mesh
    pixels, depths = (values[mesh.faces] for values in picture.seen(mesh.vertices))
    inside = (pixels.max(1) > 0).all(1) & (pixels.min(1) < np.array(picture.size[::-1])).all(1)
    ahead = inside & (depths > picture.near).all(1)
    above = np.einsum("fi,fi->f", mesh.face_normals, picture.towards(mesh.vertices[mesh.faces[:, 0]]))
    sides = [(1.0, np.flatnonzero(ahead & (above > 0))), (-1.0, np.flatnonzero(ahead & (above < 0) & known.is_open))]
    return [(side, faces) for side, faces in sides if len(faces)]


def _chains(
    fans: Fans,
    chosen: Int[Index, " F"],
    steps: Steps,
    share: Float[Array, "F 3"],
    picture: Picture,
    spacing: float,
) -> HatchChains:
    """Chains of the steps where lines are wide enough to be drawn."""
    row = steps.face[:, None]
    after = (steps.place + 1) % 3

    def along(values: Array) -> Array:
        one, other = values[row, steps.place], values[row, after]
        return one + steps.share.reshape(*steps.share.shape, *[1] * (one.ndim - 2)) * (other - one)

    points, wide = along(fans.points[fans.faces[chosen]]), along(share)
    key = steps.key
    kept = (wide > THIN / 2).any(1)
    points, wide, key, face = points[kept], wide[kept], key[kept].copy(), chosen[steps.face[kept]]
    # A line begins where it is wide enough: within a step.
    for end in (0, 1):
        thin = np.flatnonzero(wide[:, end] <= THIN / 2)
        low, high = wide[thin, end], wide[thin, 1 - end]
        part = ((THIN / 2 - low) / (high - low))[:, None]
        points[thin, end] += part * (points[thin, 1 - end] - points[thin, end])
        wide[thin, end] = THIN / 2
        key[thin, end] = -1 - 2 * thin - end
    nodes, at, ends = np.unique(key, return_index=True, return_inverse=True)
    points, wide, face = points.reshape(-1, 3)[at], wide.ravel()[at], np.repeat(face, 2)[at]
    width = spacing * np.maximum(wide, THIN)
    runs = [np.array(run + run[:1] if closed else run) for run, _, closed in walks(ends.reshape(-1, 2), len(nodes))]
    pixels = picture.seen(points)[0]
    runs = [run for run in runs if np.linalg.norm(np.diff(pixels[run], axis=0), axis=1).sum() > SHORTEST * spacing]
    rows = np.concatenate([np.zeros(0, np.int64), *runs])
    first = np.cumsum([0, *(len(run) for run in runs)])
    return HatchChains(points[rows], first, face[rows], width[rows])
