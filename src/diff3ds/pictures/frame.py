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
