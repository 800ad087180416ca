"""One random part of a seed: its solid in the unit cube, its sharp and smooth edges, and its mesh."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS_Shape

from cad.boundary import AmbiguousEdgeError, Edge, Mesh, mesh, sharp_and_smooth
from cad.families import FAMILIES
from cad.solids import FAILURES, BuildError, similar

FEWEST_EDGES, MOST_EDGES = 10, 60
# An edge is at least this long, five to six pixels in the pictures: shorter ones no detector follows.
SHORTEST = 0.04


@dataclass(frozen=True)
class Part:
    """A solid whose bounding box is centred at (.5, .5, .5) and 1 along its longest side."""

    family: str
    solid: TopoDS_Shape
    sharp: list[Edge]
    smooth: list[Edge]
    mesh: Mesh


def random_part(seed: int) -> Part:
    """The part of that seed; dimensions that give no sound part of 10 to 60 clear edges are drawn again."""
    family = FAMILIES[seed % len(FAMILIES)]
    for attempt in range(100):
        rng = np.random.default_rng([seed, attempt])
        try:
            part = _in_unit_cube(family.__name__, family(rng), rng)
        except (BuildError, AmbiguousEdgeError, *FAILURES):
            continue
        if part is not None:
            return part
    raise RuntimeError(f"no sound part for seed {seed} ({family.__name__}) in 100 attempts")


def _in_unit_cube(family: str, solid: TopoDS_Shape, rng: Generator) -> Part | None:
    rotation = _random_rotation(rng) if rng.random() < 0.65 else np.eye(3)
    if not _is_one_sound_solid(solid):
        return None
    solid = similar(solid, rotation, 1.0, np.zeros(3))
    low, high = _bounds(solid)
    scale = 1 / (high - low).max()
    solid = similar(solid, np.eye(3), scale, 0.5 - scale * (low + high) / 2)
    sharp, smooth = sharp_and_smooth(solid)
    sharp.sort(key=lambda edge: (edge.type, *np.round(edge.points[0], 6), *np.round(edge.points[-1], 6), edge.length))
    if not FEWEST_EDGES <= len(sharp) <= MOST_EDGES or min(edge.length for edge in sharp) < SHORTEST:
        return None
    return Part(family, solid, sharp, smooth, mesh(solid))


def _is_one_sound_solid(shape: TopoDS_Shape) -> bool:
    explorer, count = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID), 0
    while explorer.More():
        count += 1
        explorer.Next()
    return count == 1 and BRepCheck_Analyzer(shape).IsValid()


def _bounds(solid: TopoDS_Shape) -> tuple[np.ndarray, np.ndarray]:
    """Bounding box of a fine mesh and of the sharp edges."""
    points = np.concatenate([mesh(solid).vertices, *(edge.points for edge in sharp_and_smooth(solid)[0])])
    return points.min(0), points.max(0)


def _random_rotation(rng: Generator) -> np.ndarray:
    """A rotation matrix, all equally likely."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
