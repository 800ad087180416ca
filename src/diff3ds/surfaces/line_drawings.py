"""Line drawings of a mesh from all around, as points along their lines, and how far a sketch is from them."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras, orbit
from diff3ds.chains import Chains
from diff3ds.project import project
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Drawings are compared in pictures of this size, of a height that is this factor of the diagonal of the mesh's box.
SIZE, MARGIN = 128, 1.1
# Points along a segment. Empirical.
SAMPLES = 9


@dataclass(frozen=True, eq=False)
class LinePoints:
    """Points along lines in a picture.

    Attributes:
        place: pixels.
        direction: of the line, a unit vector of either sign, or 0 where the line has no length.
        weight: the length of line that each stands for, pixels.
        stroke: the stroke that each is of.
    """

    place: Float[Array, "P 2"]
    direction: Float[Array, "P 2"]
    weight: Float[Array, " P"]
    stroke: Int[Index, " P"]


def sides_and_corners(mesh: TriangleMesh) -> Cameras:
    """Orthographic views of the six sides of a cube, and then from its eight corners."""
    axes = np.eye(3)
    return _from_afar(mesh, np.array([*axes, *-axes, *product((-1.0, 1.0), repeat=3)]))


def all_around(mesh: TriangleMesh, count: int, turn: float = 0.0) -> Cameras:
    """Orthographic views from directions that are spread evenly over the sphere, on a spiral of the golden angle.

    Args:
        count: of the views.
        turn: degrees by which all of them are turned around z: other turns give other directions.
    """
    step = np.arange(count) + 0.5
    height = 1 - 2 * step / count
    angle = np.pi * (1 + 5**0.5) * step + np.radians(turn)
    radius = np.sqrt(1 - height**2)
    return _from_afar(mesh, np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height]))


def _from_afar(mesh: TriangleMesh, towards: Float[Array, "V 3"]) -> Cameras:
    azimuth = np.degrees(np.arctan2(towards[:, 1], towards[:, 0]))
    elevation = np.degrees(np.arctan2(towards[:, 2], np.hypot(towards[:, 0], towards[:, 1])))
    reach = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    cameras = orbit(
        azimuth.tolist(), elevation.tolist(), 2 * reach, fov=None, height=MARGIN * reach, size=SIZE, near=reach / 100
    ).to(torch.float64)
    # Placed around the origin and moved: in map coordinates the float32 of `orbit` would move them.
    pose = cameras.world_to_camera.clone()
    pose[:, :3, 3] -= pose[:, :3, :3] @ torch.from_numpy(mesh.bounds.mean(0))
    return replace(cameras, world_to_camera=pose)


def points_along(sketch: Sketch, camera: Cameras, owner: Int[Index, " N"] | None = None) -> LinePoints:
    """Points along the strokes as a camera sees them.

    Args:
        sketch: float64.
        camera: one view.
        owner: the stroke that each one stands for.
    """
    chains = sketch.chains or Chains.plain(len(sketch))
    cubics = project(sketch.detach(), camera).cubics[0]
    t = torch.linspace(0, 1, SAMPLES, dtype=torch.float64)
    seen = (
        evaluate(cubics[..., :2] / cubics[..., 2:3], cubics[..., 2], t).numpy()
        if len(cubics)
        else np.zeros((0, SAMPLES, 2))
    )
    step = np.diff(seen, axis=1)
    length = np.linalg.norm(step, axis=-1)
    stroke = np.repeat(chains.stroke.numpy(), SAMPLES - 1)
    return LinePoints(
        ((seen[:, 1:] + seen[:, :-1]) / 2).reshape(-1, 2),
        (step / np.maximum(length, 1e-12)[..., None]).reshape(-1, 2),
        length.ravel(),
        stroke if owner is None else owner[stroke],
    )


def mean_distances(one: LinePoints, other: LinePoints) -> tuple[float, float]:
    """Mean distances, along the lines, from one drawing to the other and back, pixels; infinite where there is none."""
    return _mean_distance(one, other), _mean_distance(other, one)


def _mean_distance(start: LinePoints, end: LinePoints) -> float:
    from scipy.spatial import cKDTree

    if not start.weight.sum() > 0:
        return 0.0
    if not len(end.place):
        return float("inf")
    return float(np.average(cKDTree(end.place).query(start.place)[0], weights=start.weight))
