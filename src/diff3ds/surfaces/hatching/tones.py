"""How dark a surface is to be in a view, and how wide the lines of each direction are that make it so."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.picture import Picture

By = Literal["light", "depth"]

# The most that lines cover of what lies between them, and the least: thinner ones are left out below half of it, and
# drawn so wide above. Shares; empirical.
FULL, THIN = 0.4, 0.08
# From the upper left and from beside who looks: x right, y down, z forward.
LIGHT = np.array([-0.5, -0.62, -0.6]) / np.linalg.norm([-0.5, -0.62, -0.6])
# The direction of the lines that each tone adds, and by how many spacings they are shifted: lines, others across them,
# then lines between both.
ADDED = ((0, 0.0), (1, 0.0), (0, 0.5), (1, 0.5))
MOST_TONES = len(ADDED)


@dataclass(frozen=True, eq=False)
class Hatch:
    """Tone by lines on a surface.

    Attributes:
        by: light, where lines are for what is turned away from a light at the upper left; depth, for what is near; or a
            picture, of shape (H, W), from 0, black, to 1, that is laid over the box of the surface as it is seen,
            corner on corner, as fine as 120 points across the surface show it.
        tones: 1 to 4: lines, others across them, and lines between both, each for what is darker than the ones before
            can make it.
        spacing: from line to line on the page, pixels; by default a hundredth of the picture's height.
        stipple: dots in place of lines, half a spacing wide, evenly spread, and the nearer to each other the darker it
            is; as dark as so many tones of lines are.

    Raises:
        ValueError: values out of range.
    """

    by: By | Float[Array, "H W"] = "light"
    tones: int = 3
    spacing: float | None = None
    stipple: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.by, np.ndarray):
            if self.by.ndim != 2 or not self.by.size or not (self.by >= 0).all() or not (self.by <= 1).all():
                got = f"shape {self.by.shape}" if self.by.ndim != 2 or not self.by.size else "others"
                raise ValueError(f"a picture to hatch by must have shape (H, W) and values in [0, 1], got {got}")
        elif self.by not in get_args(By):
            named = " or ".join(map(repr, get_args(By)))
            raise ValueError(f"hatch must be by {named}, or by a picture of shape (H, W), got {self.by!r}")
        if not 1 <= self.tones <= MOST_TONES:
            raise ValueError(f"tones must be from 1 to {MOST_TONES}, got {self.tones}")
        if self.spacing is not None and not 1 <= self.spacing < float("inf"):
            raise ValueError(f"spacing must be at least 1 pixel, got {self.spacing:g}")


def darkest(tones: int) -> float:
    """What so many tones can cover of a picture, a share: the tone of what no light reaches."""
    return 1 - _open(tones, 0) * _open(tones, 1)


def covered(tone: Float[Array, "..."], number: int) -> Float[Array, "..."]:
    """The share that the lines of one tone cover of their surroundings, from 0 to `FULL`.

    Lines of one direction leave open what they do not cover; of this, those of the other direction leave a share.
    """
    own = ADDED[number][0]
    return np.clip(_open(number, own) - (1 - tone) / _open(number, 1 - own), 0, FULL)


def _open(tones: int, direction: int) -> float:
    """The share that the lines of one direction leave open where so many tones are full."""
    return 1 - FULL * sum(way == direction for way, _ in ADDED[:tones])


def tone_of(
    points: Float[Array, "N 3"], normals: Float[Array, "N 3"], hatch: Hatch, picture: Picture, right: Float[Array, " 3"]
) -> Float[Array, " N"]:
    """How dark points of a surface are to be: the share of the page that is covered there.

    Args:
        right: the camera's x axis, a unit vector of the world.
    """
    if isinstance(hatch.by, np.ndarray):
        dark = 1 - _laid_over(hatch.by, picture.seen(points)[0])
    elif hatch.by == "light":
        down = np.cross(picture.forward, right)
        light = LIGHT @ np.stack([right, down, picture.forward])
        dark = 1 - np.clip(normals @ light, 0, 1)
    else:
        depths = picture.seen(points)[1]
        near, far = (float(d) for d in (depths.min(), depths.max()))
        dark = (far - depths) / max(far - near, 1e-12)
    return darkest(hatch.tones) * dark


def _laid_over(image: Float[Array, "H W"], pixels: Float[Array, "N 2"]) -> Float[Array, " N"]:
    """A picture over the box of places, corner on corner, as fine as these are dense: its values at each."""
    from scipy.ndimage import gaussian_filter, map_coordinates

    low, high = pixels.min(0), pixels.max(0)
    share = (pixels - low) / np.maximum(high - low, 1e-12)
    # As if half of the places were seen, evenly spread; a blur of half their distance.
    blurred = gaussian_filter(np.asarray(image, np.float64), 0.5 * (2 * image.size / len(pixels)) ** 0.5)
    rows_and_columns = share[:, ::-1].T * np.array(image.shape)[:, None] - 0.5
    return np.asarray(map_coordinates(blurred, rows_and_columns, order=1, mode="nearest"), np.float64)
