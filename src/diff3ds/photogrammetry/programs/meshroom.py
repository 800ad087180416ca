"""Meshroom's cameras.sfm (AliceVision's JSON): views, intrinsics and poses."""

from pathlib import Path
from typing import Any

from diff3ds._files import read_json
from diff3ds._shapes import Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.frames import ADVICE
from diff3ds.photogrammetry.shot import Shot, checked, damaged, inverse, picture_size, pinhole, rigid, warn_left_out

PATTERN = "*.sfm"
# Lenses by the names of types and of distortions, before and since they are told apart; AliceVision's radialk3pt,
# fisheye1 and those of 3DEqualizer have formulas of their own.
PLAIN, BROWN, FISHEYE = ("pinhole", "none"), ("brown",), ("fisheye4", "fisheye")
RADIAL = ("radial1", "radial3", "radialk1", "radialk3")
LENSES = (*PLAIN, *RADIAL, *BROWN, *FISHEYE)


def is_meshroom(data: object) -> bool:
    """Whether a JSON file is AliceVision's."""
    return isinstance(data, dict) and isinstance(data.get("version"), list) and "views" in data


def read_meshroom(path: Path) -> list[Shot]:
    """The views that have a pose.

    Raises:
        ValueError: not such a file; a lens of another kind; rigs; no view has a pose.
    """
    data = read_json(path)
    shots, lost = [], []
    with damaged(path, "Meshroom's"):
        version = tuple(int(n) for n in data["version"])
        cameras = {camera["intrinsicId"]: camera for camera in data.get("intrinsics", [])}
        poses = {pose["poseId"]: pose["pose"]["transform"] for pose in data.get("poses", [])}
        for i, view in enumerate(data["views"]):
            if view["poseId"] not in poses or view["intrinsicId"] not in cameras:
                lost.append(str(view["path"]))
                continue
            if int(view.get("rigId", -1)) not in (-1, 2**32 - 1):
                raise ValueError(f"{path}: rigs are not read: convert it with ConvertSfMFormat, or export COLMAP's")
            transform = poses[view["poseId"]]
            turn, center = ([float(n) for n in transform[key]] for key in ("rotation", "center"))
            # World to camera, by columns: camera to world, by rows.
            to_world = rigid(path, i, [[*turn[3 * r : 3 * r + 3], center[r]] for r in range(3)], "rotation")
            size, intrinsics, lens = _camera(f"{path}: view {i}", version, cameras[view["intrinsicId"]])
            shots.append(Shot(str(view["path"]), size, inverse(to_world), intrinsics, lens))
    if not shots:
        raise ValueError(f"{path}: no view has a pose: give the file that StructureFromMotion wrote")
    warn_left_out(path, lost, len(data["views"]), "without a pose or intrinsics")
    return shots


def _camera(
    where: str, version: tuple[int, ...], camera: dict[str, Any]
) -> tuple[tuple[int, int], Float[Tensor, "3 3"], Distortion]:
    """Size, intrinsics and lens, as each version of the file has them."""
    size = picture_size(where, camera["width"], camera["height"])
    given = camera.get("pxFocalLength") if version < (1, 2, 2) else None
    if given is None:
        fx = float(camera["focalLength"]) / float(camera.get("sensorWidth", 36)) * size[1]
        ratio = float(camera.get("pixelRatio", 1))
        fy = fx * ratio if version >= (1, 2, 5) else fx / ratio
    else:
        fx, fy = (float(n) for n in (given if isinstance(given, list) else [given, given]))
    x, y = (float(n) for n in camera["principalPoint"])
    middle = (size[1] / 2, size[0] / 2) if version >= (1, 2, 1) else (0.0, 0.0)
    intrinsics = pinhole(where, fx, fy, middle[0] + x, middle[1] + y)
    numbers = [float(n) for n in camera.get("distortionParams") or []]
    backwards = any(float(n) for n in camera.get("undistortionParams") or [])
    kinds = [str(camera[key]).lower() for key in ("type", "distortionType") if key in camera]
    counts = {0, 1, 3} if kinds[-1] in RADIAL else {5} if kinds[-1] in BROWN else {0, 4}
    plain = kinds[-1] in PLAIN and any(numbers)
    if not set(kinds) <= set(LENSES) or len(numbers) not in counts or plain or backwards:
        raise ValueError(f"{where}: the lens {' '.join(kinds):.60} {numbers} is not read; {ADVICE}")
    tangential = (numbers[3], numbers[4]) if kinds[-1] in BROWN else (0.0, 0.0)
    radial = tuple(numbers[:3] if kinds[-1] in BROWN else numbers)
    return size, intrinsics, checked(where, Distortion(radial, tangential, fisheye=kinds[-1] in FISHEYE))
