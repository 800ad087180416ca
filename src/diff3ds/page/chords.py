"""Strokes in a picture as chords, and lengths along them there."""

from dataclasses import dataclass

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.bezier.curves import subcurve_matrix
from diff3ds.bezier.measure import chord_intervals
from diff3ds.page.picture import Picture
from diff3ds.render.near_plane import visible_spans

# Chords stay so near to strokes, pixels: where a stroke crosses an outline, its chord is taken to do so as well.
CHORD = 0.05


@dataclass(frozen=True, eq=False)
class Chords:
    """Straight pieces of strokes in the picture, in order along each.

    Attributes:
        segment: the segment of each.
        start: its parameter where the chord begins.
        stop: and ends.
        pixels: both ends.
    """

    segment: Int[Index, " C"]
    start: Float[Array, " C"]
    stop: Float[Array, " C"]
    pixels: Float[Array, "C 2 2"]

    @property
    def length(self) -> Float[Array, " C"]:
        """Pixels."""
        return np.asarray(np.linalg.norm(self.pixels[:, 1] - self.pixels[:, 0], axis=1))


def chords_of(cubics: Float[Array, "S 4 4"], picture: Picture) -> Chords:
    """The chords of projected cubics (X, Y, Z, W), in front of the near plane."""
    control = torch.from_numpy(cubics)
    over, under = (3, 2) if picture.orthographic else (2, 3)
    margin = control[..., over] - picture.near * control[..., under]
    spans = visible_spans(margin[None])
    part = subcurve_matrix(spans.start, spans.stop, 3) @ control[spans.segment][..., :3]
    intervals = chord_intervals(part, CHORD)
    row = intervals.curve
    wide = spans.stop - spans.start
    start = (spans.start[row] + wide[row] * intervals.start).numpy()
    stop = (spans.start[row] + wide[row] * intervals.stop).numpy()
    segment = spans.segment[row].numpy()
    order = np.lexsort((start, segment))
    segment, start, stop = segment[order], start[order], stop[order]
    ends = [at(cubics[segment], t) for t in (start, stop)]
    return Chords(segment, start, stop, np.stack([end[:, :2] / end[:, 2:3] for end in ends], 1))


def at(cubics: Float[Array, "N 4 E"], t: Float[Array, " N"]) -> Float[Array, "N E"]:
    """One point of each cubic."""
    s = 1 - t
    return np.einsum("nk,nke->ne", np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], 1), cubics)


class Ruler:
    """Lengths along strokes in the picture."""

    def __init__(self, chords: Chords) -> None:
        # Chords follow on each other; parameters of one segment after the other make one axis.
        self._axis = np.stack([chords.segment + chords.start, chords.segment + chords.stop], 1).ravel()
        total = np.cumsum(chords.length)
        self._length = np.stack([total - chords.length, total], 1).ravel()

    def length(self, segment: Int[Index, " P"], start: Float[Array, " P"], stop: Float[Array, " P"]) -> Array:
        """Of parts, pixels."""
        return self.position(segment, stop) - self.position(segment, start)

    def position(self, segment: Int[Index, " P"], t: Float[Array, " P"]) -> Float[Array, " P"]:
        """How far along all strokes together points lie, pixels."""
        return np.asarray(np.interp(segment + t, self._axis, self._length))

    def places(self, segment: Index, start: Array, stop: Array, shares: Array) -> Float[Array, " P"]:
        """Parameters at shares of the length of parts."""
        low, high = self.position(segment, start), self.position(segment, stop)
        t = np.interp(low + shares * (high - low), self._length, self._axis) - segment
        # Where nothing moves in the picture, lengths say nothing.
        return np.where((t > start) & (t < stop), t, start + shares * (stop - start))
