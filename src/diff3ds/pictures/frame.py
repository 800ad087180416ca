"""The frame in which views are fitted: centre and radius of what the cameras see become the origin and 1."""

import math
from dataclasses import dataclass, replace

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.pictures.store import Store
from diff3ds.sketch import Sketch

# Pixels with more than this are content; the noise of edge detectors stays below.
CONTENT = 0.3
# Share of the content that the radius leaves out in every view, for stray pixels, and what makes up for it. Empirical.
STRAY = 0.05
MARGIN = 1.1
# How far float32 may move a point of the world, in radii: .01 px where the radius takes a thousand.
LEAST_MOVED = 1e-5
# Rays that all run within some 3 degrees of one direction say nothing about depth: (sin 3 degrees)^2.
LEAST_SPREAD = 0.003

# Points of a reconstruction are the object's if so large a part of the cameras have them within so large a part of the
# pictures around the middle; fewer than so many say nothing. Empirical.
MOST_CAMERAS, MIDDLE, FEWEST_POINTS = 0.8, 0.8, 50
# Surroundings are shown where content lies this near to the borders of half of the pictures, of their size. Empirical.
RIM = 0.02


@dataclass(frozen=True, eq=False)
class Frame:
    """x_world = center + radius * x_frame."""

    center: Float[Tensor, " 3"]
    radius: float

    def cameras(self, cameras: Cameras) -> Cameras:
        """Cameras of the world as float32 cameras of the frame; depths shrink by the radius."""
        matrix = cameras.world_to_camera.double().clone()
        matrix[:, :3, 3] = (matrix[:, :3, 3] + matrix[:, :3, :3] @ self.center) / self.radius
        intrinsics = cameras.intrinsics
        if cameras.orthographic:
            # Pixels a unit, which is the radius now.
            intrinsics = intrinsics.double() * intrinsics.new_tensor([self.radius, self.radius, 1.0]).double()
        return replace(
            cameras, world_to_camera=matrix.float(), intrinsics=intrinsics.float(), near=cameras.near / self.radius
        )

    def to_world(self, sketch: Sketch) -> Sketch:
        """A sketch of the frame in the world; float64 where float32 would move its points, as in map coordinates."""
        matrix = torch.eye(4, dtype=torch.float64)
        matrix[:3, :3] *= self.radius
        matrix[:3, 3] = self.center
        step = torch.finfo(torch.float32).eps / 2 * float(self.center.abs().max() + self.radius)
        return (sketch.to(torch.float64) if step > LEAST_MOVED * self.radius else sketch).transform(matrix)

    def from_world(self, sketch: Sketch) -> Sketch:
        """A sketch of the world in the frame, in float32."""
        matrix = torch.eye(4, dtype=torch.float64)
        matrix[:3, :3] /= self.radius
        matrix[:3, 3] = -self.center / self.radius
        return sketch.to(torch.float64).transform(matrix).to(torch.float32)


def frame_of(cameras: Cameras, store: Store) -> Frame:
    """The ball that holds what the views show.

    Its centre is the point nearest to the rays through the views' centroids of content, its radius the median over the
    views of the content's reach around that centre. Content is ink, or alpha, where it is known.

    Raises:
        ValueError: no content, or views that all look the same way: their depth cannot be found.
    """
    found = [_centroid(_content(store, view)) for view in range(len(store))]
    shown = [view for view, centroid in enumerate(found) if centroid is not None]
    if not shown:
        raise ValueError("the pictures show nothing: all pixels are background")
    center = _nearest_point(cameras[shown], torch.tensor([c for c in found if c is not None], dtype=torch.float64))
    return Frame(center, _radius(cameras, store, shown, center))


def _content(store: Store, view: int) -> Bool[Tensor, "H W"]:
    batch = store.batch([view])
    return ((batch.alpha > CONTENT) & batch.known)[0]


