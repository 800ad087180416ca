"""transforms.json files in and out: cameras and pictures in the dialects of nerfstudio, instant-ngp, NeRF synthetic."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import read_json, write_text
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, check_size

# The files hold OpenGL camera axes (x right, y up, looking along -z); ours are OpenCV.
_OPENGL_TO_OPENCV = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))
MAX_NUMBER = 1e100
# Written without a suffix (NeRF synthetic), a picture is looked for with these.
SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")
# nerfstudio's names of cameras that the five coefficients describe, and instant-ngp's flags of those they do not.
CAMERA_MODELS = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "PERSPECTIVE")
OTHER_LENSES = ("is_fisheye", "equirectangular", "latlong", "orthographic")
DISTORTION = ("k1", "k2", "p1", "p2", "k3")
MORE_DISTORTION = ("k4", "k5", "k6")
ADVICE = "undistort the pictures first, for example with COLMAP's image_undistorter"
# Missing files named in an error.
NAMED = 5


@dataclass(frozen=True, eq=False)
class View:
    """One frame of a transforms.json.

    Attributes:
        picture: file.
        mask: file that is black where the picture does not count, or shows background (`tasks/masks.py`); or None.
        size: (height, width) of the picture in pixels.
        world_to_camera: float64, OpenCV axes.
        intrinsics: float64, in pixels of the picture.
        distortion: k1, k2, p1, p2, k3 of OpenCV's radial and tangential model; all 0 without.
    """

    picture: Path
    mask: Path | None
    size: tuple[int, int]
    world_to_camera: Float[Tensor, "4 4"]
    intrinsics: Float[Tensor, "3 3"]
    distortion: tuple[float, float, float, float, float]


def read_views(path: str | Path) -> list[View]:
    """The frames of a transforms.json (docs/reference/files.md lists the keys), in the order of the file.

    Pictures are opened only where the file does not say their size.

    Raises:
        FileNotFoundError: the file is missing, or pictures whose size is needed.
        ValueError: not such a file; a frame without a pose or a focal length; a lens that is not supported.
    """
    path = Path(path)
    data = _read_frames(path)
    frames: list[dict[str, Any]] = data["frames"]
    pictures = [_picture(path, i, frame) for i, frame in enumerate(frames)]
    if not all("w" in {**data, **frame} and "h" in {**data, **frame} for frame in frames):
        require_files(path, pictures)
    return [
        _view(path, i, data, frame, picture) for i, (frame, picture) in enumerate(zip(frames, pictures, strict=True))
    ]


def require_files(path: Path, files: Sequence[Path]) -> None:
    """Checks that the pictures of a transforms.json exist.

    Raises:
        FileNotFoundError: says how many are missing, and names some.
    """
    missing = [file for file in files if not file.is_file()]
    if missing:
        names = ", ".join(str(file) for file in missing[:NAMED]) + (", ..." if len(missing) > NAMED else "")
        raise FileNotFoundError(
            f"{path}: {len(missing)} of {len(files)} pictures are missing: {names}. "
            "Paths are relative to the folder of this file; put the pictures there or remove these frames"
        )


def load_transforms(path: str | Path) -> tuple[Cameras, list[Path]]:
    """Cameras and picture paths of a transforms.json whose pictures have one size and no lens distortion.

    Focal lengths come from `fl_x` and `fl_y` or `camera_angle_x` and `camera_angle_y`, in the frame or for all frames;
    a missing principal point is the centre of the image; a missing size is read from the picture.

    Raises:
        FileNotFoundError, ValueError: as `read_views`; views of different sizes; lens distortion.
    """
    path = Path(path)
    views = read_views(path)
    sizes = {view.size for view in views}
    if len(sizes) != 1:
        raise ValueError(f"{path}: all views must have one size, got {sorted(sizes)} (height, width)")
    for view in views:
        for key, value in zip(DISTORTION, view.distortion, strict=True):
            if value:
                raise ValueError(f"{path}: the pictures have lens distortion ({key}); {ADVICE}")
    poses = torch.stack([view.world_to_camera for view in views])
    intrinsics = torch.stack([view.intrinsics for view in views])
    return Cameras(poses.float(), intrinsics.float(), sizes.pop()), [view.picture for view in views]


def save_transforms(path: str | Path, cameras: Cameras, pictures: Sequence[str | Path]) -> None:
    """Writes a transforms.json for these cameras; picture paths are written as given.

    Raises:
        ValueError: not one picture a view, or intrinsics with skew, which such a file cannot hold.
    """
    if len(pictures) != len(cameras):
        raise ValueError(f"expected {len(cameras)} pictures, one a view, got {len(pictures)}")
    skewed = cameras.intrinsics[:, 0, 1] != 0
    if bool(skewed.any()):
        view = int(skewed.int().argmax())
        raise ValueError(
            f"a transforms.json holds no skew, and view {view} has {cameras.intrinsics[view, 0, 1].item()}"
        )
    poses = torch.linalg.inv(cameras.world_to_camera.detach().cpu().double()) @ _OPENGL_TO_OPENCV
    intrinsics = cameras.intrinsics.detach().cpu().double()
    height, width = cameras.size
    frames = [
        {
            "file_path": str(picture),
            "fl_x": float(k[0, 0]),
            "fl_y": float(k[1, 1]),
            "cx": float(k[0, 2]),
            "cy": float(k[1, 2]),
            "transform_matrix": pose.tolist(),
        }
        for picture, k, pose in zip(pictures, intrinsics, poses, strict=True)
    ]
    write_text(Path(path), json.dumps({"w": width, "h": height, "frames": frames}, indent=1))


def _read_frames(path: Path) -> dict[str, Any]:
    content = read_json(path)
    data: dict[str, Any] = content if isinstance(content, dict) else {}
    frames = data.get("frames")
    if not isinstance(frames, list) or not frames or not all(isinstance(f, dict) for f in frames):
        raise ValueError(f"{path}: expected an object with a non-empty list 'frames', as in a transforms.json")
    return data


def _view(path: Path, index: int, data: dict[str, Any], frame: dict[str, Any], picture: Path) -> View:
    values = {**data, **frame}
    size = _size(path, values, picture)
    intrinsics = _intrinsics(path, index, data, frame, size)
    world_to_camera = torch.linalg.inv(_pose(path, index, frame) @ _OPENGL_TO_OPENCV)
    mask = frame.get("mask_path")
    if mask is not None and not (isinstance(mask, str) and mask):
        raise ValueError(f"{path}: frame {index}: mask_path must be a file name, got {mask!r:.40}")
    return View(
        picture,
        path.parent / mask if mask else None,
        size,
        world_to_camera,
        intrinsics,
        _distortion(path, index, values),
    )


def _number(path: Path, values: dict[str, Any], key: str, default: float | None = None) -> float:
    value = values.get(key, default)
    # The bound keeps whole numbers of any length out of float(), and leaves room for squares.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < MAX_NUMBER:
        raise ValueError(f"{path}: {key} must be a finite number, got {value!r:.40}")
    return float(value)


def _picture(path: Path, index: int, frame: dict[str, Any]) -> Path:
    name = frame.get("file_path")
    if not isinstance(name, str) or not name:
        raise ValueError(f"{path}: frame {index} has no file_path")
    picture = path.parent / name
    if picture.is_file():
        return picture
    # Not with_suffix: what follows a dot in "frame.001" is no suffix.
    with_suffix = [picture.with_name(picture.name + suffix) for suffix in SUFFIXES]
    return next((p for p in with_suffix if p.is_file()), picture if picture.suffix else with_suffix[0])


def _size(path: Path, values: dict[str, Any], picture: Path) -> tuple[int, int]:
    if "w" in values and "h" in values:
        height, width = _number(path, values, "h"), _number(path, values, "w")
        if not (height.is_integer() and width.is_integer()):
            raise ValueError(f"{path}: w and h must be whole numbers, got {width} and {height}")
        try:
            return check_size((int(height), int(width)))
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(picture) as image:
            return image.height, image.width
    except (UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise ValueError(f"{picture}: not a picture, or one that is too large") from error


def _pose(path: Path, index: int, frame: dict[str, Any]) -> Float[Tensor, "4 4"]:
    try:
        pose = torch.tensor(frame["transform_matrix"], dtype=torch.float64)
        if pose.shape == (3, 4):
            pose = torch.cat([pose, torch.tensor([[0.0, 0.0, 0.0, 1.0]], dtype=torch.float64)])
    except (KeyError, TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise ValueError(f"{path}: frame {index} has no transform_matrix of 4x4 numbers") from error
    if pose.shape != (4, 4) or not bool(pose.isfinite().all()):
        raise ValueError(f"{path}: frame {index}: transform_matrix must hold 4x4 finite numbers")
    rotation = pose[:3, :3]
    orthogonal = torch.allclose(rotation @ rotation.T, torch.eye(3, dtype=torch.float64), atol=1e-3)
    if not orthogonal or rotation.det() < 0 or not torch.equal(pose[3], torch.eye(4, dtype=torch.float64)[3]):
        raise ValueError(f"{path}: frame {index}: transform_matrix is not a rotation and a translation")
    return pose


def _intrinsics(
    path: Path, index: int, data: dict[str, Any], frame: dict[str, Any], size: tuple[int, int]
) -> Float[Tensor, "3 3"]:
    height, width = size
    # What a frame says in either form wins over what the file says for all.
    fx = _focal_length(path, frame, "x", width) or _focal_length(path, data, "x", width)
    fy = _focal_length(path, frame, "y", height) or _focal_length(path, data, "y", height)
    if fx is None and fy is None:
        raise ValueError(f"{path}: frame {index} has neither fl_x nor camera_angle_x")
    fx, fy = fx or fy, fy or fx
    values = {**data, **frame}
    cx, cy = _number(path, values, "cx", width / 2), _number(path, values, "cy", height / 2)
    return torch.tensor([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], dtype=torch.float64)


def _focal_length(path: Path, values: dict[str, Any], axis: str, side: int) -> float | None:
    """Focal length in pixels along an axis, as a length or from the field of view; None if neither is there."""
    length, angle = f"fl_{axis}", f"camera_angle_{axis}"
    if length in values:
        focal = _number(path, values, length)
        if focal <= 0:
            raise ValueError(f"{path}: focal lengths must be positive, got {length} = {focal}")
        return focal
    if angle in values:
        field = _number(path, values, angle)
        if not 0 < field < math.pi:
            raise ValueError(f"{path}: {angle} must lie in (0, pi), got {field}")
        return side / 2 / math.tan(field / 2)
    return None


def _distortion(path: Path, index: int, values: dict[str, Any]) -> tuple[float, float, float, float, float]:
    model = values.get("camera_model", CAMERA_MODELS[0])
    if not isinstance(model, str) or model.upper() not in CAMERA_MODELS:
        accepted = ", ".join(CAMERA_MODELS)
        raise ValueError(f"{path}: frame {index}: camera_model {model!r:.40} is not one of {accepted}; {ADVICE}")
    for key in OTHER_LENSES:
        if values.get(key):
            raise ValueError(f"{path}: frame {index}: pictures that are {key} are not supported; {ADVICE}")
    for key in MORE_DISTORTION:
        if _number(path, values, key, 0.0):
            raise ValueError(f"{path}: frame {index}: lens distortion {key} is not supported; {ADVICE}")
    k1, k2, p1, p2, k3 = (_number(path, values, key, 0.0) for key in DISTORTION)
    return k1, k2, p1, p2, k3
