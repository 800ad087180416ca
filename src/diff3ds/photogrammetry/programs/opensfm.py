"""OpenSfM's reconstruction.json, which OpenDroneMap and Mapillary write too."""

import math
import warnings
from pathlib import Path
from typing import Any

from diff3ds._files import read_json
from diff3ds._shapes import Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.frames import ADVICE
from diff3ds.photogrammetry.shot import (
    LARGEST,
    Shot,
    checked,
    damaged,
    finite_points,
    picture_size,
    pinhole,
    quaternion_pose,
)

NAME = "reconstruction.json"
# Names of lenses, with their radial coefficients.
LENSES = {
    "perspective": ("k1", "k2"),
    "simple_radial": ("k1",),
    "radial": ("k1", "k2"),
    "brown": ("k1", "k2", "k3"),
    "fisheye": ("k1", "k2"),
    "fisheye_opencv": ("k1", "k2", "k3", "k4"),
}


def is_opensfm(data: object) -> bool:
    """Whether a JSON file has such reconstructions."""
    return isinstance(data, list) and bool(data) and isinstance(data[0], dict) and "shots" in data[0]


def read_opensfm(path: Path) -> list[Shot]:
    """The shots of the largest reconstruction; a warning says how many others there are.

    Raises:
        ValueError: not such a file; a lens of another kind.
    """
    whole, shots = _largest(path), []
    with damaged(path, "OpenSfM's"):
        cameras = {name: _camera(f"{path}: camera {name}", camera) for name, camera in whole["cameras"].items()}
        for name, shot in sorted(whole["shots"].items()):
            where = f"{path}: {name}"
            size, intrinsics, lens = cameras[shot["camera"]]
            # The axis, as long as the angle.
            (x, y, z), place = ([float(n) for n in shot[key]] for key in ("rotation", "translation"))
            angle = math.hypot(x, y, z)
            half = math.sin(angle / 2) / angle if 0 < angle < LARGEST else 0.5
            turn = [math.cos(angle / 2) if angle < LARGEST else math.nan, half * x, half * y, half * z]
            shots.append(Shot(name, size, quaternion_pose(where, turn, place), intrinsics, lens))
    if not shots:
        raise ValueError(f"{path}: the reconstruction has no shots")
    return shots


def read_opensfm_points(path: Path) -> Float[Tensor, "P 3"]:
    """The points of the largest reconstruction, float64.

    Raises:
        ValueError: a damaged file.
    """
    with damaged(path, "OpenSfM's"):
        found = [[float(n) for n in point["coordinates"]] for point in (_largest(path).get("points") or {}).values()]
        return finite_points(found)


def _largest(path: Path) -> dict[str, Any]:
    data = read_json(path)
    if not is_opensfm(data) or not all(isinstance(part, dict) and isinstance(part.get("shots"), dict) for part in data):
        raise ValueError(f"{path}: not OpenSfM's: expected a list of reconstructions with cameras and shots")
    if len(data) > 1:
        counts = [len(part["shots"]) for part in data]
        warnings.warn(
            f"{path}: of {len(data)} reconstructions that do not hang together the largest is read, {max(counts)} of "
            f"{sum(counts)} shots",
            stacklevel=4,
        )
    return max(data, key=lambda part: len(part["shots"]))


def _camera(where: str, camera: dict[str, Any]) -> tuple[tuple[int, int], Float[Tensor, "3 3"], Distortion]:
    """Size, intrinsics and lens. Lengths are told by the longer side of the picture, from its middle."""
    kind = str(camera.get("projection_type"))
    if kind not in LENSES:
        raise ValueError(f"{where}: {kind!r:.40} is not one of {', '.join(LENSES)}; {ADVICE}")
    size = picture_size(where, camera["width"], camera["height"])
    side = max(size)

    def value(*keys: str) -> float:
        return float(next((camera[key] for key in keys if key in camera), 0.0))

    fx, fy = value("focal_x", "focal"), value("focal_y", "focal_x", "focal")
    intrinsics = pinhole(
        where, fx * side, fy * side, size[1] / 2 + value("c_x") * side, size[0] / 2 + value("c_y") * side
    )
    radial, tangential = tuple(value(key) for key in LENSES[kind]), (value("p1"), value("p2"))
    lens = Distortion(radial, tangential, fisheye=kind.startswith("fisheye"))
    return size, intrinsics, checked(where, lens)
