"""What the lens does to ridges: outlines that lie outside, and radial distortion that pictures still have."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.camera import Cameras
from diff3ds.distortion import Distortion
from diff3ds.edges.evidence.ridges import Ridges

# [1; numerical] Step of the derivative by k1: points move by less than a pixel with it, and their rounding is 1e-12.
STEP = 1e-4
# [px; numerical] A place that a lens shows nearer than this to where it should is found.
FOUND = 1e-6


@dataclass(frozen=True, eq=False)
class LensEffect:
    """How the points of all ridges move with the numbers of a lens.

    Attributes:
        sides: `outline_sides` of all of them.
        bends: by how much points move as k1 grows by one, pixels; zero where it is not looked for.
        k1: so much more than the lens is said to have was taken out of the points.
    """

    sides: Float[Array, " R"]
    bends: Float[Array, "R 2"]
    k1: float = 0.0

    @staticmethod
    def fixed(sides: Float[Array, " R"]) -> "LensEffect":
        """That of a lens whose distortion is known."""
        return LensEffect(sides, np.zeros((len(sides), 2)))


@dataclass(frozen=True, eq=False)
class Bending:
    """Pixels of pictures made straight, in pictures made straight as of a lens with other numbers.

    Attributes:
        lens: that was taken out of the pictures.
        given, now: intrinsics of the pictures, and of those with other numbers; pixels.
    """

    lens: Distortion
    given: Float[Array, "3 3"]
    now: Float[Array, "3 3"]

    def moved(
        self, points: Float[Array, "M 2"], k1: float
    ) -> tuple[Float[Array, "M 2"], Bool[NDArray[np.bool_], " M"]]:
        """The points if k1 is so much more, and which of them there are: the rest no such lens shows."""
        at = torch.from_numpy(np.column_stack([points, np.ones(len(points))]) @ np.linalg.inv(self.given).T)
        shown = torch.stack(self.lens.bent(at[:, 0], at[:, 1]), -1)
        # The picture as taken stays where it is, whatever the focal length.
        taken = torch.nn.functional.pad(shown, (0, 1), value=1.0) @ torch.from_numpy(
            (np.linalg.inv(self.now) @ self.given).T
        )
        lens = self.lens.with_more_k1(k1)
        x, y = lens.straight(taken[:, 0], taken[:, 1])
        off = (torch.stack(lens.bent(x, y), -1) - taken[:, :2]).norm(dim=1).numpy() * self.now[0, 0]
        places = np.column_stack([x.numpy(), y.numpy(), np.ones(len(points))]) @ self.now.T
        return places[:, :2], off < FOUND

    def ridges(self, ridges: Ridges, k1: float, size: tuple[int, int]) -> Ridges:
        """The ridges if k1 is so much more, within pictures of this (height, width)."""
        along = np.column_stack([-ridges.normals[:, 1], ridges.normals[:, 0]])
        points, there = self.moved(ridges.points, k1)
        ahead, behind = (self.moved(ridges.points + side * along / 2, k1)[0] for side in (1, -1))
        heading = ahead - behind
        normals = np.column_stack([heading[:, 1], -heading[:, 0]])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        there &= ((points >= 0) & (points < size[::-1])).all(1)
        return replace(ridges, points=points, normals=normals)[there]

    def bends(self, points: Float[Array, "M 2"], k1: float) -> Float[Array, "M 2"]:
        """By how much points move as k1 grows by one, pixels: points of pictures as they are if k1 is so much more."""
        here = Bending(self.lens.with_more_k1(k1), self.now, self.now)
        ahead, behind = (here.moved(points, step)[0] for step in (STEP, -STEP))
        return (ahead - behind) / (2 * STEP)

    def at_corners(self, size: tuple[int, int], k1: float) -> float:
        """How far the corner that moves most does if k1 is so much more, pixels."""
        corners = np.array([[x, y] for x in (0.0, size[1]) for y in (0.0, size[0])])
        away = self.moved(corners, k1)[0] - self.moved(corners, 0.0)[0]
        return float(np.linalg.norm(away, axis=1).max())


def bending(given: Cameras, now: Cameras, lens: Distortion) -> Bending:
    """That of cameras that all have one lens.

    Args:
        given: that the pictures were made straight for.
        now: with other focal lengths.
        lens: that was taken out of the pictures.
    """
    return Bending(lens, *(c.intrinsics[0].detach().double().numpy() for c in (given, now)))
