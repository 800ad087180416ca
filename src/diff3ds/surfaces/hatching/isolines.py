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

    Lines cross edges where the phase along these says so. Within a face they go around its corners, as many from one
    edge to the next as both have; what is left of the third is where a line begins or ends.

    Args:
        found: the phases.
        shift: turns, 0 or a half: lines between the lines.
    """
    start, change = found.first - shift, found.change
    at_first, at_second = (np.floor(end).astype(np.int64) for end in (start, start + change))
    count = np.abs(at_second - at_first)
    here = np.arange(3)
    before, across = (here + 2) % 3, (here + 1) % 3
    number, edges = count[found.edges], found.edges
    around = (number[:, before] + number - number[:, across]) // 2
    around = np.clip(around, 0, np.minimum(number[:, before], number))
    # Of an odd number one is left over: that on the edge along which the phase changes least.
    spare = number - around - around[:, across]
    steep = np.abs(change)[edges]
    one_more = np.where((spare[:, before] > 0) & (spare > 0), steep[:, before] + steep - steep[:, across], -np.inf)
    best = one_more.argmax(1)
    row = np.arange(len(edges))
    around[row, best] += np.isfinite(one_more[row, best])
    face, corner = (np.repeat(each.ravel(), around.ravel()) for each in np.indices(around.shape))
    nth = np.arange(len(face)) - np.repeat(np.cumsum(around) - around.ravel(), around.ravel())
    # The edge that ends at the corner, and the one that begins there.
    place = np.stack([before[corner], corner], 1)
    edge, forwards = edges[face[:, None], place], found.forwards[face[:, None], place]
    from_start = forwards == [False, True]
    nth = np.where(from_start, nth[:, None], count[edge] - 1 - nth[:, None])
    level = np.where(change[edge] > 0, at_first[edge] + 1 + nth, at_first[edge] - nth)
    share = (level - start[edge]) / change[edge]
    most = int(count.max(initial=0)) + 1
    return Steps(face, place, np.where(forwards, share, 1 - share), edge * most + nth)
