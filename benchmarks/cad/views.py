"""Cameras around the unit cube like those of the ABC-NEF pictures, and projection into their pixels."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

SIZE = 400
# tan of half the field of view is .36, as in ABC-NEF (camera_angle_x .691 at 400 pixels).
FOCAL = SIZE / 2 / 0.36
CENTRE = np.full(3, 0.5)


@dataclass(frozen=True)
class View:
    """A camera at `eye`; rows of `axes` (3, 3) are its directions right, down and forward in the world."""

    eye: np.ndarray
    axes: np.ndarray

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (n, 2), whose centres are at half integers, and depths (n,) of points (n, 3)."""
        local = (points - self.eye) @ self.axes.T
        return FOCAL * local[:, :2] / local[:, 2:] + SIZE / 2, local[:, 2]

    def matrix(self) -> list[list[float]]:
        """Camera to world in OpenGL's axes (right, up, back), as transforms.json wants it."""
        right, down, forward = self.axes
        rows = np.column_stack([right, -down, -forward, self.eye])
        return [*rows.tolist(), [0.0, 0.0, 0.0, 1.0]]


def random_views(rng: Generator, count: int) -> list[View]:
    """Cameras all around at distances of 3.15 to 4.85, looking at the middle of the cube, z up in the picture."""
    views = []
    for _ in range(count):
        away = rng.normal(size=3)
        away /= np.linalg.norm(away)
        right = np.cross(-away, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        views.append(View(CENTRE + rng.uniform(3.15, 4.85) * away, np.array([right, np.cross(-away, right), -away])))
    return views


def transforms(views: list[View], folder: str) -> dict:
    """The content of transforms.json for pictures folder/000.png, folder/001.png and so on."""
    frames = [{"file_path": f"{folder}/{i:03d}.png", "transform_matrix": v.matrix()} for i, v in enumerate(views)]
    intrinsics = {"w": SIZE, "h": SIZE, "fl_x": FOCAL, "fl_y": FOCAL, "cx": SIZE / 2, "cy": SIZE / 2}
    return {**intrinsics, "camera_angle_x": 2 * np.arctan(SIZE / 2 / FOCAL), "frames": frames}
