"""Runs of edges of a mesh, or of steps along its seams, between places where they branch, end or turn sharply."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Int
from diff3ds.curves.directions import SHARP, has_corner, turns

# Vertices along a run, and whether it is a border.
Run = tuple[list[int], bool]


def edge_runs(
    vertices: Float[Array, "V 3"],
    edges: Int[NDArray[np.int64], "E 2"],
    border: NDArray[np.bool_],
    is_corner: Callable[[Array, Array], NDArray[np.bool_]] = has_corner,
) -> Iterator[Run]:
    """Vertices along the edges, from where they branch, end, turn sharply or become a border; and whether they are one.

    Loops end where they begin.
    """
    near: dict[int, list[int]] = {}
    kind: dict[tuple[int, int], bool] = {}
    for (a, b), outer in zip(edges.tolist(), border.tolist(), strict=True):
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
        kind[a, b] = kind[b, a] = outer
    through = {v: beside for v, beside in near.items() if len(beside) == 2 and kind[v, beside[0]] == kind[v, beside[1]]}
    middle = np.fromiter(through, np.int64, len(through))
    one, other = np.array([*through.values()], np.int64).reshape(-1, 2).T
    corner = is_corner(vertices[middle] - vertices[one], vertices[other] - vertices[middle])
    ends = near.keys() - through.keys() | set(middle[corner].tolist())
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
            yield chain, kind[chain[0], chain[1]]


def seam_runs(points: Float[Array, "N 3"], steps: Int[NDArray[np.int64], "S 2"]) -> list[list[int]]:
    """Points along seams, from where they branch, end or turn sharply; loops end where they begin."""
    # Their steps are long and short by chance: a short one is no end of a straight part.
    runs = edge_runs(points, steps, np.zeros(len(steps), bool), lambda before, after: turns(before, after) > SHARP)
    return [run for run, _ in runs]
