"""One camera as arrays: where points are in its picture, and how deep."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.camera import Cameras


@dataclass(frozen=True, eq=False)
class Picture:
    """One camera as arrays.

    Attributes:
        projection: from homogeneous points to (X, Y, Z, W), as `Cameras.projection`.
        center: of the camera, world units.
        forward: its axis, a unit vector.
        near: the depth of the near plane.
        size: (height, width) in pixels.
        orthographic: whether nothing shrinks with depth.
    """

    projection: Float[Array, "4 4"]
    center: Float[Array, " 3"]
    forward: Float[Array, " 3"]
    near: float
    size: tuple[int, int]
    orthographic: bool

    @staticmethod
    def of(cameras: Cameras, view: int) -> "Picture":
        """One of the views."""
        pose = cameras.world_to_camera[view].detach().double().cpu().numpy()
        projection = cameras.projection[view].detach().cpu().numpy()
        center = cameras.centers[view].detach().double().cpu().numpy()
        return Picture(projection, center, pose[2, :3], cameras.near, cameras.size, cameras.orthographic)

    @property
    def focal(self) -> float:
        """Pixels of what is a world unit long, at depth 1 with perspective: the mean of both axes."""
        axes = self.projection[:2, :3]
        return float(np.linalg.norm(axes - np.outer(axes @ self.forward, self.forward)) / 2**0.5)

    def seen(self, points: Float[Array, "*P 3"]) -> tuple[Float[Array, "*P 2"], Float[Array, "*P"]]:
        """Pixels and depths of points; those of points behind the near plane mean nothing."""
        projected = points @ self.projection[:, :3].T + self.projection[:, 3]
        if self.orthographic:
            return projected[..., :2], projected[..., 3]
        depth = projected[..., 2]
        return projected[..., :2] / np.maximum(depth, self.near)[..., None], depth

    def towards(self, points: Float[Array, "*P 3"]) -> Float[Array, "*P 3"]:
        """Directions from points to the camera, of any length."""
        return np.broadcast_to(-self.forward, points.shape) if self.orthographic else self.center - points
