"""Strokes of a smooth mesh fitted to its line drawings from all around, by gradients through the projection.

Outlines from some sides are a good start, but each is right from its own side only. Here they are moved until they are
as near as they can be to the lines of drawings from everywhere: visible contours and features. Each point of a drawing
pulls the nearest stroke, and each point of a stroke is pulled to the nearest line, so that strokes come from afar too,
where pictures that are blurred would have to be very much so.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.constraints import Constraint, fixed, smooth
from diff3ds.optimize.fit import FitConfig, Rates, fit
from diff3ds.pictures.frame import Frame
from diff3ds.project import project
from diff3ds.render import Rendering
from diff3ds.sketch import Sketch
from diff3ds.surfaces.drawn import visible_lines
from diff3ds.surfaces.line_drawings import SAMPLES, all_around, points_along
from diff3ds.surfaces.mesh import TriangleMesh

# Drawings, and how many of them a step compares with. Empirical, as all that follows.
VIEWS, BATCH = 32, 6
STEPS = 300
# Of the first step, as a share of half the diagonal of the mesh's box.
RATE = 0.003
# So much a stroke's distance from the lines counts against a line's distance from the strokes: strokes that are right
# from some sides have to be there from all.
EXTRA = 0.1
# Joints that turn by less than this become smooth, radians.
SMOOTHED = 0.5


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
    drawings = []
    for view in range(VIEWS):
        lines = visible_lines(features, cameras[view], mesh)[0]
        drawings.append(_Drawing(lines.strokes(True), cameras[view]))
    low, high = mesh.bounds
    frame = Frame(torch.from_numpy((low + high) / 2), float(np.linalg.norm(high - low)) / 2)
    start, views = frame.from_world(strokes), frame.cameras(cameras)
    generator = np.random.default_rng(0)
    order = [generator.choice(VIEWS, BATCH, replace=False) for _ in range(STEPS)]

    def objective(rendering: Rendering, seen: Cameras, step: int, sketch: Sketch) -> Tensor:
        cubics = project(sketch, seen).cubics
        losses = [drawings[view].distance(cubics[i]) for i, view in enumerate(order[step])]
        return torch.stack(losses).mean()

    constraints: tuple[Constraint, ...] = (smooth(start, SMOOTHED),)
    if held:
        constraints += (fixed(start, range(held)),)
    config = FitConfig(steps=STEPS, rates=Rates(points=RATE), constraints=constraints)
    moved = start
    for step in fit(start, objective, lambda step, _: views[order[step].tolist()], config):
        moved = step.sketch
        report(step.index + 1, STEPS)
    points = frame.to_world(moved).points.to(torch.float64)
    # What is held has been through float32 only on the way.
    kept = (strokes.chains or Chains.plain(len(strokes))).stroke < held
    return replace(strokes, points=torch.where(kept[:, None, None], strokes.points, points))


class _Drawing:
    """The lines that are seen in one view."""

    def __init__(self, lines: Sketch, camera: Cameras) -> None:
        from scipy.spatial import cKDTree

        points = points_along(lines, camera)
        self._tree = cKDTree(points.place) if len(points.place) else None
        self._place = torch.from_numpy(points.place)
        self._weight = torch.from_numpy(points.weight)

    def distance(self, cubics: Float[Tensor, "M K 4"]) -> Float[Tensor, ""]:
        """How far the lines are from strokes in the mean, and strokes from lines at `EXTRA`, pixels."""
        from scipy.spatial import cKDTree

        # The projection is float64, whatever the sketch is.
        t = torch.linspace(0, 1, SAMPLES, dtype=cubics.dtype)
        along = evaluate(cubics[..., :2] / cubics[..., 2:3], cubics[..., 2], t)
        middle = ((along[:, 1:] + along[:, :-1]) / 2).reshape(-1, 2)
        length = (along[:, 1:] - along[:, :-1]).norm(dim=-1).reshape(-1)
        whole = self._weight.sum()
        if self._tree is None or not float(whole) > 0:
            return 0.0 * middle.sum()
        places: Float[Array, "P 2"] = middle.detach().numpy()
        nearest = torch.from_numpy(cKDTree(places).query(self._place.numpy())[1])
        missing = (middle[nearest] - self._place).norm(dim=1) @ self._weight
        there = self._place[torch.from_numpy(self._tree.query(places)[1])]
        extra = (middle - there).norm(dim=1) @ length
        return (missing + EXTRA * extra) / whole
