"""Cameras as what an adjustment changes: rotations, shifts, and three numbers of the lens."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.camera import Cameras
from diff3ds.edges.cameras.lens_effect import LensEffect
from diff3ds.edges.evidence.edge_views import EdgeViews

# [numbers; derived] Of a lens.
NUMBERS = 3


@dataclass(frozen=True, eq=False)
class Posed:
    """V cameras with perspective, in float64.

    Attributes:
        rotation, shift: from the world to the camera.
        focal, principal: in pixels, before `lens`.
        lens: the logarithm of the factor of all focal lengths, how far outlines lie outside, pixels, and by how much k1
            of the radial distortion is more than it is said to be.
    """

    rotation: Float[Array, "V 3 3"]
    shift: Float[Array, "V 3"]
    focal: Float[Array, "V 2"]
    principal: Float[Array, "V 2"]
    lens: Float[Array, " 3"]

    @staticmethod
    def of(cameras: Cameras) -> "Posed":
        """These cameras, with nothing of their lens changed."""
        pose, matrix = (m.detach().double().numpy() for m in (cameras.world_to_camera, cameras.intrinsics))
        return Posed(pose[:, :3, :3], pose[:, :3, 3], matrix[:, [0, 1], [0, 1]], matrix[:, :2, 2], np.zeros(NUMBERS))

    def chosen(self, rows: Sequence[int] | NDArray[np.int64]) -> "Posed":
        """These cameras, of which any may come several times."""
        return Posed(self.rotation[rows], self.shift[rows], self.focal[rows], self.principal[rows], self.lens)

    def with_poses(self, other: "Posed", where: Bool[NDArray[np.bool_], " V"]) -> "Posed":
        """These cameras, but some where the others are."""
        rotation = np.where(where[:, None, None], other.rotation, self.rotation)
        return replace(self, rotation=rotation, shift=np.where(where[:, None], other.shift, self.shift))

    @property
    def centers(self) -> Float[Array, "V 3"]:
        """Where the cameras are."""
        return -np.einsum("vji,vj->vi", self.rotation, self.shift)

    @property
    def focals(self) -> Float[Array, "V 2"]:
        """Focal lengths along x and y, pixels."""
        return np.asarray(self.focal * np.exp(self.lens[0]))

    def stepped(self, pose: Float[Array, "V 6"], lens: Float[Array, " 3"]) -> "Posed":
        """The cameras turned about themselves by rotation vectors, then shifted; and the lens changed."""
        turn = rotations(pose[:, :3])
        shift = np.einsum("vij,vj->vi", turn, self.shift) + pose[:, 3:]
        return replace(self, rotation=turn @ self.rotation, shift=shift, lens=self.lens + lens)

    def views(self, views: EdgeViews, effect: LensEffect) -> EdgeViews:
        """The ridges as a detector without offset of outlines has them in pictures without distortion, seen by these
        cameras; their planes are not.
        """
        points = views.points - self.lens[1] * effect.sides[:, None] * views.normals
        points = points + (self.lens[2] - effect.k1) * effect.bends
        zero = np.zeros(len(self.rotation))
        focal, middle = self.focals, self.principal
        rows = [[focal[:, 0], zero, middle[:, 0]], [zero, focal[:, 1], middle[:, 1]], [zero, zero, zero + 1]]
        matrix = np.array(rows).transpose(2, 0, 1)
        projection = matrix @ np.concatenate([self.rotation, self.shift[..., None]], -1)
        return replace(views, projection=projection, centers=self.centers, points=points)

    def cameras(self, like: Cameras) -> Cameras:
        """As `Cameras`, with what those had before but poses and focal lengths."""
        pose, matrix = like.world_to_camera.double().clone(), like.intrinsics.double().clone()
        pose[:, :3, :3], pose[:, :3, 3] = torch.from_numpy(self.rotation), torch.from_numpy(self.shift)
        matrix[:, 0, 0], matrix[:, 1, 1] = torch.from_numpy(self.focals).T
        kind = like.world_to_camera.dtype
        return replace(like, world_to_camera=pose.to(kind), intrinsics=matrix.to(kind))


def coarser(posed: Posed, times: int) -> Posed:
    """The same cameras, with pixels so many times as large."""
    return replace(
        posed,
        focal=posed.focal / times,
        principal=posed.principal / times,
        lens=posed.lens / np.array([1.0, times, 1.0]),
    )


def rotations(vectors: Float[Array, "V 3"]) -> Float[Array, "V 3 3"]:
    """Rotations about these vectors by their lengths (Rodrigues)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def rotation_vectors(matrices: Float[Array, "V 3 3"]) -> Float[Array, "V 3"]:
    """The inverse of `rotations`."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrices).as_rotvec())


def held(posed: Posed, start: Posed) -> Posed:
    """The cameras moved as a whole, so that their mean place, mean direction and spread are those of the start.

    What they see with each other says nothing of these.
    """
    u, _, v = np.linalg.svd(np.einsum("vji,vjk->ik", start.rotation, posed.rotation))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    here, there = posed.centers, start.centers
    spread = [float(np.sqrt(((c - c.mean(0)) ** 2).sum())) for c in (here, there)]
    scale = spread[1] / spread[0] if min(spread) > 0 else 1.0
    centers = scale * (here - here.mean(0)) @ turn.T + there.mean(0)
    rotation = posed.rotation @ turn.T
    return replace(posed, rotation=rotation, shift=-np.einsum("vij,vj->vi", rotation, centers))
