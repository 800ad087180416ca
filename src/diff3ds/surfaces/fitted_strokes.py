"""Strokes of a smooth mesh fitted to its line drawings from all around, by gradients through the projection.

Outlines from some sides are a good start, but each is right from its own side only. Here they are moved until they are
as near as they can be to the lines of drawings from everywhere: visible contours and features. Each point of a drawing
pulls the nearest stroke, and each point of a stroke is pulled to the nearest line, so that strokes come from afar too,
where pictures that are blurred would have to be very much so. Strokes slide along the surface, and hardly leave it.
"""

from collections.abc import Callable

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.constraints import Constraint, fixed, smooth
from diff3ds.optimize.config import FitConfig, Rates
from diff3ds.optimize.fit import descend
from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.pictures.frame import Frame
from diff3ds.project import project
from diff3ds.sketch import Sketch
from diff3ds.surfaces.draw import lines_for_pixels
from diff3ds.surfaces.hidden.visibility import FOR_MEASURES
from diff3ds.surfaces.line_drawings import MARGIN, SAMPLES, SIZE, all_around, points_along
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Drawings, and how many of them a step compares with. Empirical, as all that follows.
VIEWS, BATCH = 24, 6
STEPS = 60
# Adam's rate in the first step, as a share of half the diagonal of the mesh's box, and how it falls to the last one.
RATE, LAST_RATE = 0.008, 0.1
# So much a stroke's distance from the lines counts against a line's distance from the strokes: strokes that are right
# from some sides have to be there from all.
EXTRA = 0.1
# So much a stroke's distance from the surface counts. Without it, those on a ball would grow out of it.
OFF = 1.0
# Joints that turn by less than this become smooth, radians.
SMOOTHED = 0.5

# Of each point of a line the nearest place on a stroke, and of each such place the nearest point of a line.
Nearest = tuple[Int[Tensor, " L"], Int[Tensor, " P"]]


def fit_strokes(
    mesh: TriangleMesh,
    features: Sketch,
    strokes: Sketch,
    held: int,
    report: Callable[[int, int], None] = lambda done, of: None,
) -> Sketch:
    """Moves strokes until they are near to the lines of drawings from all around.

    Args:
        mesh: what is drawn.
        features: its feature curves, which drawings show as well, where they are seen.
        strokes: where to start, float64.
        held: so many of these, the first ones, stay where they are.
        report: told the steps that are done, and their number.

    Returns:
        The strokes as they were, but for their control points; float64.
    """
    cameras = all_around(mesh, VIEWS)
    seen = lines_for_pixels(lambda lines, view: lines.strokes(True), features, cameras, mesh, FOR_MEASURES)
    drawings = [_Drawing(strokes, cameras[view]) for view, strokes in enumerate(seen)]
    low, high = mesh.bounds
    frame = Frame(torch.from_numpy((low + high) / 2), float(np.linalg.norm(high - low)) / 2)
    start, views = frame.from_world(strokes), frame.cameras(cameras)
    constraints: tuple[Constraint, ...] = (smooth(start, SMOOTHED),)
    if held:
        constraints += (fixed(start, range(held)),)
    generator = np.random.default_rng(0)
    surface = _Surface(mesh, frame)

    def loss(sketch: Sketch, step: int) -> Tensor:
        some = generator.choice(VIEWS, BATCH, replace=False).tolist()
        cubics = project(sketch, views[some]).cubics
        # The projection is float64, whatever the sketch is.
        t = torch.linspace(0, 1, SAMPLES, dtype=cubics.dtype)
        along = evaluate(cubics[..., :2] / cubics[..., 2:3], cubics[..., 2], t)
        middles = ((along[:, :, 1:] + along[:, :, :-1]) / 2).flatten(1, 2)
        lengths = (along[:, :, 1:] - along[:, :, :-1]).norm(dim=-1).flatten(1)
        places: Float[Array, "V P 2"] = middles.detach().numpy()
        # What takes the time leaves Python to other threads.
        nearest = side_by_side(lambda i: drawings[some[i]].nearest(places[i]), BATCH, BATCH)
        pulls = zip(some, middles, lengths, nearest, strict=True)
        away = torch.stack([drawings[v].distance(*pull) for v, *pull in pulls]).mean()
        return away + OFF * surface.distance(sketch)

    config = FitConfig(STEPS, Rates(RATE), LAST_RATE, constraints=constraints)
    for step, fitted in enumerate(descend(start, loss, config), 1):
        start = fitted
        report(step, STEPS)
    points = frame.to_world(start).points.to(torch.float64)
    # What is held has been through float32 only on the way.
    kept = (strokes.chains or Chains.plain(len(strokes))).stroke < held
    return strokes.replace(points=torch.where(kept[:, None, None], strokes.points, points))


class _Surface:
    """The planes of a mesh's faces, in a frame."""

    def __init__(self, mesh: TriangleMesh, frame: Frame) -> None:
        from scipy.spatial import cKDTree

        middle = mesh.vertices[mesh.faces].mean(1)
        self._middle = torch.from_numpy((middle - frame.center.numpy()) / frame.radius)
        self._normal = torch.from_numpy(mesh.face_normals)
        self._tree = cKDTree(self._middle.numpy())

    def distance(self, sketch: Sketch) -> Float[Tensor, ""]:
        """How far strokes are from the planes of the nearest faces in the mean, pixels of the drawings."""
        t = torch.linspace(0, 1, SAMPLES, dtype=sketch.points.dtype)
        along = evaluate(sketch.points, sketch.weights, t).flatten(0, 1).double()
        face = torch.from_numpy(self._tree.query(along.detach().numpy(), workers=-1)[1])
        off = ((along - self._middle[face]) * self._normal[face]).sum(1).abs()
        return off.mean() * SIZE / (2 * MARGIN)


class _Drawing:
    """The lines that are seen in one view."""

    def __init__(self, lines: Sketch, camera: Cameras) -> None:
        from scipy.spatial import cKDTree

        points = points_along(lines, camera)
        self._tree = cKDTree(points.place) if len(points.place) else None
        self._place = torch.from_numpy(points.place)
        self._weight = torch.from_numpy(points.weight)

    def nearest(self, places: Float[Array, "P 2"]) -> Nearest | None:
        """Of each point of a line the nearest place, and of each place the nearest point; None without lines."""
        from scipy.spatial import cKDTree

        if self._tree is None or not float(self._weight.sum()) > 0:
            return None
        found = cKDTree(places).query(self._place.numpy())[1], self._tree.query(places)[1]
        return torch.from_numpy(found[0]), torch.from_numpy(found[1])

    def distance(
        self, middle: Float[Tensor, "P 2"], length: Float[Tensor, " P"], nearest: Nearest | None
    ) -> Float[Tensor, ""]:
        """How far the lines are from places on strokes in the mean, and these from lines at `EXTRA`, pixels."""
        if nearest is None:
            return 0.0 * middle.sum()
        missing = (middle[nearest[0]] - self._place).norm(dim=1) @ self._weight
        extra = (middle - self._place[nearest[1]]).norm(dim=1) @ length
        mean: Tensor = (missing + EXTRA * extra) / self._weight.sum()
        return mean
