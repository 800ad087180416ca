"""The ridges of all views, and which of them lies nearest to where a 3D point appears."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.parallel.side_by_side import side_by_side

# [px; numerical] Distance of a point that a view does not contain.
OUTSIDE = 99.0


@dataclass(frozen=True, eq=False)
class Matches:
    """The nearest ridge points of M 3D points in V views.

    Attributes:
        pixel: where the points appear.
        depth: of the points, world units.
        distance: to the nearest ridge point, pixels; `OUTSIDE` where the view does not contain the point.
        ridge: its index among all ridge points, 0 where there is none.
    """

    pixel: Float[Array, "V M 2"]
    depth: Float[Array, "V M"]
    distance: Float[Array, "V M"]
    ridge: Int[NDArray[np.int32], "V M"]


@dataclass(frozen=True, eq=False)
class EdgeViews:
    """Ridges of V views of one size with their cameras.

    Attributes:
        size: (height, width) in pixels.
        projection: from homogeneous world points to (X, Y, Z); the pixel is (X / Z, Y / Z), Z the depth.
        centers: of the cameras.
        points: all ridge points, pixels.
        normals: across them.
        pulls, softness: see `Ridges`.
        start: index of the first ridge point of each view, and their number at the end.
        planes: (n, o) of the plane through the camera and the ridge; n . x + o is the distance of x, world units.
        nearest: index of the ridge point nearest to the centre of each pixel; -1 in views without any.
    """

    size: tuple[int, int]
    projection: Float[Array, "V 3 4"]
    centers: Float[Array, "V 3"]
    points: Float[Array, "R 2"]
    normals: Float[Array, "R 2"]
    pulls: Float[Array, " R"]
    softness: float
    start: Int[NDArray[np.int64], " S"]
    planes: Float[Array, "R 4"]
    nearest: Int[NDArray[np.int32], "V H W"]

    def __len__(self) -> int:
        return len(self.projection)

    @cached_property
    def pixel(self) -> float:
        """World units that one pixel covers at the origin: median over the views."""
        return float(np.median(self.projection[:, 2, 3] / self.focal))

    @cached_property
    def focal(self) -> Float[Array, " V"]:
        """Focal length along x of every view, pixels."""
        rows = self.projection[:, :, :3]
        along = (rows[:, 0] * rows[:, 2]).sum(1)
        return np.asarray(np.sqrt((rows[:, 0] ** 2).sum(1) - along**2))

    @cached_property
    def _rows(self) -> Float[NDArray[np.float32], "2 R"]:
        """The columns of all ridge points, and their rows, in single precision."""
        return np.ascontiguousarray(self.points.T.astype(np.float32))

    @cached_property
    def tables(self) -> tuple[Tensor, Tensor, Tensor]:
        """What the compiled kernels find the ridges of `match` by."""
        return (
            torch.from_numpy(self.projection),
            torch.from_numpy(self.nearest),
            torch.from_numpy(self.points).T.contiguous(),
        )

    @cached_property
    def single(self) -> tuple[Tensor, Tensor, Tensor]:
        """And those of `nearby`."""
        return self.tables[0].float(), self.tables[1], torch.from_numpy(self._rows)

    def project(self, x: Float[Array, "M 3"]) -> tuple[Float[Array, "V M 2"], Float[Array, "V M"]]:
        """Pixels and depths of world points."""
        # Each component lies in a row, which is several times as fast.
        homogeneous = self.projection[..., :3] @ x.T
        homogeneous += self.projection[..., 3:]
        depth = homogeneous[:, 2]
        return np.moveaxis(homogeneous[:, :2] / np.where(depth == 0, 1e-12, depth)[:, None], 1, -1), depth

    def match(self, x: Float[Array, "M 3"]) -> Matches:
        """The nearest ridge point in every view."""
        pixel, depth = self.project(x)
        height, width = self.size
        column, row = pixel[..., 0], pixel[..., 1]
        inside = (depth > 0) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
        place = np.where(inside, row, 0).astype(np.int64) * width + np.where(inside, column, 0).astype(np.int64)
        ridge = self.nearest.reshape(-1).take(place + height * width * np.arange(len(self))[:, None])
        found = inside & (ridge >= 0)
        ridge = np.where(found, ridge, 0)
        near = self.points.take(ridge, 0) if len(self.points) else pixel
        distance = np.hypot(column - near[..., 0], row - near[..., 1])
        return Matches(pixel, depth, np.where(found, distance, OUTSIDE), ridge)

    def nearby(
        self, view: int, x: Float[Array, "M 3"]
    ) -> tuple[Float[NDArray[np.float32], " M"], Float[NDArray[np.float32], " M"], Int[NDArray[np.int32], " M"]]:
        """Squared distances to the nearest ridge point in one view, pixels, depths, and pixels; in single precision.

        Infinite where the view does not contain the point. Pixels are numbered row by row.
        """
        places = np.ascontiguousarray(x.T.astype(np.float32))
        # Term by term, as the compiled kernels do it: a product of matrices each machine rounds its own way.
        across, down, depth = (
            a * places[0] + b * places[1] + c * places[2] + d for a, b, c, d in self.projection[view].astype(np.float32)
        )
        by = np.where(depth == 0, np.float32(1e-12), depth)
        column, row = across / by, down / by
        height, width = self.size
        inside = (depth > 0) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
        place = np.where(inside, row, 0).astype(np.int32) * width + np.where(inside, column, 0).astype(np.int32)
        ridge = self.nearest[view].reshape(-1).take(place)
        inside &= ridge >= 0
        if not inside.any():
            return np.full(len(x), np.inf, np.float32), depth, place
        ridge = np.where(inside, ridge, 0)
        across, down = self._rows
        off = (across.take(ridge) - column) ** 2 + (down.take(ridge) - row) ** 2
        return np.where(inside, off, np.float32(np.inf)), depth, place


def require_perspective(cameras: Cameras) -> None:
    """Raises ValueError for orthographic cameras: planes through a ridge and its camera are what edges come of."""
    if cameras.orthographic:
        raise ValueError(
            "edges are reconstructed from views with perspective, and these are orthographic: take their pictures as "
            "coloured ones (--target color)"
        )


def edge_views(cameras: Cameras, ridges: Sequence[Ridges]) -> EdgeViews:
    """Prepares the ridges of all views, so that the nearest ones are found at once.

    Raises:
        ValueError: orthographic cameras.
    """
    require_perspective(cameras)
    projection = _numpy(cameras.projection[:, :3])
    planes = [_planes(matrix, ridge) for matrix, ridge in zip(projection, ridges, strict=True)]
    start = np.cumsum([0, *(len(r) for r in ridges)])
    nearest = side_by_side(
        lambda view: _nearest(ridges[view], cameras.size, int(start[view])), len(ridges), len(ridges)
    )
    return EdgeViews(
        cameras.size,
        projection,
        _numpy(cameras.centers.double()),
        np.concatenate([r.points for r in ridges]),
        np.concatenate([r.normals for r in ridges]),
        np.concatenate([r.pulls for r in ridges]),
        max(r.softness for r in ridges),
        start,
        np.concatenate(planes),
        np.stack(nearest),
    )


def _numpy(tensor: Tensor) -> Array:
    return np.asarray(tensor.detach().numpy(), dtype=np.float64)


def _planes(projection: Float[Array, "3 4"], ridges: Ridges) -> Float[Array, "M 4"]:
    """A line n . u + c = 0 of the image is the plane (n, c) P of space."""
    offset = -(ridges.normals * ridges.points).sum(1)
    plane = np.concatenate([ridges.normals, offset[:, None]], 1) @ projection
    return plane / np.linalg.norm(plane[:, :3], axis=1, keepdims=True)


def _nearest(ridges: Ridges, size: tuple[int, int], offset: int) -> Int[NDArray[np.int32], "H W"]:
    from scipy.ndimage import distance_transform_edt

    if not len(ridges):
        return np.full(size, -1, np.int32)
    column, row = np.floor(ridges.points).astype(np.int64).T
    row, column = np.clip(row, 0, size[0] - 1), np.clip(column, 0, size[1] - 1)
    label = np.full(size, -1, np.int32)
    label[row, column] = np.arange(offset, offset + len(ridges))
    y, x = distance_transform_edt(label < 0, return_distances=False, return_indices=True)
    return label[y, x]
