"""OpenMVG's sfm_data.json: views, intrinsics and poses."""

from pathlib import Path, PurePosixPath
from typing import Any

from diff3ds._files import read_json
from diff3ds._shapes import Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.frames import ADVICE
from diff3ds.photogrammetry.shot import (
    Shot,
    checked,
    damaged,
    finite_points,
    picture_size,
    pinhole,
    rigid,
    warn_left_out,
)

NAME = "sfm_data.json"


def read_openmvg(path: Path) -> list[Shot]:
    """The views that have a pose.

    Raises:
        ValueError: not such a file; a camera of another kind; no view has a pose.
    """
    data = read_json(path)
    shots, lost = [], []
    with damaged(path, "OpenMVG's: expected views, intrinsics and extrinsics"):
        views = [view["value"]["ptr_wrapper"]["data"] for view in data["views"]]
        cameras = {entry["key"]: entry["value"]["ptr_wrapper"]["data"] for entry in data["intrinsics"]}
        poses = {entry["key"]: entry["value"] for entry in data["extrinsics"]}
        for i, view in enumerate(views):
            pose, camera = poses.get(view["id_pose"]), cameras.get(view["id_intrinsic"])
            name = str(PurePosixPath(str(view.get("local_path", "")), str(view["filename"])))
            if pose is None or camera is None:
                lost.append(name)
                continue
            centers = [[float(n)] for n in pose["center"]]
            rows = [[*turn, *center] for turn, center in zip(pose["rotation"], centers, strict=True)]
            # x_camera = R (x - c): the file holds R and c.
            placed = rigid(path, i, rows, "rotation")
            to_camera = placed.clone()
            to_camera[:3, 3] = -placed[:3, :3] @ placed[:3, 3]
            size, intrinsics, lens = _camera(path, camera)
            shots.append(Shot(name, size, to_camera, intrinsics, lens))
    if not shots:
        raise ValueError(f"{path}: no view has a pose and intrinsics: give the file that the reconstruction wrote")
    warn_left_out(path, lost, len(views), "without a pose or intrinsics")
    return shots


def read_openmvg_points(path: Path) -> Float[Tensor, "P 3"]:
    """The points of the structure, float64.

    Raises:
        ValueError: a damaged file.
    """
    with damaged(path, "OpenMVG's"):
        found = [[float(n) for n in entry["value"]["X"]] for entry in read_json(path).get("structure") or []]
        return finite_points(found)


def _camera(path: Path, camera: dict[str, Any]) -> tuple[tuple[int, int], Float[Tensor, "3 3"], Distortion]:
    """Size, intrinsics and lens. What lens it is, its keys say."""
    try:
        size = picture_size(str(path), camera["width"], camera["height"])
        focal, (cx, cy) = float(camera["focal_length"]), (float(n) for n in camera["principal_point"])
        radial = [float(n) for n in camera.get("disto_k3", camera.get("disto_k1", []))]
        brown = [float(n) for n in camera.get("disto_t2", [])]
        fisheye = [float(n) for n in camera.get("fisheye", [])]
    except (KeyError, OverflowError, TypeError, ValueError) as error:
        lack = "an intrinsic without a focal length and a principal point (spherical?)"
        raise ValueError(f"{path}: {lack}; {ADVICE}") from error
    lens = Distortion(tuple(brown[:3] or fisheye or radial), (brown[3], brown[4]) if brown[4:] else (0.0, 0.0))
    if fisheye:
        lens = Distortion(tuple(fisheye), fisheye=True)
    return size, pinhole(str(path), focal, focal, cx, cy), checked(str(path), lens)
