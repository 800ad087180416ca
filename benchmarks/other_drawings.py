"""Drawings that the library's tables lack: solid things without their hidden lines, and shapes that are no thing.

Both are drawn with 512 pixels and lines of about the default width.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import torch
from PIL import Image, ImageDraw
from scipy.ndimage import binary_erosion
from scipy.spatial import ConvexHull, QhullError

import diff3ds as ds
from diff3ds.bezier import evaluate
from diff3ds.sketch import DEFAULT_WIDTH

SIZE = 512
# Kinds, and an attribute of some, whose horizontal sections are convex, or nearly: what hides their lines is a pile of
# convex slabs. A mug's handle, a bed's legs or a shelf's open front are not.
SOLIDS = (
    ("bottle", ()), ("bus", ()), ("candle", ()), ("car", ()), ("clock", ()), ("hot-air balloon", ()), ("house", ()),
    ("lamp", ()), ("lighthouse", ()), ("mushroom", ()), ("tent", ("tipi",)), ("tree", ("fir",)),
)  # fmt: skip
# Slabs, and points and pieces of a stroke. A slab is as wide as its widest section: a line on a slope of 45 degrees
# lies up to a slab's height, .06, behind its surface, and as much behind its neighbour's; so deep a line is not hidden.
SLABS, POINTS, PIECES, SURFACE = 32, 257, 48, 0.12
Points = np.ndarray


def slabs_of(sketch: ds.Sketch) -> list[ConvexHull]:
    """The solid whose surface the strokes lie on, as convex slabs on top of each other."""
    points = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, POINTS)).reshape(-1, 3).double().numpy()
    low, high = points[:, 2].min(), points[:, 2].max()
    # Samples of a stroke are no farther apart than this.
    gap = 2 * (high - low) / POINTS
    heights = np.linspace(low, high, SLABS + 1)
    hulls = []
    for bottom, top in itertools.pairwise(heights):
        inside = points[(points[:, 2] >= bottom - gap) & (points[:, 2] <= top + gap)]
        try:
            hulls.append(ConvexHull(inside))
        except (QhullError, ValueError):
            continue  # Flat: a wick hides nothing.
    return hulls


def depth_behind(points: Points, eye: Points, hulls: Sequence[ConvexHull]) -> Points:
    """How much of the solid lies between points (N, 3) and an eye."""
    rays = eye - points
    reach = np.linalg.norm(rays, axis=1)
    rays = rays / reach[:, None]
    depth = np.zeros(len(points))
    for hull in hulls:
        normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
        room, speed = -(points @ normals.T + offsets), rays @ normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            crossed = room / speed
        leaves = np.where(speed > 1e-9, crossed, np.inf).min(1)
        enters = np.where(speed < -1e-9, crossed, 0.0).max(1)
        missed = ((np.abs(speed) <= 1e-9) & (room < 0)).any(1)
        depth += np.where(missed, 0.0, np.clip(np.minimum(leaves, reach) - np.maximum(enters, 0.0), 0.0, None))
    return depth


def solid_drawing(sketch: ds.Sketch, camera: ds.Cameras, outlined: bool) -> torch.Tensor:
    """A picture (512, 512, 3) of the lines that a solid does not hide, and of its outline if that is asked for."""
    hulls = slabs_of(sketch)
    along = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, PIECES + 1)).double()
    starts, ends = along[:, :-1].reshape(-1, 3), along[:, 1:].reshape(-1, 3)
    seen = depth_behind(((starts + ends) / 2).numpy(), camera.centers[0].numpy(), hulls) <= SURFACE
    thirds = torch.linspace(0, 1, 4, dtype=torch.float64)[:, None]
    pieces = (starts[:, None] + thirds * (ends - starts)[:, None])[torch.from_numpy(seen)]
    picture = ds.render(ds.Sketch(pieces.float(), torch.ones(len(pieces), 4)), camera).color[0]
    if not outlined:
        return picture
    mask = Image.new("1", (SIZE, SIZE))
    for hull in hulls:
        corners = hull.points[hull.vertices]
        there = np.column_stack([corners, np.ones(len(corners))]) @ camera.projection[0, :3].numpy().T
        flat = there[:, :2] / there[:, 2:]
        ImageDraw.Draw(mask).polygon([tuple(p) for p in flat[ConvexHull(flat).vertices]], fill=1)
    filled = np.array(mask)
    line = filled & ~binary_erosion(filled, iterations=max(1, round(DEFAULT_WIDTH * SIZE)))
    return torch.where(torch.from_numpy(line)[..., None], 0.0, picture)


def _arc(x: float, y: float, radius: float, start: float = 0.0, stop: float = 360.0) -> Points:
    angles = np.radians(np.linspace(start, stop, 64))
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


def _path(*corners: tuple[float, float]) -> Points:
    """Twenty points to a side, so that jitter bends it."""
    ends = np.array(corners, dtype=float)
    steps = np.linspace(0, 1, 20, endpoint=False)[:, None]
    sides = [a + steps * (b - a) for a, b in itertools.pairwise(ends)]
    return np.concatenate([*sides, ends[-1:]])


def _star() -> Points:
    angles = [math.radians(-90 + 144 * i) for i in range(6)]
    return _path(*((math.cos(a), math.sin(a)) for a in angles))


def _spiral() -> Points:
    turns = np.linspace(0, 3 * math.tau, 200)
    return np.column_stack([turns * np.cos(turns), turns * np.sin(turns)]) / (3 * math.tau)


def _heart() -> Points:
    t = np.linspace(0, math.tau, 120)
    x, y = 16 * np.sin(t) ** 3, 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    return np.column_stack([x, -y]) / 17


# Lines of each shape in a box of side 2, y down. The confidence is fitted to the first half.
SHAPES: dict[str, list[Points]] = {
    "circle": [_arc(0, 0, 1)],
    "square": [_path((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))],
    "cross": [_path((-1, 0), (1, 0)), _path((0, -1), (0, 1))],
    "stick figure": [_arc(0, -0.75, 0.25), _path((0, -0.5), (0, 0.3)), _path((-0.5, -0.2), (0.5, -0.2)),
                     _path((-0.45, 1), (0, 0.3), (0.45, 1))],
    "letter A": [_path((-0.7, 1), (0, -1), (0.7, 1)), _path((-0.4, 0.2), (0.4, 0.2))],
    "zigzag": [_path((-1, 0.3), (-0.6, -0.3), (-0.2, 0.3), (0.2, -0.3), (0.6, 0.3), (1, -0.3))],
    "spiral": [_spiral()],
    "two circles": [_arc(-0.5, 0, 0.45), _arc(0.5, 0, 0.45)],
    "triangle": [_path((-1, 0.8), (0, -0.9), (1, 0.8), (-1, 0.8))],
    "oval": [_arc(0, 0, 1) * np.array([1.0, 0.6])],
    "slanting cross": [_path((-1, -1), (1, 1)), _path((-1, 1), (1, -1))],
    "star": [_star()],
    "arrow": [_path((-1, 0), (1, 0)), _path((0.5, -0.4), (1, 0), (0.5, 0.4))],
    "letter H": [_path((-0.6, -1), (-0.6, 1)), _path((0.6, -1), (0.6, 1)), _path((-0.6, 0), (0.6, 0))],
    "heart": [_heart()],
    "smiling face": [_arc(0, 0, 1), _arc(-0.35, -0.3, 0.08), _arc(0.35, -0.3, 0.08), _arc(0, 0.1, 0.5, 20, 160)],
}  # fmt: skip


def shape_drawing(name: str, chance: np.random.Generator | None) -> torch.Tensor:
    """A picture (512, 512, 3) of a shape: as it is, or turned by some degrees, stretched, drawn by a shaky hand."""
    turn, wide, shake = 0.0, 1.0, 0.0
    if chance is not None:
        turn, wide, shake = math.radians(chance.normal(0, 4)), 1 + chance.uniform(-0.2, 0.2), chance.uniform(0, 0.005)
    matrix = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ np.diag([wide, 1.0])
    picture = Image.new("L", (SIZE, SIZE), 255)
    pen = ImageDraw.Draw(picture)
    for path in SHAPES[name]:
        # Errors of a hand add up along the line.
        shaken = 0.0 if chance is None else np.cumsum(chance.normal(0, shake, path.shape), axis=0)
        moved = (path @ matrix.T + shaken) * SIZE * 0.33 + SIZE / 2
        pen.line([tuple(p) for p in moved], 0, round(DEFAULT_WIDTH * SIZE), joint="curve")
    return torch.from_numpy(np.array(picture)).float()[..., None].repeat(1, 1, 3) / 255
