"""Feature lines of a triangle mesh: its sharp edges and borders as lines, arcs of circles and ellipses, fair cubics."""

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Int
from diff3ds.edges.clean.simplify import simplest
from diff3ds.edges.shapes.curve_set import Curves
from diff3ds.edges.shapes.primitives import CLOSED_KINDS, Kind, Primitive

# Faces that meet at more than this make a sharp edge, and edges that turn by more a corner: rounds of ten sides and
# more are smooth. Degrees.
SHARP = 38.0
# Curves keep within half of this, as a share of the mesh's longest side.
PIXEL = 1 / 256
# Vertices nearer than this, as a share of that side, are one: files repeat them for every face or texture.
SAME = 1e-6
# Where edges so much longer than the next ones turn at all, degrees, a straight line goes over into a round.
UNEVEN, STRAIGHT = 3.0, 1.0
# So large a share of the feature lines may end nowhere: of a machine part few do, of an animal most. Empirical.
MOST_LOOSE = 0.5
# From so many places a mesh's outlines are looked at.
DIRECTIONS = 32
# Three points are always on a circle, four on a cubic, and five of a plane on a conic.
LEAST_ARC, LEAST_CUBIC, LEAST_ELLIPSE = 4, 5, 6


def mesh_lines(vertices: Float[Array, "V 3"], faces: Int[NDArray[np.int64], "F 3"], most: int) -> Curves:
    """The feature lines, in the mesh's frame; curves share vertices where edges of the mesh meet.

    Round shapes without an edge have none: their outlines depend on the view.

    Args:
        most: more feature lines are an error.

    Raises:
        ValueError: there are none, more than `most`, or mostly scraps that end within a smooth surface.
    """
    vertices, faces = _joined(vertices, faces)
    side = float(np.ptp(vertices[faces], axis=(0, 1)).max())
    edges, sharp, _ = _edges(vertices, faces)
    chains = list(_chains(vertices, edges[sharp]))
    if not chains:
        raise ValueError("the mesh has no sharp edges and no borders: of smooth shapes there are no feature lines")
    ends = Counter(end for chain in chains for end in (chain[0], chain[-1]))
    loose = sum(ends[chain[0]] == 1 or ends[chain[-1]] == 1 for chain in chains)
    if loose > MOST_LOOSE * len(chains):
        raise ValueError(
            f"the mesh is smooth: {loose} of its {len(chains)} sharp edges end nowhere, and scraps are no drawing of it"
        )
    if len(chains) > most:
        raise ValueError(f"the mesh has {len(chains)} feature lines, more than {most}: smooth or simplify it")
    pieces = [piece for chain in chains for piece in _pieces(vertices, chain, PIXEL * side)]
    return _curves(vertices, pieces)


def outline_share(vertices: Float[Array, "V 3"], faces: Int[NDArray[np.int64], "F 3"]) -> float:
    """Which share of the outlines the feature lines draw, in [0, 1]: of a box all, of a sphere nothing.

    By length in pictures from `DIRECTIONS` far places all around, hidden parts included.
    """
    vertices, faces = _joined(vertices, faces)
    edges, sharp, (one, other) = _edges(vertices, faces)
    k = np.arange(DIRECTIONS) + 0.5
    height, turn = 1 - 2 * k / DIRECTIONS, np.pi * (1 + 5**0.5) * k
    around = np.sqrt(1 - height**2)
    drawn, whole = 0.0, 0.0
    for view in np.stack([around * np.cos(turn), around * np.sin(turn), height], 1):
        # Edges without a second face have no normal there, and are outlines from everywhere.
        outline = ~((one @ view) * (other @ view) > 0)
        length = np.linalg.norm(np.cross(np.diff(vertices[edges[outline]], axis=1)[:, 0], view), axis=1)
        drawn, whole = drawn + length[sharp[outline]].sum(), whole + length.sum()
    return float(drawn / whole) if whole else 1.0


def _joined(
    vertices: Float[Array, "V 3"], faces: Int[NDArray[np.int64], "F 3"]
) -> tuple[Float[Array, "W 3"], Int[NDArray[np.int64], "F 3"]]:
    """The mesh with vertices in one place made one."""
    side = float(np.ptp(vertices[faces], axis=(0, 1)).max()) if len(faces) else 0.0
    if not side > 0:
        raise ValueError("the mesh has no faces of any size")
    _, first, same = np.unique(np.round(vertices / (SAME * side)), axis=0, return_index=True, return_inverse=True)
    return vertices[first], same.reshape(-1)[faces]


