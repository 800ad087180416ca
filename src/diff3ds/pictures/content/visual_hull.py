"""The visual hull: where in space the pictures leave room for something, and in which colour."""

import math
from dataclasses import dataclass

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.pictures.store import Store

# The cube that is looked through reaches a little beyond the ball of the frame, which leaves out stray content.
REACH = 1.25
# Cells along its side: about 1.5 px of a picture of 100 px.
SIDE = 64
# A cell is empty where more than this fraction of the views that contain it show no content there: one picture of
# twenty with a wrong camera or mask carves nothing.
OUTVOTED = 0.05
# Cells beside an empty one make a layer |n_x| + |n_y| + |n_z| cells thick across a plane of normal n, 3/2 on average.
THICKNESS = 1.5
# Content is more than this alpha.
CONTENT = 0.3


@dataclass(frozen=True, eq=False)
class Hull:
    """Places at the surface of the visual hull, or all over the space seen where nothing is carved away.

    Attributes:
        points: middles of cells.
        normals: unit vectors out of the hull; 0 where there is no surface.
        colors: mean colours of what the views show there.
        spacing: side of a cell.
        area: of the surface; that of a unit sphere where there is none.
    """

    points: Float[Tensor, "M 3"]
    normals: Float[Tensor, "M 3"]
    colors: Float[Tensor, "M 3"]
    spacing: float
    area: float


def visual_hull(cameras: Cameras, store: Store, side: int = SIDE) -> Hull:
    """Carves a grid of cells by the alpha of the pictures.

    Args:
        cameras: in the frame in which the scene fills the unit ball.
        store: their pictures; small ones do: a cell is looked up in one pixel.
        side: cells along each axis.
    """
    spacing = 2 * REACH / side
    axis = (torch.arange(side) + 0.5) * spacing - REACH
    grid = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    missed, seen = torch.zeros(len(grid)), torch.zeros(len(grid))
    for view in range(len(cameras)):
        index, valid = _pixels(grid, cameras, store, view)
        alpha = store.batch([view]).alpha.flatten()[index]
        seen += valid
        missed += valid & (alpha < CONTENT)
    solid = ((missed <= OUTVOTED * seen) & (seen > 0)).reshape(side, side, side)
    normals = _outward(solid)
    surface = _surface(solid)
    inner = torch.linalg.vector_norm(grid, dim=-1).reshape(side, side, side) < 1
    carved = bool(surface.any()) and bool((inner & ~solid).any())
    chosen = (surface if carved else inner).flatten()
    points = grid[chosen]
    area = float(surface.sum()) * spacing**2 / THICKNESS if carved else 4 * math.pi
    picked = normals.reshape(-1, 3)[chosen] * carved
    return Hull(points, picked, _colors(points, cameras, store), spacing, area)


def _pixels(
    points: Float[Tensor, "M 3"], cameras: Cameras, store: Store, view: int
) -> tuple[Int[Tensor, " M"], Bool[Tensor, " M"]]:
    """The pixel of a view that each point falls into, and whether it falls into a known one."""
    matrix = cameras.projection[view].float()
    pixels, depth = cameras.seen(points @ matrix[:, :3].T + matrix[:, 3])
    column, row = pixels.floor().unbind(-1)
    height, width = cameras.size
    inside = (depth > cameras.near) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    index = (row.clamp(0, height - 1) * width + column.clamp(0, width - 1)).long()
    return index, inside & store.known[view].flatten()[index]


def _surface(solid: Bool[Tensor, "D D D"]) -> Bool[Tensor, "D D D"]:
    """Solid cells beside an empty one; beyond the grid nothing is empty."""
    empty = (~solid).float()[None]
    near = torch.nn.functional.max_pool3d(empty, 3, 1, 1)[0] > 0
    return solid & near


def _outward(solid: Bool[Tensor, "D D D"]) -> Float[Tensor, "D D D 3"]:
    """Directions in which the fraction of solid cells falls."""
    smooth = solid.float()[None, None]
    for _ in range(2):
        smooth = torch.nn.functional.avg_pool3d(smooth, 3, 1, 1, count_include_pad=False)
    slopes = torch.stack(torch.gradient(smooth[0, 0]), -1)
    return torch.nn.functional.normalize(-slopes, dim=-1)


def _colors(points: Float[Tensor, "M 3"], cameras: Cameras, store: Store) -> Float[Tensor, "M 3"]:
    """Mean straight colours over the views that show content there."""
    total, weight = torch.zeros(len(points), 3), torch.full((len(points), 1), 1e-6)
    for view in range(len(cameras)):
        index, valid = _pixels(points, cameras, store, view)
        pixels = store.batch([view]).pixels.reshape(-1, 4)[index] * valid[:, None]
        total += pixels[:, :3]
        weight += pixels[:, 3:]
    return (total / weight).clamp(0, 1)
