"""The world of cameras turned upright, moved and scaled."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.formats.orientation import orientation_of
from diff3ds.photogrammetry.markers import is_marker, marker_corners
from diff3ds.transforms import View

# What points upwards in a picture as it is stored, camera axes (x right, y down), by its EXIF orientation.
_UPWARDS = {1: (0, -1), 2: (0, -1), 3: (0, 1), 4: (0, 1), 5: (-1, 0), 6: (-1, 0), 7: (1, 0), 8: (1, 0)}

# The sine of the angle by which a photograph is held aside at which it counts a quarter, and rounds of weighing.
ASIDE, ROUNDS = 0.1, 8


def centers_of(views: Sequence[View]) -> Float[Tensor, "V 3"]:
    """The places of the cameras, float64."""
    return torch.stack([-(view.world_to_camera[:3, :3].mT @ view.world_to_camera[:3, 3]) for view in views])


def up_of(views: Sequence[View]) -> Float[Tensor, " 3"]:
    """The unit vector that is up, if most photographs were held level: what is across them all is horizontal."""
    ups, across = [], []
    for view in views:
        x, y = _UPWARDS[orientation_of(view.picture)]
        turn = view.world_to_camera[:3, :3]
        ups.append(turn.mT @ turn.new_tensor([x, y, 0.0]))
        across.append(turn.mT @ turn.new_tensor([-y, x, 0.0]))
    mean = torch.stack(ups).mean(0)
    horizontal, weight = torch.stack(across), torch.ones(len(views), dtype=torch.float64)
    up = mean
    for _ in range(ROUNDS):
        spread, axes = torch.linalg.eigh((weight[:, None] * horizontal).mT @ horizontal / weight.sum())
        # Cameras that look one way have no plane: then the mean of what is up in the pictures is all that there is.
        if float(spread[1]) <= 1e-3:
            break
        up = axes[:, 0]
        # Photographs that were held aside count little.
        weight = 1 / (1 + (horizontal @ up / ASIDE) ** 2) ** 2
    up = torch.nn.functional.normalize(up, dim=0)
    return up if float(up @ mean) >= 0 else -up


def turned_up(up: Float[Tensor, " 3"]) -> Float[Tensor, "3 3"]:
    """The least rotation that turns this unit vector to z."""
    z = up.new_tensor([0.0, 0.0, 1.0])
    cos = float(up @ z)
    if cos < -1 + 1e-9:
        return torch.diag(up.new_tensor([1.0, -1.0, -1.0]))
    x, y, w = torch.linalg.cross(up, z).tolist()
    skew = up.new_tensor([[0.0, -w, y], [w, 0.0, -x], [-y, x, 0.0]])
    return torch.eye(3, dtype=up.dtype) + skew + skew @ skew / (1 + cos)


def looked_at(views: Sequence[View]) -> Float[Tensor, " 3"]:
    """The point nearest to all optical axes."""
    across = torch.stack([torch.eye(3, dtype=torch.float64) - torch.outer(axis, axis) for axis in _axes(views)])
    towards = (across @ centers_of(views)[..., None]).sum(0)[:, 0]
    found: Tensor = torch.linalg.pinv(across.sum(0)) @ towards
    return found


def moved(views: Sequence[View], origin: Float[Tensor, " 3"], turn: Float[Tensor, "3 3"], scale: float) -> list[View]:
    """The views in the world of the points scale * turn @ (x - origin)."""
    result = []
    for view, center in zip(views, centers_of(views), strict=True):
        pose = torch.eye(4, dtype=torch.float64)
        pose[:3, :3] = view.world_to_camera[:3, :3] @ turn.mT
        pose[:3, 3] = -pose[:3, :3] @ (scale * turn @ (center - origin))
        result.append(replace(view, world_to_camera=pose))
    return result


def distance_between(views: Sequence[View], names: tuple[str, str]) -> float:
    """Of two places: cameras by their pictures' names, with or without folder and suffix, points "X,Y,Z", or markers.

    Raises:
        ImportError, ValueError: as `marker_corners`; no such picture, several, or the same place.
    """
    cameras, found = centers_of(views), []
    corners = marker_corners(views, [name for name in names if is_marker(name)])
    for name in names:
        if is_marker(name):
            found.append(corners.pop(0))
            continue
        if (point := _point(name)) is not None:
            found.append(point)
            continue
        those = [i for i, view in enumerate(views) if name in _names(view.picture)]
        if len(those) != 1:
            some = ", ".join(view.picture.name for view in views[:5])
            raise ValueError(f"between: {len(those)} pictures with cameras are called {name!r}: there are {some}, ...")
        found.append(cameras[those[0]])
    length = float((found[0] - found[1]).norm())
    if not length > 0:
        raise ValueError(f"between: {names[0]} and {names[1]} are one place, which has no scale")
    return length


def _point(text: str) -> Float[Tensor, " 3"] | None:
    """A point that is written as three finite numbers."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return (
        torch.tensor(numbers, dtype=torch.float64) if len(numbers) == 3 and all(map(math.isfinite, numbers)) else None
    )


def _names(picture: Path) -> tuple[str, ...]:
    return picture.name, picture.stem, str(picture)


def _axes(views: Sequence[View]) -> list[Float[Tensor, " 3"]]:
    return [view.world_to_camera[2, :3] for view in views]