def _edges(
    vertices: Float[Array, "V 3"], faces: Int[NDArray[np.int64], "F 3"]
) -> tuple[Int[NDArray[np.int64], "E 2"], NDArray[np.bool_], tuple[Array, Array]]:
    """All edges; which are of one face or more than two, or of two that meet sharply; and the normals beside them.

    Normals of two faces point to the same side, however each is wound; where there are not two, they are NaN.
    """
    # Files that show both sides have every face twice.
    faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    flat = length > 0
    faces, normals = faces[flat], normals[flat] / length[flat, None]
    sides = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    rising = sides[:, 0] < sides[:, 1]
    edges, edge, count = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.reshape(-1), kind="stable")
    start = np.cumsum(count) - count
    two = count == 2
    one, other = (order[start[two] + k] for k in (0, 1))
    # Faces that are wound alike go along their edge in opposite directions.
    beside = np.full((2, len(edges), 3), np.nan)
    beside[0, two] = normals[one // 3]
    beside[1, two] = np.where((rising[one] == rising[other])[:, None], -1, 1) * normals[other // 3]
    sharp = ~((beside[0] * beside[1]).sum(1) >= np.cos(np.deg2rad(SHARP)))
    return edges, sharp, (beside[0], beside[1])


def _chains(vertices: Float[Array, "V 3"], edges: Int[NDArray[np.int64], "E 2"]) -> Iterator[list[int]]:
    """Vertices along the edges, from where they branch, end or turn sharply; loops end where they begin."""
    near: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    ends = {v for v, beside in near.items() if len(beside) != 2 or _turns(vertices[[beside[0], v, beside[1]]])}
    seen: set[tuple[int, int]] = set()
    for start in (*sorted(ends), *sorted(near.keys() - ends)):
        for after in near[start]:
            if (start, after) in seen:
                continue
            chain = [start, after]
            while chain[-1] not in ends and chain[-1] != start:
                a, b = near[chain[-1]]
                chain.append(b if a == chain[-2] else a)
            seen.update(pairwise(chain))
            seen.update(pairwise(chain[::-1]))
            yield chain


def _turns(points: Float[Array, "3 3"]) -> bool:
    """Whether a line through three points has a corner, or its straight part ends where a round begins."""
    first, second = np.diff(points, axis=0)
    lengths = sorted((float(np.linalg.norm(first)), float(np.linalg.norm(second))))
    turn = float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))
    return turn > SHARP or (lengths[1] > UNEVEN * lengths[0] and turn > STRAIGHT)


# A run of vertices and the strokes that draw it.
_Piece = tuple[list[int], list[Primitive]]


def _pieces(vertices: Float[Array, "V 3"], chain: list[int], pixel: float) -> Iterator[_Piece]:
    """A chain in as few curves as can be from its start: each goes as far as it fits."""
    while len(chain) > 1:
        count = _longest(vertices[chain], pixel)
        strokes = _fit(vertices[chain[:count]], pixel)
        assert strokes is not None
        yield chain[:count], strokes
        chain = chain[count - 1 :]


def _longest(points: Float[Array, "M 3"], pixel: float) -> int:
    """How many of the points, from the first on, one curve fits: twice as many while it does, then between."""
    # A part of an ellipse may say too little about it.
    if _fit(points, pixel):
        return len(points)
    few = min(len(points), LEAST_CUBIC)
    good = next(count for count in range(few, 1, -1) if _fit(points[:count], pixel))
    if good < few:
        return good
    bad = min(2 * good, len(points))
    while _fit(points[:bad], pixel):
        good, bad = bad, min(2 * bad, len(points))
    while bad - good > 1:
        middle = (good + bad) // 2
        good, bad = (middle, bad) if _fit(points[:middle], pixel) else (good, middle)
    return good


def _fit(points: Float[Array, "M 3"], pixel: float) -> list[Primitive] | None:
    """The simplest curve through the points, if there is one and they leave it no choice."""
    found = simplest(points, pixel)
    least = {Kind.LINE: 2, Kind.ARC: LEAST_ARC, Kind.FREE: LEAST_CUBIC, Kind.ELLIPTIC_ARC: LEAST_ELLIPSE}
    if not found or len(points) < least[CLOSED_KINDS.get(found[0].kind, found[0].kind)]:
        return None
    return found


def _curves(vertices: Float[Array, "V 3"], pieces: list[_Piece]) -> Curves:
    """All curves; those that are not closed meet in the vertices of the mesh."""
    control: list[Array] = []
    kinds, ends = [], []
    fresh = len(vertices)
    for run, strokes in pieces:
        points = [stroke.control.copy() for stroke in strokes]
        if strokes[0].kind in CLOSED_KINDS:
            stops = [fresh, fresh + 1]
        else:
            stops = [run[0], *range(fresh, fresh + len(strokes) - 1), run[-1]]
            points[0][0], points[-1][-1] = vertices[run[0]], vertices[run[-1]]
        fresh += len(strokes) + 1
        control += points
        kinds += [int(stroke.kind) for stroke in strokes]
        ends += [*pairwise(stops)]
    _, vertex = np.unique(np.array(ends), return_inverse=True)
    return Curves(torch.from_numpy(np.stack(control)), torch.tensor(kinds), torch.from_numpy(vertex.reshape(-1, 2)))
