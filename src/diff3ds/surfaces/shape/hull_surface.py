"""The surface of what posed pictures show: their visual hull, smoothed, which hides lines and has contours."""

import numpy as np
import torch

from diff3ds._shapes import Array, Float
from diff3ds.camera import Cameras, evenly_spaced
from diff3ds.pictures.content.outlines import DEEPEST, depths
from diff3ds.pictures.content.visual_hull import OUTVOTED, REACH
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.frame import Frame, frame_of
from diff3ds.pictures.store import Batch
from diff3ds.surfaces.shape.level_set import level_set
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Points of the grid along each axis, and views that carve. Empirical.
SIDE, VIEWS = 80, 48
# Rounds of smoothing, and shares of the way to the middle of their neighbours by which vertices move forth and back in
# each: the hull has edges where cones of sight meet, which the object has not. Taubin's shares, rounds empirical.
ROUNDS, FORTH, BACK = 10, 0.5, -0.53
# Less of the grid than this, as a share, is no object: outlines of drawings were open, and let the flood in. The
# smallest thing that fills its frame, a needle as thick as two cells, has more.
LEAST = 1e-4


def hull_surface(pictures: PosedPictures, side: int = SIDE) -> TriangleMesh:
    """The visual hull of the pictures' silhouettes, in the world of their cameras.

    A point is as deep in the hull as it is in the silhouettes of nearly all views that see it; one in twenty may be
    wrong. Hollows that no outline shows are filled.

    Args:
        pictures: with alpha, or drawings with closed outlines.
        side: points of the grid along each axis.

    Raises:
        ValueError: coloured pictures without alpha; nothing is in all silhouettes, or all is; as `frame_of`.
    """
    frame = frame_of(pictures.cameras, pictures.store)
    views = evenly_spaced(len(pictures), VIEWS)
    cameras = frame.cameras(pictures.cameras[views])
    spacing = 2 * REACH / (side - 1)
    axis = np.linspace(-REACH, REACH, side)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    depth = np.stack([_depth(grid, cameras, v, pictures.batch(views[v : v + 1])) for v in range(len(cameras))])
    found = _carved(depth).reshape(side, side, side)
    if (found > 0).mean() < LEAST:
        raise ValueError(
            "--contours: no place lies in the silhouettes of all pictures. Silhouettes are the alpha of coloured "
            "pictures, or what the outlines of drawings close in: are there gaps, or are cameras or masks wrong?"
        )
    if (found[1:-1, 1:-1, 1:-1] > 0).all():
        raise ValueError("--contours: the pictures have no silhouettes: all of their pixels show the object")
    return _in_world(found, frame, spacing)


def _depth(grid: Float[Array, "N 3"], cameras: Cameras, view: int, batch: Batch) -> Float[Array, " N"]:
    """How deep points are in the silhouette of a view, pixels; infinite where it does not show them."""
    from scipy.ndimage import map_coordinates

    matrix = cameras.projection[view].double()
    pixels, distance = cameras.seen(torch.from_numpy(grid) @ matrix[:, :3].T + matrix[:, 3])
    column, row = (pixels.double().numpy() - 0.5).T
    height, width = cameras.size
    inside = (distance.numpy() > cameras.near) & (column > -0.5) & (column < width - 0.5)
    inside &= (row > -0.5) & (row < height - 0.5)
    deep = depths(batch)[0]
    filled, places = np.where(np.isinf(deep), DEEPEST, deep), (row[inside], column[inside])
    value = map_coordinates(filled, places, order=1, mode="nearest")
    known = np.isfinite(deep)[np.rint(row[inside]).astype(int), np.rint(column[inside]).astype(int)]
    found = np.full(len(grid), np.inf)
    found[inside] = np.where(known, value, np.inf)
    return found


def _carved(depth: Float[Array, "V N"]) -> Float[Array, " N"]:
    """The least depth over the views, but for those that are outvoted; what no view shows is outside."""
    seen = np.isfinite(depth).sum(0)
    rank = np.floor(OUTVOTED * seen).astype(np.int64)
    ordered = np.sort(depth, axis=0)
    least = np.take_along_axis(ordered, rank[None], 0)[0]
    return np.where(seen > 0, np.minimum(least, DEEPEST), -DEEPEST)


def _in_world(values: Float[Array, "X Y Z"], frame: Frame, spacing: float) -> TriangleMesh:
    low = frame.center.double().numpy() - REACH * frame.radius
    mesh = level_set(values, low, spacing * frame.radius)
    return TriangleMesh(_faired(mesh), mesh.faces)


def _faired(mesh: TriangleMesh) -> Float[Array, "V 3"]:
    """The vertices, smoothed without shrinking (Taubin 1995), so that thin parts stay."""
    from scipy.sparse import coo_matrix

    count = len(mesh.vertices)
    ends = np.concatenate([mesh.edges, mesh.edges[:, ::-1]])
    beside = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()
    each = np.maximum(np.asarray(beside.sum(1)), 1)
    points = mesh.vertices
    for _ in range(ROUNDS):
        for share in (FORTH, BACK):
            points = points + share * (beside @ points / each - points)
    return points