def _centroid(content: Bool[Tensor, "H W"]) -> tuple[float, float] | None:
    """The mean pixel (x, y), if there is any."""
    rows, columns = (torch.arange(n, dtype=torch.float64) + 0.5 for n in content.shape)
    across, down = content.sum(0), content.sum(1)
    total = float(across.sum())
    return (float(across.double() @ columns) / total, float(down.double() @ rows) / total) if total else None


def _nearest_point(cameras: Cameras, pixels: Float[Tensor, "V 2"]) -> Float[Tensor, " 3"]:
    """The point with the least sum of squared distances to the rays through these pixels."""
    origins, rays = cameras.rays(pixels)
    across = torch.eye(3, dtype=torch.float64) - rays[:, :, None] * rays[:, None, :]
    normal = across.mean(0)
    if float(torch.linalg.eigvalsh(normal)[0]) < LEAST_SPREAD:
        raise ValueError("the views all look the same way: depth needs views from at least two directions")
    center: Tensor = torch.linalg.solve(normal, (across @ origins[..., None]).mean(0)[:, 0])
    return center


def _radius(cameras: Cameras, store: Store, shown: list[int], center: Float[Tensor, " 3"]) -> float:
    point = torch.cat([center, center.new_ones(1)])
    middles, depths = cameras.seen(cameras.projection @ point)
    reach = []
    for view in shown:
        middle, depth = middles[view], depths[view]
        if depth <= cameras.near:
            continue
        y, x = _content(store, view).nonzero().double().T + 0.5
        pixels = torch.hypot(x - middle[0], y - middle[1])
        kept = pixels.kthvalue(math.ceil((1 - STRAY) * len(pixels))).values
        away = torch.ones_like(depth) if cameras.orthographic else depth
        reach.append(kept * away / cameras.intrinsics[view, 0, 0].double())
    if not reach:
        raise ValueError("the cameras look away from what they see: are the camera axes OpenGL's (looking along -z)?")
    return MARGIN * float(torch.stack(reach).median())


def bound_by_points(frame: Frame, cameras: Cameras, store: Store, points: Float[Tensor, "P 3"]) -> Frame:
    """The ball around what most cameras look at, by the points of a reconstruction, if that is smaller than the frame.

    Where pictures show surroundings, content says nothing of where the object is; but cameras that go round it have its
    points in nearly all of their pictures, and those of its surroundings in some. Where they do not, the frame stays.

    Args:
        frame: by the content of the pictures.
        cameras: in the world.
        store: their pictures.
        points: in the world.
    """
    if not _shows_surroundings(store):
        return frame
    near = _in_most(cameras, points)
    if len(near) < FEWEST_POINTS:
        return frame
    center = near.median(0).values
    reach = (near - center).norm(dim=1)
    radius = MARGIN * float(reach.kthvalue(math.ceil((1 - STRAY) * len(reach))).values)
    return Frame(center, radius) if 0 < radius < frame.radius else frame


def _shows_surroundings(store: Store) -> bool:
    """Whether half of the pictures have content along their borders."""
    count = 0
    for view in range(len(store)):
        content = _content(store, view)
        rim = max(1, round(RIM * max(content.shape)))
        inner = torch.zeros_like(content)
        inner[rim:-rim, rim:-rim] = True
        count += bool((content & ~inner).any())
    return 2 * count >= len(store)


def _in_most(cameras: Cameras, points: Float[Tensor, "P 3"]) -> Float[Tensor, "Q 3"]:
    """The points that most cameras have in the middle of their pictures."""
    height, width = cameras.size
    pad = torch.cat([points, points.new_ones(len(points), 1)], 1)
    count = torch.zeros(len(points))
    middle = points.new_tensor([width / 2, height / 2])
    for matrix in cameras.projection.double():
        pixels, depth = cameras.seen(pad @ matrix.T)
        count += ((pixels - middle).abs() <= MIDDLE * middle).all(1) & (depth > cameras.near)
    return points[count >= MOST_CAMERAS * len(cameras)]
