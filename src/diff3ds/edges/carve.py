"""Carving: which cells of space enough views confirm to hold an edge."""

import numpy as np

from diff3ds._shapes import Float
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.ridges import Array

# Half the space diagonal of a cube of side 1: no point of a cell lies farther from its centre.
HALF_DIAGONAL = np.sqrt(3) / 2
# How often cells are halved: the first are eight times as large as the last.
HALVINGS = 3
CHUNK = 1 << 15


def carve(views: EdgeViews, reach: float, cell: float, least_views: float) -> Float[Array, "M 3"]:
    """Centres of the cells near edges, in the cube around the origin.

    A cell stays if in enough views some ridge passes it. The first cells are large; those that stay are divided.

    Args:
        reach: half the side of the cube, world units.
        cell: side of the last cells.
        least_views: so many views have to confirm a cell.
    """
    side = cell * 2**HALVINGS
    axis = side * (np.arange(np.ceil(2 * reach / side)) + 0.5) - reach
    cells = _grid(axis)
    for _ in range(HALVINGS):
        cells = _confirmed(views, cells, side, least_views)
        side /= 2
        cells = (cells[:, None] + side * _grid(np.array([-0.5, 0.5]))).reshape(-1, 3)
    return _confirmed(views, cells, side, least_views)


def _grid(axis: Float[Array, " N"]) -> Float[Array, "M 3"]:
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)


def _confirmed(views: EdgeViews, cells: Float[Array, "M 3"], side: float, least_views: float) -> Float[Array, "K 3"]:
    parts = [cells[i : i + CHUNK] for i in range(0, len(cells), CHUNK)]
    return np.concatenate([part[_count(views, part, side) >= least_views] for part in parts] or [cells])


def _count(views: EdgeViews, cells: Float[Array, "M 3"], side: float) -> Float[Array, " M"]:
    match = views.match(cells)
    # Pixels that the half diagonal of a cell covers.
    reach = HALF_DIAGONAL * side * views.focal[:, None] / np.maximum(match.depth, 1e-9)
    return (match.distance < reach).sum(0).astype(np.float64)
