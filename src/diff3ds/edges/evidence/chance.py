"""What a view would show of a line by chance: how often lines of its direction lie on ridges thereabouts.

Texture is full of ridges, and whatever one draws there lies on some of them: that a view shows a line there says
little. A line in front of a plain wall is shown by its own ridge or not at all. Evidence is the logarithm of the ratio
of two probabilities, that of what a view shows if there is an edge, and that of the same by chance; of several views it
adds up. Views that do not show a line count against it where it may be seen: things hide their far sides and hollows,
and nothing says where, but what is seen from here is mostly seen from beside here. So whether a view sees a place is
judged by the views beside it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Int
from diff3ds.curves.directions import dot, unit
from diff3ds.edges.evidence.edge_views import OUTSIDE, EdgeViews
from diff3ds.edges.evidence.support import NEAR, SLANT, headings, in_pieces
from diff3ds.parallel.side_by_side import side_by_side

# [1; numerical] Directions of lines that are told apart. A ridge confirms lines up to 25 degrees from it: two of these
# to either side.
DIRECTIONS, TO_EITHER_SIDE = 14, 2
# [px, px; empirical] Cells of the map of chances, and the side of the square that it is the mean over: wider than what
# lies on both sides of a line, narrower than things.
CELL, AROUND = 4, 52
# [probability; empirical] Chances are at least and at most so.
LEAST, MOST = 0.02, 0.95
# [probability; empirical] A view that shows a place on an edge has a ridge there so often.
SHOWN = 0.85
# [views; empirical] So many views beside a view say whether it sees a place. [probability; empirical] It does at least
# and at most so likely.
BESIDE, UNSEEN, SURELY = 6, 0.02, 0.95


@dataclass(frozen=True, eq=False)
class Chance:
    """What V views show by chance.

    Attributes:
        views: these.
        shares: of the places around, those whose ridge would confirm a line of each of K directions.
        beside: for each view, the next ones by the directions that they look from.
        near: so near lies a ridge that confirms a line, pixels.
    """

    views: EdgeViews
    shares: Float[NDArray[np.float32], "V K R C"]
    beside: Int[NDArray[np.int64], "V B"]
    near: float = NEAR

    @staticmethod
    def of(views: EdgeViews, near: float = NEAR) -> "Chance":
        """The chances of all views that a ridge lies so near, pixels."""
        towards = unit(views.centers)
        beside = np.argsort(-(towards @ towards.T), axis=1, kind="stable")[:, 1 : BESIDE + 1]
        shares = side_by_side(lambda view: _shares(views, view, near), len(views), len(views))
        return Chance(views, np.stack(shares), beside, near)

    def at(self, pixel: Float[Array, "V M 2"], heading: Float[Array, "V M 2"]) -> Float[Array, "V M"]:
        """The chance at pixels of lines with these directions, unit vectors."""
        rows, columns = self.shares.shape[2:]
        # Looked up in one row of numbers, in half the time.
        places = (np.nan_to_num(pixel[..., k]) / CELL for k in (0, 1))
        column, row = (np.clip(p, 0, n - 1).astype(np.int64) for p, n in zip(places, (columns, rows), strict=True))
        row += rows * (_direction(heading) + DIRECTIONS * np.arange(len(pixel))[:, None])
        return np.clip(self.shares.reshape(-1).take(row * columns + column), LEAST, MOST)

    def evidence(
        self,
        x: Float[Array, "M 3"],
        tangents: Float[Array, "M 3"],
        asked: Bool[NDArray[np.bool_], "V M"] | None = None,
        seen: float | None = None,
    ) -> Float[Array, " M"]:
        """For an edge at points with unit tangents, against chance: natural logarithms, summed over the views.

        Args:
            asked: which views are asked about which points; default all.
            seen: how likely they see them; default as the views beside them say.
        """

        def of(piece: slice) -> Float[Array, " P"]:
            match = self.views.match(x[piece])
            heading = headings(self.views, x[piece], tangents[piece], match.pixel)
            across = np.abs(dot(heading, self.views.normals.take(match.ridge, 0)))
            inside = match.distance < OUTSIDE
            counts = inside if asked is None else inside & asked[:, piece]
            shown = (match.distance < self.near) & (across < SLANT)
            chance = self.at(match.pixel, heading)
            return told(shown, chance, self._seen(shown, chance) if seen is None else seen, counts)

        return in_pieces(of, len(self.views), len(x))

    def _seen(self, shown: Bool[NDArray[np.bool_], "V M"], chance: Float[Array, "V M"]) -> Float[Array, "V M"]:
        """How likely each view sees each point, by what the views beside it show more often than by chance."""
        beside = self.beside
        often = [np.mean([values[beside[:, k]] for k in range(beside.shape[1])], axis=0) for values in (shown, chance)]
        return np.asarray(np.clip((often[0] - often[1]) / (1 - often[1]) / SHOWN, UNSEEN, SURELY))


def told(
    shown: Bool[NDArray[np.bool_], "V M"],
    chance: Float[Array, "V M"],
    seen: Float[Array, "V M"] | float,
    asked: Bool[NDArray[np.bool_], "V M"],
) -> Float[Array, " M"]:
    """The logarithm of the odds of an edge against chance.

    Args:
        shown: which views show it.
        chance: how likely they would by chance.
        seen: how likely they see its place.
        asked: the views whose pictures hold it.
    """
    edge = seen * SHOWN + (1 - seen) * chance
    odds = np.log(np.where(shown, edge / chance, (1 - edge) / (1 - chance)))
    return np.asarray(np.where(asked, odds, 0.0).sum(0))


def _direction(heading: Float[Array, "*N 2"]) -> NDArray[np.int64]:
    """The number of a direction, whichever way it goes."""
    angle = np.arctan2(heading[..., 1], heading[..., 0]) % np.pi
    return (angle * (DIRECTIONS / np.pi)).astype(np.int64) % DIRECTIONS


def chance_near(views: EdgeViews, view: int, within: float) -> Float[Array, "H W"]:
    """The chance that a ridge passes a pixel of a view so near, pixels: the share of places around where one does."""
    from scipy.ndimage import uniform_filter

    share = uniform_filter((_distances(views, view) < within).astype(np.float32), AROUND, mode="nearest")
    return np.clip(share.astype(np.float64), LEAST, MOST)


def _distances(views: EdgeViews, view: int) -> Float[Array, "H W"]:
    """Of the centre of each pixel from the nearest ridge, pixels; infinite where there is none."""
    nearest = views.nearest[view]
    if not (nearest >= 0).any():
        return np.full(nearest.shape, np.inf)
    across, down = (axis.take(nearest) for axis in views.tables[2].numpy())
    across -= np.arange(nearest.shape[1]) + 0.5
    down -= (np.arange(nearest.shape[0]) + 0.5)[:, None]
    return np.asarray(np.hypot(across, down))


def _shares(views: EdgeViews, view: int, within: float) -> Float[NDArray[np.float32], "K R C"]:
    from scipy.ndimage import uniform_filter

    height, width = views.size
    rows, columns = -(-height // CELL), -(-width // CELL)
    near = _distances(views, view) < within
    row, column = np.nonzero(near)
    cell = row // CELL * columns + column // CELL
    normal = views.normals[views.nearest[view][near]]
    direction = _direction(np.stack([-normal[:, 1], normal[:, 0]], 1))
    counts = np.bincount(direction * rows * columns + cell, minlength=DIRECTIONS * rows * columns)
    shares = counts.reshape(DIRECTIONS, rows, columns).astype(np.float32) / CELL**2
    # The outermost of the directions are half within the angle.
    turns = range(-TO_EITHER_SIDE, TO_EITHER_SIDE + 1)
    weights = [0.5 if abs(k) == TO_EITHER_SIDE else 1.0 for k in turns]
    confirming = np.sum([weight * np.roll(shares, k, 0) for weight, k in zip(weights, turns, strict=True)], axis=0)
    return uniform_filter(confirming, (0, AROUND // CELL, AROUND // CELL), mode="nearest")
