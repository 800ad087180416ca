"""The lines of a picture: centre lines of a drawing, edges of a photograph, wherever and however large they are in it.

Points on them, with directions, are what `recognise` compares; drawn again with one width they are a reference.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Float
from diff3ds.edges.evidence.ridges import MAP_SIGMA, MAP_VALUE, Ridges, color_ridges, find_ridges, map_ridges
from diff3ds.pictures.content.ink import INKED, depth_in, is_thin, without_specks
from diff3ds.pictures.reference_picture import FAINT, ReferencePicture

Array = NDArray[np.float64]
Kind = Literal["drawing", "photograph"]

# Inside an object that was cut out, paper is the colour of most of it; ink has less than this fraction, differs by
# this, and lies deeper than so many pixels, by the median. Empirical.
MOST_INK, PLAIN, RIM = 0.4, 0.12, 2.0
# Lines whose pixels lie deeper than this, by their median, are wide: over a line of half width h depths are even from
# 0 to h.
WIDE = 1.5
# Pixels beside a line that may be mixed with what is beside it.
MIXED = 2
# Filters see no true neighbours along the border.
PADDING = 8


@dataclass(frozen=True, eq=False)
class Lines:
    """Points along lines: the longer side of their box is 1, its middle the origin; x to the right, y down.

    Attributes:
        points: some hundred and more.
        tangents: along the line, of either sign; as long as the piece of line that the point stands for.
        kind: what they were found in.
        colors: of the points, straight RGB in [0, 1]; by default black.
    """

    points: Float[Array, "N 2"]
    tangents: Float[Array, "N 2"]
    kind: Kind = "drawing"
    colors: Float[Array, "N 3"] = field(default_factory=lambda: np.zeros((1, 3)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "colors", np.broadcast_to(self.colors, (len(self.points), 3)))

    def turned(self, degrees: float) -> "Lines":
        """The lines turned about their middle, from x towards y."""
        turn = np.deg2rad(degrees)
        across = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]).T
        points = self.points @ across
        low, high = points.min(0), points.max(0)
        side = float((high - low).max()) or 1.0
        return replace(self, points=(points - (low + high) / 2) / side, tangents=self.tangents @ across / side)

    def ink(
        self, size: int, width: float, scale: float, middle: tuple[float, float] = (0.5, 0.5)
    ) -> Float[NDArray[np.float32], "S S"]:
        """The lines drawn again, ink in [0, 1].

        Args:
            size: height and width, pixels.
            width: of the lines, as a fraction of the height.
            scale: of the longer side of their box, the same.
            middle: of their box, x and y, the same.
        """
        from scipy.spatial import cKDTree

        centres = (np.arange(size) + 0.5) / size
        pixels = np.stack(np.meshgrid(centres, centres), -1)
        distance, _ = cKDTree(self.points * scale + np.array(middle)).query(pixels)
        # Ink falls off over one pixel.
        ink: NDArray[np.float32] = np.clip((width / 2 - distance) * size + 0.5, 0, 1).astype(np.float32)
        return ink


def lines_of(picture: ReferencePicture) -> Lines:
    """The lines of a drawing, dark or light, on paper or on nothing; the edges of what is no drawing.

    Raises:
        ValueError: there is none.
    """
    rgba = np.pad(picture.pixels.numpy(), ((PADDING, PADDING), (PADDING, PADDING), (0, 0)))
    ink = _ink(rgba)
    ridges = _one_a_pixel(_without_specks(color_ridges(rgba) if ink is None else _centre_lines(ink), len(rgba)))
    if not len(ridges):
        raise ValueError("the picture has no lines: give a drawing in lines, or a photograph of one object")
    # A line of length 1 crosses so many pixels, of which each has a point.
    along = np.stack([-ridges.normals[:, 1], ridges.normals[:, 0]], 1)
    along = along / np.abs(along).sum(1, keepdims=True)
    low, high = ridges.points.min(0), ridges.points.max(0)
    side = max(float((high - low).max()), 1.0)
    kind: Kind = "drawing" if ink is not None else "photograph"
    return Lines((ridges.points - (low + high) / 2) / side, along / side, kind, _colors_at(ridges.points, rgba))


def _colors_at(points: Float[Array, "N 2"], rgba: Float[NDArray[np.float32], "H W 4"]) -> Float[Array, "N 3"]:
    """The colour of the line at each point: beside it some pixels are lighter, where they are mixed with paper."""
    over_white = rgba[..., :3] + (1 - rgba[..., 3:])
    column, row = np.floor(points).astype(int).T
    around = np.arange(-MIXED, MIXED + 1)
    down, right = (a.ravel() for a in np.meshgrid(around, around))
    near = over_white[
        (row[:, None] + down).clip(0, len(rgba) - 1), (column[:, None] + right).clip(0, rgba.shape[1] - 1)
    ]
    darkest: Float[Array, "N 3"] = near[np.arange(len(near)), near.min(2).argmin(1)].astype(float)
    return darkest


def _ink(rgba: Float[NDArray[np.float32], "H W 4"]) -> Float[NDArray[np.float32], "H W"] | None:
    """Ink in [0, 1] of a drawing; None if it is none.

    Where the background was cut away, what is left is the ink; where paper was cut out, ink is what differs from it.
    """
    alpha = rgba[..., 3]
    if is_thin(alpha):
        return alpha
    inside = alpha > INKED * alpha.max()
    colors = rgba[..., :3] / np.maximum(alpha, 1e-3)[..., None]
    differs = np.abs(colors - np.median(colors[inside], axis=0)).max(-1) * inside
    fraction = float((differs[inside] > PLAIN).mean())
    strongest = float(np.quantile(differs, 1 - 0.1 * fraction * inside.mean())) if fraction else 0.0
    if not 0 < fraction < MOST_INK or strongest < PLAIN:
        return None
    ink = np.clip(differs / strongest, 0, 1)
    # Mixed colours along the outline are no ink.
    rim = np.median(depth_in(alpha)[ink > INKED]) < RIM
    return None if rim or not is_thin(ink) else ink


def _centre_lines(ink: Float[NDArray[np.float32], "H W"]) -> Ridges:
    """Thin lines are the ridges of the ink; wide ones, whose tops are flat, those of the depth in it."""
    depth = depth_in(ink)
    if np.median(depth[depth > 0]) > WIDE:
        return find_ridges(depth.astype(np.float32), MAP_SIGMA, MAP_VALUE)
    return map_ridges(np.clip(ink / np.quantile(ink[ink > FAINT], 0.9), 0, 1).astype(np.float32))


def _one_a_pixel(ridges: Ridges) -> Ridges:
    """A ridge between two pixels is found from both; one point is left in each pixel that has some."""
    _, first = np.unique(np.floor(ridges.points), axis=0, return_index=True)
    kept = np.zeros(len(ridges), bool)
    kept[first] = True
    return ridges[kept]


def _without_specks(ridges: Ridges, side: int) -> Ridges:
    """The ridges of lines that are longer than specks."""
    # A spot has no direction.
    ridges = ridges[np.abs(ridges.normals).max(1, initial=0) > 0]
    if not len(ridges):
        return ridges
    column, row = np.floor(ridges.points).astype(int).clip(0, side - 1).T
    drawn = np.zeros((side, side), bool)
    drawn[row, column] = True
    return ridges[without_specks(drawn)[row, column]]
