"""Independent answers: distances to densely sampled curves, areas and pictures by 32 x 32 samples a pixel."""

import functools

import numpy as np
from scipy.spatial import cKDTree

from diff3ds.project import Strokes2D

# Points along a curve, and cells in a pixel and direction.
POINTS, CELLS = 6001, 32


def curve_points(cubic: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (POINTS, 2) on the screen, evenly along the curve, and depths of a homogeneous cubic (4, 4)."""
    t = np.linspace(0, 1, POINTS)
    for _ in range(4):
        basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], 1)
        value = basis @ cubic
        position = value[:, :2] / value[:, 2:3]
        along = np.concatenate([[0], np.linalg.norm(np.diff(position, axis=0), axis=1).cumsum()])
        # Uneven weights leave all points at the ends; half of the points stay even in t, for the sake of cusps.
        even = along / max(along[-1], 1e-300) + t
        t = np.interp(np.linspace(0, even[-1], POINTS), even, t)
    return position, value[:, 2] / value[:, 3]


def distances(cubic: np.ndarray, query: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance and depth at the closest point: the nearest sample, refined on the two chords that meet in it."""
    position, depth = curve_points(cubic)
    nearest = cKDTree(position).query(query)[1]
    best, where = np.full(len(query), np.inf), np.zeros(len(query))
    for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, POINTS - 2)):
        chord, offset = position[first + 1] - position[first], query - position[first]
        share = np.clip((offset * chord).sum(1) / np.maximum((chord * chord).sum(1), 1e-300), 0, 1)
        d = np.linalg.norm(offset - share[:, None] * chord, axis=1)
        where = np.where(d < best, first + share, where)
        best = np.minimum(best, d)
    return best, np.interp(where, np.arange(POINTS), depth)


def cell_centers(size: tuple[int, int], cells: int = CELLS) -> np.ndarray:
    """Positions (height * width, cells * cells, 2)."""
    y, x = np.mgrid[0 : size[0], 0 : size[1]]
    v, u = (np.mgrid[0:cells, 0:cells] + 0.5) / cells
    return np.stack([x.reshape(-1, 1) + u.ravel(), y.reshape(-1, 1) + v.ravel()], -1)


def inside(cubic: np.ndarray, half_width: float, size: tuple[int, int], world: bool = False) -> np.ndarray:
    """How far (px) each cell (height * width, CELLS * CELLS) lies within a stroke; infinite beyond a pixel."""

    def depth_in_stroke(query: np.ndarray) -> np.ndarray:
        d, z = distances(cubic, query.reshape(-1, 2))
        return (half_width / (z if world else 1) - d).reshape(query.shape[:-1])

    middle = depth_in_stroke(cell_centers(size, 1))
    cells = np.repeat(np.where(middle > 0, np.inf, -np.inf), CELLS**2, 1)
    # From its centre to its corners a pixel has sqrt(1/2); the width may change on the way.
    edge = np.abs(middle[:, 0]) < 0.8
    cells[edge] = depth_in_stroke(cell_centers(size)[edge])
    return cells


def covered(cubic: np.ndarray, half_width: float, size: tuple[int, int]) -> np.ndarray:
    """Share (height, width) of each pixel within the half width of a curve, by CELLS x CELLS samples."""
    return (inside(cubic, half_width, size) > 0).mean(1).reshape(size)


def supersampled(strokes: Strokes2D, size: tuple[int, int]) -> np.ndarray:
    """Colour over white and alpha (height, width, 4) of one view, by CELLS x CELLS samples a pixel.

    A cell that an edge crosses counts by the share inside, the edge taken as straight in it: without that the picture
    would have steps in place of a derivative. Strokes are composited as wholes, by depth at their start: they must
    lie at depths that do not overlap.
    """
    image, clear = 0.0, 1.0
    cubics = strokes.cubics[0].detach().numpy()
    appearance = (t.detach().numpy() for t in (strokes.half_width[0], strokes.color, strokes.opacity))
    half_width, color, opacity = appearance
    for n in np.argsort(strokes.depth(strokes.cubics[0, :, 0].detach()).numpy()):
        share = _share(cubics[n].tobytes(), float(half_width[n]), size, strokes.width_space == "world")
        image = image + (clear * opacity[n] * share)[..., None] * color[n]
        clear = clear * (1 - opacity[n] * share)
    return np.concatenate([image + clear[..., None], 1 - clear[..., None]], -1).mean(1).reshape(*size, 4)


@functools.lru_cache(maxsize=8)
def _share(cubic: bytes, half_width: float, size: tuple[int, int], world: bool) -> np.ndarray:
    return np.clip(inside(np.frombuffer(cubic).reshape(4, 4), half_width, size, world) * CELLS + 0.5, 0, 1)


def box_coverage(distance: np.ndarray, half_width: float) -> np.ndarray:
    """Docs eq. 7, written down once more: the share of the unit interval around `distance` within the half width."""
    return np.clip(np.minimum(distance + 0.5, half_width) - np.maximum(distance - 0.5, -half_width), 0, None)
