"""The cameras.json of a trained scene of 3D Gaussians."""

from pathlib import Path

from diff3ds._files import read_json
from diff3ds.photogrammetry.shot import Shot, damaged, inverse, picture_size, pinhole, rigid

NAME = "cameras.json"


def is_gaussians(data: object) -> bool:
    """Whether a JSON file has such cameras."""
    return isinstance(data, list) and bool(data) and isinstance(data[0], dict) and "img_name" in data[0]


def read_gaussians(path: Path) -> list[Shot]:
    """The cameras: camera to world with OpenCV axes, the principal point in the middle.

    Raises:
        ValueError: not such a file.
    """
    data = read_json(path)
    shots = []
    for i, camera in enumerate(data if is_gaussians(data) else []):
        with damaged(path, "the cameras of 3D Gaussians"):
            name, turn, place = camera["img_name"], camera["rotation"], camera["position"]
            rows = [[*map(float, row), float(at)] for row, at in zip(turn, place, strict=True)]
            focal = float(camera["fx"]), float(camera["fy"])
            size = picture_size(f"{path}: camera {i}", camera["width"], camera["height"])
        intrinsics = pinhole(f"{path}: camera {i}", *focal, size[1] / 2, size[0] / 2)
        shots.append(Shot(str(name), size, inverse(rigid(path, i, rows, "rotation")), intrinsics))
    if not shots:
        raise ValueError(f"{path}: not the cameras of 3D Gaussians: expected a list of img_name, position, rotation")
    return shots
