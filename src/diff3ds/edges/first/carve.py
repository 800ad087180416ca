"""Carving: which cells of space enough views confirm to hold an edge."""

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.edges.evidence.chance import chance_near, told
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.watch import Capped, Tick, no_tick, not_said
from diff3ds.parallel.in_copies import in_copies
from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.render.backends import kernels

# [sides; derived] Half the space diagonal of a cube of side 1: no point of a cell lies farther from its centre.
HALF_DIAGONAL = np.sqrt(3) / 2
# [times; speed] How often cells are halved: the first are eight times as large as the last.
HALVINGS = 3
# [px; empirical] The side of the last cells.
CELL = 1.7
# [cells; speed] Cells of which the children are counted at once.
CHUNK = 4096
# [ratio; empirical] Large cells say little: of them so many times as many may stay as of the last ones.
LARGE = 8
# [probability; empirical] So often a view sees a place.
SEEN = 0.35
# [cells; measured] Each ridge point belongs to one edge, and each point of an edge has one in every view that confirms
# it, so that there are no more of these, a pixel apart, than ridge points over confirming views; around each are some
# cells. In CAD models' edge maps 3.2 to 4.0 cells stay for each of them; where chance confirms far more, the rest is
# speculation.
CELLS_A_PLACE = 6.0


def carve(
    views: EdgeViews,
    half_side: float,
    cell: float,
    least_views: float,
    tick: Tick = no_tick,
    capped: Capped = not_said,
) -> Float[Array, "M 3"]:
    """Centres of the cells near edges, in the cube around the origin.

    A cell stays if in enough views some ridge passes it. The first cells are large; those that stay are divided. Where
    more stay than the ridges can account for, more views have to confirm them.

    Args:
        half_side: half the side of the cube, world units.
        cell: side of the last cells.
        least_views: so many views have to confirm a cell.
        tick: told how far it is; see `watch`.
        capped: told of what there was too much; see `watch`.
    """
    side = cell * 2**HALVINGS
    axis = side * (np.arange(np.ceil(2 * half_side / side)) + 0.5) - half_side
    cells = _grid(axis)
    cells = cells[_confirmed(views, cells, side, least_views)]
    for turn in range(HALVINGS):
        side /= 2
        last = turn == HALVINGS - 1
        cells = _divided(views, cells, side, least_views, tick if last else no_tick)
    most = most_cells(views, least_views)
    if len(cells) > most:
        capped("cells of space", most, len(cells))
    return _likeliest(views, cells, side, most)


def most_cells(views: EdgeViews, least_views: float) -> int:
    """How many cells the ridges can account for."""
    return int(CELLS_A_PLACE * len(views.points) / least_views)


def _likeliest(views: EdgeViews, cells: Float[Array, "M 3"], side: float, most: int) -> Float[Array, "K 3"]:
    """So many cells of which what the views show is least likely chance, in their order.

    Where pictures are full of texture chance confirms everything, and more views confirm what is nothing than confirm
    a faint edge before a plain wall.
    """
    if len(cells) <= most:
        return cells
    radius = HALF_DIAGONAL * side

    def chances(view: int) -> Float[NDArray[np.float32], "P 2"]:
        """What a view says at each pixel of a cell that no ridge passes there, and of one that a ridge passes."""
        chance = chance_near(views, view, radius / views.pixel).ravel()
        one = np.ones_like(chance, bool)
        both = [told(shown[None], chance[None], SEEN, one[None]).astype(np.float32) for shown in (~one, one)]
        return np.stack(both, 1)

    said = np.stack(side_by_side(chances, len(views), len(views)))
    reach = (radius * views.focal) ** 2
    kernel = getattr(kernels(), "edges_odds", None)
    # In pieces, so that no array leaves the processor's cache.
    pieces = np.array_split(cells, len(cells) // (8 * CHUNK) + 1)

    def odds_of(piece: int) -> Float[NDArray[np.float32], " K"]:
        if kernel:
            return np.asarray(kernel(views.single, *(torch.from_numpy(x) for x in (reach, pieces[piece], said))))
        odds = np.zeros(len(pieces[piece]), np.float32)
        for view in range(len(views)):
            off, depth, place = views.nearby(view, pieces[piece])
            near = off * np.maximum(depth, 1e-9) ** 2 < reach[view]
            odds += np.where(np.isfinite(off), said[view].reshape(-1).take(2 * place + near), 0)
        return odds

    odds = np.concatenate(in_copies(odds_of, len(pieces), len(pieces)))
    return cells[np.sort(np.argsort(-odds, kind="stable")[:most])]


def _grid(axis: Float[Array, " N"]) -> Float[Array, "M 3"]:
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)


def _divided(
    views: EdgeViews, cells: Float[Array, "M 3"], side: float, least_views: float, tick: Tick
) -> Float[Array, "K 3"]:
    """The eighths of cells that enough views confirm; part by part, so that memory is bounded."""
    corners = side * _grid(np.array([-0.5, 0.5]))
    most = LARGE * most_cells(views, least_views)

    def parts(piece: int) -> Float[Array, "P 3"]:
        return (cells[piece * CHUNK : (piece + 1) * CHUNK, None] + corners).reshape(-1, 3)

    count = -(-len(cells) // CHUNK)
    confirmed = in_copies(
        lambda piece: _confirmed(views, parts(piece), side, least_views),
        count,
        count,
        lambda done: tick(min(done * CHUNK, len(cells)), len(cells)),
    )
    kept = [np.zeros((0, 3))]
    for piece, stay in enumerate(confirmed):
        kept.append(parts(piece)[stay])
        if sum(map(len, kept)) > 2 * most:
            kept = [_likeliest(views, np.concatenate(kept), side, most)]
    return _likeliest(views, np.concatenate(kept), side, most)


def _confirmed(
    views: EdgeViews, cells: Float[Array, "M 3"], side: float, least_views: float
) -> Bool[NDArray[np.bool_], " M"]:
    """Whether enough views have a ridge within the pixels that half the diagonal of a cell covers."""
    reach = (HALF_DIAGONAL * side * views.focal) ** 2
    if kernel := getattr(kernels(), "edges_confirmed", None):
        places = torch.from_numpy(np.ascontiguousarray(cells))
        return np.asarray(kernel(views.single, torch.from_numpy(reach), places, int(np.ceil(least_views))))
    count = np.zeros(len(cells), np.int32)
    # View by view, in single precision: no array leaves the processor's cache.
    for view in range(len(views)):
        off, depth, _ = views.nearby(view, cells)
        count += off * np.maximum(depth, 1e-9) ** 2 < reach[view]
    return np.asarray(count >= least_views)
