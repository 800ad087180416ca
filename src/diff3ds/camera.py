"""Pinhole cameras, batched: orbits, look-at, and transforms.json files in and out.

Conventions (docs/conventions.md): world z up, OpenCV camera axes (x right, y down, z forward), pixels from the top-left
corner with centres at half integers, degrees at the surface.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import read_json, write_text
from diff3ds._shapes import Float, Tensor

Angle = float | Sequence[float] | Tensor
Size = int | tuple[int, int]

DEFAULT_NEAR = 0.01
# transforms.json holds OpenGL camera axes (x right, y up, looking along -z); ours are OpenCV.
_OPENGL_TO_OPENCV = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))
MAX_NUMBER = 1e100
# Images beyond this side are taken for a mistake in a file.
MAX_SIZE = 65536


@dataclass(frozen=True, eq=False)
class Cameras:
    """V pinhole cameras that make images of one size.

    Attributes:
        world_to_camera: rigid transforms, bottom row (0, 0, 0, 1).
        intrinsics: in pixels, bottom row (0, 0, 1).
        size: (height, width) of the images in pixels.
        near: depth in world units; what is closer, or behind, is not drawn.

    Raises:
        TypeError, ValueError: an attribute of the wrong type, shape, dtype or device, a value that is not finite, a
            focal length that is not positive; the message names the attribute and the view.
    """

    world_to_camera: Float[Tensor, "V 4 4"]
    intrinsics: Float[Tensor, "V 3 3"]
    size: tuple[int, int]
    near: float = DEFAULT_NEAR

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", check_size(self.size))
        for name, side in (("world_to_camera", 4), ("intrinsics", 3)):
            value = getattr(self, name)
            if not isinstance(value, Tensor) or not value.is_floating_point():
                raise TypeError(f"{name} must be a floating point tensor, got {type(value).__name__}")
            if value.ndim != 3 or value.shape[1:] != (side, side):
                raise ValueError(f"{name} must have shape (V, {side}, {side}), got {tuple(value.shape)}")
            finite = value.detach().isfinite().flatten(1).all(1)
            if not bool(finite.all()):
                raise ValueError(f"{name} of view {int(finite.int().argmin())} has a value that is not finite")
        if len(self.world_to_camera) != len(self.intrinsics):
            got = f"{len(self.world_to_camera)} and {len(self.intrinsics)}"
            raise ValueError(f"world_to_camera and intrinsics must have one matrix a view, got {got}")
        if self.world_to_camera.device != self.intrinsics.device:
            got = f"{self.world_to_camera.device} and {self.intrinsics.device}"
            raise ValueError(f"world_to_camera and intrinsics must be on one device, got {got}")
        focal = self.intrinsics.detach()[:, [0, 1], [0, 1]]
        if not bool((focal > 0).all()):
            view = int((focal <= 0).any(1).int().argmax())
            raise ValueError(f"intrinsics of view {view}: focal lengths must be positive, got {focal[view].tolist()}")
        if not (isinstance(self.near, int | float) and 0 < self.near < math.inf):
            raise ValueError(f"near must be a positive number, got {self.near}")

    def __len__(self) -> int:
        return len(self.world_to_camera)

    def __getitem__(self, index: int | slice | list[int] | Tensor) -> "Cameras":
        """Some of the views; an int gives a batch of one."""
        rows = [index] if isinstance(index, int) else index
        return replace(self, world_to_camera=self.world_to_camera[rows], intrinsics=self.intrinsics[rows])

    @property
    def centers(self) -> Float[Tensor, "V 3"]:
        """Positions of the cameras in the world."""
        rotation, translation = self.world_to_camera[:, :3, :3], self.world_to_camera[:, :3, 3:]
        return -(rotation.mT @ translation)[..., 0]

    def to(self, target: torch.dtype | torch.device | str) -> "Cameras":
        """The same cameras in another dtype or on another device."""
        return replace(self, world_to_camera=self.world_to_camera.to(target), intrinsics=self.intrinsics.to(target))

    def resize(self, size: Size) -> "Cameras":
        """The same views with images of another size in pixels; the field of view stays."""
        height, width = check_size(size)
        scale = self.intrinsics.new_tensor([width / self.size[1], height / self.size[0], 1.0])
        return replace(self, intrinsics=self.intrinsics * scale[:, None], size=(height, width))

    @property
    def projection(self) -> Float[Tensor, "V 4 4"]:
        """Float64 matrices from homogeneous world points (w P, w) to (X, Y, Z, W), docs eq. 1.

        The pixel is (X / Z, Y / Z), the depth Z / W.
        """
        if self.world_to_camera.requires_grad or self.intrinsics.requires_grad:
            return self._projection()
        return self._constant_projection

    @cached_property
    def _constant_projection(self) -> Float[Tensor, "V 4 4"]:
        return self._projection()

    def _projection(self) -> Float[Tensor, "V 4 4"]:
        to_camera, intrinsics = self.world_to_camera.double(), self.intrinsics.double()
        return torch.cat([intrinsics @ to_camera[:, :3], to_camera[:, 3:]], 1)


def check_size(size: Size) -> tuple[int, int]:
    """(height, width) from one number or a pair.

    Raises:
        ValueError: not one or two positive integers of at most 65,536.
    """
    pair = tuple(size) if isinstance(size, tuple | list) else (size, size)
    if len(pair) != 2 or not all(isinstance(n, int) and 0 < n <= MAX_SIZE for n in pair):
        raise ValueError(f"size must be a positive int or (height, width) up to {MAX_SIZE}, got {size}")
    return pair


def look_at(
    eye: Float[Tensor, "V 3"],
    target: Sequence[float] | Float[Tensor, " 3"] | Float[Tensor, "V 3"] = (0.0, 0.0, 0.0),
    *,
    fov: Angle = 60.0,
    size: Size = 512,
    up: Sequence[float] = (0.0, 0.0, 1.0),
    near: float = DEFAULT_NEAR,
) -> Cameras:
    """Cameras at `eye` that look at `target`; `up` points upwards in the images.

    Args:
        fov: vertical field of view in degrees, one for all or one a view.
        size: image size in pixels, an int or (height, width).

    Raises:
        ValueError: wrong shapes, an eye on its target, a view along `up`, a field of view outside (0, 180).
    """
    height, width = check_size(size)
    eye = torch.as_tensor(eye)
    eye = eye if eye.is_floating_point() else eye.to(torch.get_default_dtype())
    if eye.ndim != 2 or eye.shape[1] != 3:
        raise ValueError(f"eye must have shape (V, 3), got {tuple(eye.shape)}")
    target = torch.as_tensor(target, dtype=eye.dtype, device=eye.device)
    if target.shape not in ((3,), eye.shape):
        raise ValueError(f"target must have shape (3,) or {tuple(eye.shape)}, got {tuple(target.shape)}")
    focal = _focal_lengths(torch.as_tensor(fov, dtype=eye.dtype, device=eye.device), height, len(eye))
    forward = target - eye
    right = torch.linalg.cross(forward, torch.as_tensor(up, dtype=eye.dtype, device=eye.device).expand_as(forward))
    lengths = torch.linalg.vector_norm(torch.stack([forward, right]), dim=-1)
    sideways = lengths[1] > 1e-6 * lengths[0]
    if not bool(sideways.all()):
        view = int(sideways.int().argmin())
        raise ValueError(
            f"eye of view {view} must be finite, apart from its target and not above or below it (up is {up}), "
            f"got {eye[view].tolist()}"
        )
    forward, right = forward / lengths[0, :, None], right / lengths[1, :, None]
    rotation = torch.stack([right, torch.linalg.cross(forward, right), forward], 1)
    top = torch.cat([rotation, -(rotation @ eye[..., None])], -1)
    bottom = eye.new_tensor([0.0, 0.0, 0.0, 1.0]).expand(len(eye), 1, 4)
    intrinsics = _intrinsics(focal, focal, width / 2, height / 2)
    return Cameras(torch.cat([top, bottom], 1), intrinsics, (height, width), near)


def orbit(
    azimuth: Angle,
    elevation: Angle = 0.0,
    distance: Angle = 2.0,
    *,
    fov: Angle = 60.0,
    size: Size = 512,
    target: Sequence[float] = (0.0, 0.0, 0.0),
    near: float = DEFAULT_NEAR,
) -> Cameras:
    """Cameras on a sphere that look at its centre, z up.

    Args:
        azimuth: degrees, 0 on +x, counter-clockwise seen from +z; a number or one a view, as are the next three.
        elevation: degrees above the horizon, in (-90, 90).
        distance: from the target, world units.
        fov: vertical field of view in degrees.
        size: image size in pixels, an int or (height, width).

    Raises:
        ValueError: values out of range, or lists of different lengths.
    """
    values = [torch.as_tensor(a, dtype=torch.get_default_dtype()).reshape(-1) for a in (azimuth, elevation, distance)]
    lengths = sorted({len(v) for v in values} - {1})
    if len(lengths) > 1:
        raise ValueError(f"azimuth, elevation and distance must have one value or one a view, got {lengths} values")
    around, up, radius = torch.broadcast_tensors(*values)  # type: ignore[no-untyped-call]
    if not bool((around.isfinite() & (up.abs() < 90) & (radius > 0) & radius.isfinite()).all()):
        raise ValueError(
            "azimuth must be finite, elevation in (-90, 90) degrees and distance positive, "
            f"got {azimuth}, {elevation} and {distance}"
        )
    around, up = torch.deg2rad(around.double()), torch.deg2rad(up.double())
    direction = torch.stack([up.cos() * around.cos(), up.cos() * around.sin(), up.sin()], -1)
    center = torch.as_tensor(target, dtype=torch.float64)
    cameras = look_at(center + radius[:, None] * direction, center, fov=fov, size=size, near=near)
    return cameras.to(torch.get_default_dtype())


def _focal_lengths(fov: Tensor, height: int, views: int) -> Tensor:
    if fov.shape not in ((), (1,), (views,)):
        raise ValueError(f"fov must have one value or one for each of {views} views, got shape {tuple(fov.shape)}")
    if not bool(((fov > 0) & (fov < 180)).all()):
        raise ValueError(f"fov must lie in (0, 180) degrees, got {fov.tolist()}")
    return (height / 2 / torch.tan(torch.deg2rad(fov) / 2)).expand(views)


def _intrinsics(fx: Tensor, fy: Tensor, cx: float | Tensor, cy: float | Tensor) -> Float[Tensor, "V 3 3"]:
    matrix = torch.eye(3, dtype=fx.dtype, device=fx.device).repeat(len(fx), 1, 1)
    matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 0, 2], matrix[:, 1, 2] = fx, fy, cx, cy
    return matrix


def load_transforms(path: str | Path) -> tuple[Cameras, list[Path]]:
    """Cameras and picture paths of a transforms.json (instant-ngp, nerfstudio, NeRF synthetic).

    Focal lengths come from `fl_x`, `fl_y` or `camera_angle_x`, in the frame or for all frames; a missing principal
    point is the centre of the image; a missing size is read from the first picture.

    Raises:
        FileNotFoundError: the file or the first picture is missing.
        ValueError: not such a file; a frame without a pose; views of different sizes; lens distortion, which has to be
            removed from the pictures first.
    """
    path = Path(path)
    data = _read_transforms(path)
    frames = data["frames"]
    pictures = [_picture(path, i, frame) for i, frame in enumerate(frames)]
    sizes = {_frame_size(path, {**data, **frame}, picture) for frame, picture in zip(frames, pictures, strict=True)}
    if len(sizes) != 1:
        raise ValueError(f"{path}: all views must have one size, got {sorted(sizes)} (height, width)")
    size = sizes.pop()
    poses = torch.stack([_pose(path, i, frame) for i, frame in enumerate(frames)])
    intrinsics = torch.stack([_frame_intrinsics(path, i, {**data, **f}, size) for i, f in enumerate(frames)])
    world_to_camera = torch.linalg.inv(poses @ _OPENGL_TO_OPENCV)
    try:
        return Cameras(world_to_camera.float(), intrinsics.float(), size), pictures
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _read_transforms(path: Path) -> dict[str, Any]:
    content = read_json(path)
    data: dict[str, Any] = content if isinstance(content, dict) else {}
    frames = data.get("frames")
    if not isinstance(frames, list) or not frames or not all(isinstance(f, dict) for f in frames):
        raise ValueError(f"{path}: expected an object with a non-empty list 'frames', as in a transforms.json")
    for key in ("k1", "k2", "k3", "k4", "p1", "p2"):
        if any(_number(path, {**data, **f}, key, 0.0) for f in frames):
            raise ValueError(f"{path}: the pictures have lens distortion ({key}); undistort them first")
    return data


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
    # NeRF synthetic leaves the suffix out.
    picture = path.parent / name
    return picture if picture.suffix else picture.with_suffix(".png")


def _frame_size(path: Path, values: dict[str, Any], picture: Path) -> tuple[int, int]:
    if "w" in values and "h" in values:
        height, width = _number(path, values, "h"), _number(path, values, "w")
        if not (height.is_integer() and width.is_integer()):
            raise ValueError(f"{path}: w and h must be whole numbers, got {width} and {height}")
        return int(height), int(width)
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(picture) as image:
            return image.height, image.width
    except UnidentifiedImageError as error:
        raise ValueError(f"{picture}: not a picture") from error


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


def _frame_intrinsics(path: Path, index: int, values: dict[str, Any], size: tuple[int, int]) -> Float[Tensor, "3 3"]:
    height, width = size
    if "fl_x" in values:
        fx = _number(path, values, "fl_x")
    elif "camera_angle_x" in values:
        angle = _number(path, values, "camera_angle_x")
        if not 0 < angle < math.pi:
            raise ValueError(f"{path}: camera_angle_x must lie in (0, pi), got {angle}")
        fx = width / 2 / math.tan(angle / 2)
    else:
        raise ValueError(f"{path}: frame {index} has neither fl_x nor camera_angle_x")
    fy = _number(path, values, "fl_y", fx)
    cx, cy = _number(path, values, "cx", width / 2), _number(path, values, "cy", height / 2)
    return torch.tensor([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], dtype=torch.float64)


def save_transforms(path: str | Path, cameras: Cameras, pictures: Sequence[str | Path]) -> None:
    """Writes a transforms.json for these cameras; picture paths are written as given.

    Raises:
        ValueError: not one picture a view.
    """
    if len(pictures) != len(cameras):
        raise ValueError(f"expected {len(cameras)} pictures, one a view, got {len(pictures)}")
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
