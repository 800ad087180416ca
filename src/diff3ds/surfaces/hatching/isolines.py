"""Lines across the faces of a mesh where phases on it pass whole turns, as chains of points on its edges."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.surfaces.hatching.stripes import Stripes


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps of lines, each across one face.

    Attributes:
        face: the face of each, as a row of `Stripes`.
        place: the edge of the face (0, 1 or 2) at both ends.
        share: how far along it, from its first corner in the face's order to the next.
        key: numbers that ends have alike where steps meet: of their edge and the line that crosses it.
    """

    face: Int[Index, " S"]
    place: Int[Index, "S 2"]
    share: Float[Array, "S 2"]
    key: Int[Index, "S 2"]


def isolines(found: Stripes, shift: float) -> Steps:
    """Where phases are whole turns plus a shift.

    Args:
        found: the phases.
        shift: turns, 0 or a half: lines between the lines.
    """
    rows = np.flatnonzero(found.whole)
    turns = found.phases[rows] / (2 * np.pi) - shift
    low, high = (np.floor(end).astype(np.int64) for end in (turns.min(1), turns.max(1)))
    count = high - low
    row = np.repeat(np.arange(len(rows)), count)
    level = low[row] + 1 + np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    values, face = turns[row], rows[row]
    below = values < level[:, None]
    # Of three edges two go from one side to the other.
    place = np.argsort(below == np.roll(below, -1, 1), axis=1, kind="stable")[:, :2]
    one, other = (np.take_along_axis(ends, place, 1) for ends in (values, np.roll(values, -1, 1)))
    # Both faces at an edge count the lines across it from the same end.
    faces = found.faces[face]
    forwards = np.take_along_axis(faces < np.roll(faces, -1, 1), place, 1)
    first, last = np.where(forwards, one, other), np.where(forwards, other, one)
    start = np.floor(first).astype(np.int64)
    number = np.where(first < last, level[:, None] - start - 1, start - level[:, None])
    most = int(number.max(initial=0)) + 1
    edge = np.take_along_axis(found.edges[face], place, 1)
    return Steps(face, place, (level[:, None] - one) / (other - one), edge * most + number)
