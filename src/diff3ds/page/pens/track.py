"""A track: what a pen draws without being lifted; its parts, and points along it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.bezier.curves import subcurve_matrix
from diff3ds.page.chords import at

# Samples keep so near to each other, in the steps that are asked for: cubics are run through unevenly. Empirical.
CLOSER = 1.5


class Track(NamedTuple):
    """What a pen draws without being lifted.

    Attributes:
        cubics: that follow on each other, pixels.
        closed: whether the last ends where the first begins.
        strokes: the numbers of those that it draws, in their order along it.
    """

    cubics: Float[Array, "K 4 2"]
    closed: bool
    strokes: tuple[int, ...]

    @property
    def ends(self) -> Float[Array, "2 2"]:
        """Its first and its last point."""
        return np.stack([self.cubics[0, 0], self.cubics[-1, 3]])

    @property
    def back(self) -> "Track":
        """The same from its other end."""
        return self._replace(cubics=self.cubics[::-1, ::-1], strokes=self.strokes[::-1])

    def part(self, start: float, stop: float) -> "Track":
        """An open part from one place to another; a place is the number of a cubic and the parameter in it."""
        first, last = min(int(start), len(self.cubics) - 1), max(math.ceil(stop), int(start) + 1)
        rows = np.arange(first, last)
        begin, end = (torch.from_numpy((float(place) - rows).clip(0, 1)) for place in (start, stop))
        return self._replace(cubics=subcurve_matrix(begin, end, 3).numpy() @ self.cubics[rows], closed=False)

    def begun_at(self, place: float) -> "Track":
        """A closed track from another place on."""
        turned = [self.part(place, len(self.cubics)), self.part(0, place)] if 0 < place < len(self.cubics) else [self]
        return self._replace(cubics=np.concatenate([part.cubics for part in turned]))


class Samples(NamedTuple):
    """S samples of tracks, each in the middle of a cell of its cubic.

    Attributes:
        track: of each.
        place: where its cell begins, as `Track.part` has places.
        size: of its cell, in these.
        points: pixels.
        direction: unit vectors.
        length: of its cell, pixels.
    """

    track: Int[Index, " S"]
    place: Float[Array, " S"]
    size: Float[Array, " S"]
    points: Float[Array, "S 2"]
    direction: Float[Array, "S 2"]
    length: Float[Array, " S"]

    @staticmethod
    def of(tracks: Sequence[Track], step: float) -> "Samples":
        """Samples that are about a step apart, pixels; one of a cubic at least."""
        cubics = np.concatenate([track.cubics for track in tracks])
        legs = np.linalg.norm(np.diff(cubics, axis=1), axis=2).sum(1)
        count = np.maximum(np.ceil(CLOSER * legs / step), 1).astype(np.int64)
        row = np.repeat(np.arange(len(cubics)), count)
        size = 1 / count[row]
        begin = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)) * size
        first, last = at(cubics[row], begin), at(cubics[row], begin + size)
        length = np.linalg.norm(last - first, axis=1)
        numbers = [len(track.cubics) for track in tracks]
        within = np.concatenate([np.arange(number) for number in numbers])
        return Samples(
            np.repeat(np.arange(len(tracks)), numbers)[row],
            within[row] + begin,
            size,
            at(cubics[row], begin + size / 2),
            (last - first) / np.maximum(length, 1e-12)[:, None],
            length,
        )
