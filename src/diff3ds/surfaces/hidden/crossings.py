"""Where pictures of strokes cross outlines: straight segments in the picture, found by boxes and solved exactly."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.page.boxes import BoxIndex, largest
from diff3ds.page.chords import Chords, at
from diff3ds.page.picture import Picture

# Chords are cut to this length to be found by their boxes, pixels. Speed only.
STEP = 8.0
# Newton's steps from a chord's crossing to the stroke's, which double the digits each.
NEWTON = 4


@dataclass(frozen=True, eq=False)
class Outlines:
    """Segments in the picture at which what they belong to begins or ends to hide what lies behind.

    Attributes:
        pixels: both ends.
        depths: of both ends.
        index: of their boxes.
    """

    pixels: Float[Array, "O 2 2"]
    depths: Float[Array, "O 2"]
    index: BoxIndex

    @staticmethod
    def of(pixels: Float[Array, "O 2 2"], depths: Float[Array, "O 2"]) -> "Outlines":
        """By their ends."""
        low, high = np.minimum(pixels[:, 0], pixels[:, 1]), np.maximum(pixels[:, 0], pixels[:, 1])
        cell = max(STEP, float(np.median(largest(high - low)))) if len(pixels) else STEP
        return Outlines(pixels, depths, BoxIndex.of(low, high, cell))


def crossings(
    cubics: Float[Array, "S 4 4"], chords: Chords, outlines: Outlines, picture: Picture, behind: float
) -> tuple[Int[Index, " X"], Float[Array, " X"]]:
    """Segments and parameters where their pictures cross outlines in front of them.

    Args:
        behind: an outline so much farther away than the stroke counts too, world units: where a stroke runs on a
            surface, both are at one place.
    """
    segment, start, stop, ends = _cut(chords, picture.size)
    row, line = outlines.index.meeting(ends.min(1), ends.max(1))
    p, q = ends[row], outlines.pixels[line]
    u, v, w = p[:, 1] - p[:, 0], q[:, 1] - q[:, 0], q[:, 0] - p[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    across = np.where(area == 0, np.inf, area)
    along = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / across
    place = (w[:, 0] * u[:, 1] - w[:, 1] * u[:, 0]) / across
    # Chords reach a little farther: two that meet between outlines that meet must not both miss them.
    met = (np.abs(along - 0.5) <= 0.5 + 1e-9) & (np.abs(place - 0.5) <= 0.5 + 1e-9) & (area != 0)
    row, line, along, place, v, q = row[met], line[met], along[met], place[met], v[met], q[met]
    t = start[row] + along * (stop[row] - start[row])
    own = cubics[segment[row]]
    t = _on_line(own, t, np.stack([-v[:, 1], v[:, 0]], 1), q[:, 0], start[row], stop[row])
    point = at(own, t)
    depth = point[:, 3] / point[:, 2] if picture.orthographic else point[:, 2] / point[:, 3]
    d = outlines.depths[line]
    if picture.orthographic:
        other = d[:, 0] + place * (d[:, 1] - d[:, 0])
    else:
        other = 1 / (1 / d[:, 0] + place * (1 / d[:, 1] - 1 / d[:, 0]))
    nearer = other < depth + behind
    return segment[row[nearer]], t[nearer]


def _on_line(
    cubics: Float[Array, "N 4 4"],
    t: Float[Array, " N"],
    normal: Float[Array, "N 2"],
    origin: Float[Array, "N 2"],
    start: Float[Array, " N"],
    stop: Float[Array, " N"],
) -> Float[Array, " N"]:
    """Parameters near t where the pictures of cubics lie on lines, by Newton's method; t where that leads astray."""
    values = np.einsum("nkd,nd->nk", cubics[..., :2], normal) - (normal * origin).sum(1)[:, None] * cubics[..., 2]
    steps = 3 * np.diff(values, axis=1)
    found = t
    for _ in range(NEWTON):
        s = 1 - found
        b = np.stack([s**3, 3 * s * s * found, 3 * s * found**2, found**3], 1)
        c = np.stack([s * s, 2 * s * found, found**2], 1)
        slope = (c * steps).sum(1)
        found = found - (b * values).sum(1) / np.where(slope == 0, np.inf, slope)
    room = stop - start
    return np.where((found >= start - room) & (found <= stop + room), np.clip(found, 0, 1), t)


def _cut(
    chords: Chords, size: tuple[int, int]
) -> tuple[Int[Index, " P"], Float[Array, " P"], Float[Array, " P"], Float[Array, "P 2 2"]]:
    """Chords within the picture, in parts of at most `STEP`: segments, parameters and pixels of both ends."""
    low, high = chords.pixels[:, 0], chords.pixels[:, 1]
    way = high - low
    limit = np.array([size[1], size[0]], float)
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-1 - low) / way, (limit + 1 - low) / way
    still = way == 0
    outside = still & ((low < -1) | (low > limit + 1))
    enter = np.where(still, -np.inf, np.minimum(one, other)).max(1).clip(0, 1)
    leave = np.where(still, np.inf, np.maximum(one, other)).min(1).clip(0, 1)
    kept = np.flatnonzero((leave > enter) & ~outside.any(1))
    enter, leave, low, way = enter[kept], leave[kept], low[kept], way[kept]
    count = np.maximum(np.ceil((leave - enter) * np.linalg.norm(way, axis=1) / STEP), 1).astype(np.int64)
    row = np.repeat(np.arange(len(kept)), count)
    number = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    unit = ((leave - enter) / count)[row]
    first = enter[row] + number * unit
    last = first + unit
    ends = np.stack([low[row] + x[:, None] * way[row] for x in (first, last)], 1)
    start, wide = chords.start[kept][row], (chords.stop - chords.start)[kept][row]
    return chords.segment[kept][row], start + first * wide, start + last * wide, ends
