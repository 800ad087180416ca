"""The values of one frame of a transforms.json: picture, size, pose, focal lengths, lens (docs/reference/files.md)."""

import json
import math
import os
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import torch

from diff3ds._files import is_file
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import check_size
from diff3ds.distortion import Distortion
from diff3ds.formats.pixels import HEIC_READ
from diff3ds.formats.png import size_of

Values = dict[str, Any]

MAX_NUMBER = 1e100
# Written without a suffix, a picture is looked for with these: NeRF synthetic means .png, instant-ngp tries more.
SUFFIXES = tuple(
    s
    for suffix in (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff", ".gif", ".tga", *HEIC_READ)
    for s in (suffix, suffix.upper())
)
# Names of cameras, most of them nerfstudio's, whose lenses `Distortion` describes, and instant-ngp's flags of others.
CAMERA_MODELS = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV", "PERSPECTIVE")
FISHEYE_MODELS = ("OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE")
OTHER_LENSES = ("equirectangular", "latlong")
# nerfstudio's name of orthographic cameras. instant-ngp has a flag; to both a focal length is pixels a world unit then.
ORTHOGRAPHIC = "ORTHOPHOTO"
ANGLES = ("camera_angle_x", "camera_angle_y", "x_fov", "y_fov")
RADIAL, TANGENTIAL, DIVISOR, PRISM = ("k1", "k2", "k3", "k4"), ("p1", "p2"), ("k4", "k5", "k6"), ("sx1", "sy1")
# The first coefficient of instant-ngp's f-theta lenses.
FTHETA = "ftheta_p0"
ADVICE = "undistort the pictures first, for example with COLMAP's image_undistorter"
# How far the axes of a pose may be from those of a rotation times one number, and its last row from (0, 0, 0, 1): what
# is left of matrices that are written with two or three digits.
ROUNDING = 0.01


def number(path: Path, values: Values, key: str, default: float | None = None) -> float:
    """A finite number, which may be written as text, as nerfstudio reads it.

    Raises:
        ValueError: it is none.
    """
    given = value = values.get(key, default)
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            value = None
    # The bound keeps whole numbers of any length out of float(), and leaves room for squares.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < MAX_NUMBER:
        raise ValueError(f"{path}: {key} must be a finite number, got {given!r:.40}")
    return float(value)


def file_of(path: Path, name: str) -> Path:
    """A file that is named relative to the folder of the transforms.json, on Windows with backslashes."""
    file = path.parent / name
    return file if "\\" not in name or is_file(file) else path.parent / name.replace("\\", "/")


def picture_of(path: Path, index: int, frame: Values) -> Path:
    """The picture of a frame, whether it is there or not.

    Raises:
        ValueError: none is named.
    """
    name = frame.get("file_path")
    if not isinstance(name, str) or not name:
        raise ValueError(f"{path}: frame {index} has no file_path")
    return named_picture(path, name)


def named_picture(path: Path, name: str) -> Path:
    """The picture of this name, which may lack its suffix."""
    picture = file_of(path, name)
    if is_file(picture):
        return picture
    # Not with_suffix: what follows a dot in "frame.001" is no suffix.
    with_suffix = [picture.with_name(picture.name + suffix) for suffix in SUFFIXES]
    return next((p for p in with_suffix if is_file(p)), picture if picture.suffix else with_suffix[0])


def mask_file(path: Path, index: int, frame: Values) -> Path | None:
    """The mask of a frame.

    Raises:
        ValueError: its name is none.
    """
    mask = frame.get("mask_path")
    if mask is not None and not (isinstance(mask, str) and mask):
        raise ValueError(f"{path}: frame {index}: mask_path must be a file name, got {mask!r:.40}")
    return file_of(path, mask) if mask else None


def similar(file: Path) -> Path | None:
    """A file beside a missing one whose name differs in capitals or %20 only: other systems find it."""
    wanted = unquote(file.name).casefold()
    if not os.path.isdir(file.parent):
        return None
    return next((entry for entry in file.parent.iterdir() if unquote(entry.name).casefold() == wanted), None)


def frame_size(path: Path, values: Values, picture: Path) -> tuple[int, int]:
    """(height, width) in pixels, from the file or else from the picture.

    Raises:
        ValueError: no size, or no picture.
    """
    if "w" in values and "h" in values:
        height, width = number(path, values, "h"), number(path, values, "w")
        if not (height.is_integer() and width.is_integer()):
            raise ValueError(f"{path}: w and h must be whole numbers, got {width} and {height}")
        try:
            return check_size((int(height), int(width)))
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
    return size_of(picture)


def pose_of(path: Path, index: int, frame: Values, key: str = "transform_matrix") -> Float[Tensor, "4 4"]:
    """The camera-to-world matrix of a frame, float64, with the rotation that is nearest to its axes.

    Raises:
        ValueError: it is no rotation and translation; says what it is instead.
    """
    try:
        matrix = torch.from_numpy(np.array(frame[key], np.float64))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{path}: frame {index} has no {key} of 4x4 numbers") from error
    if matrix.shape == (3, 4):
        matrix = torch.cat([matrix, torch.eye(4, dtype=torch.float64)[3:]])
    if matrix.shape != (4, 4) or not bool(matrix.isfinite().all()):
        raise ValueError(f"{path}: frame {index}: {key} must hold 4x4 finite numbers")
    u, scales, vh = torch.linalg.svd(matrix[:3, :3])
    rotation = u @ vh
    fault = None
    if not bool((matrix[3] - torch.eye(4, dtype=torch.float64)[3]).abs().max() <= ROUNDING):
        transposed = bool((matrix[:3, 3] == 0).all()) and float(matrix[3, 3]) == 1
        fault = "its last row holds the translation: transpose it" if transposed else "its last row is not (0, 0, 0, 1)"
    elif not float(scales[0]) < MAX_NUMBER or not float(scales[2]) > 1 / MAX_NUMBER:
        fault = "its axes have no directions"
    elif not float(scales[0] - scales[2]) <= ROUNDING * float(scales[1]):
        fault = "its axes are not at right angles, or of different lengths"
    elif rotation.det() < 0:
        fault = "it is mirrored, as in a left-handed frame: negate one of its axes"
    if fault:
        raise ValueError(f"{path}: frame {index}: {key} is not a rotation and a translation: {fault}")
    matrix[:3, :3] = rotation
    matrix[3] = torch.eye(4, dtype=torch.float64)[3]
    return matrix


def orthographic_of(path: Path, index: int, data: Values, frame: Values) -> bool:
    """Whether a frame is orthographic: by camera_model, by the flag, or by both. A frame wins over the file.

    Raises:
        ValueError: the two contradict each other, or the flag is none.
    """
    for values in (frame, data):
        model, flag = values.get("camera_model"), values.get("orthographic")
        if flag is not None and not isinstance(flag, bool | int):
            raise ValueError(f"{path}: frame {index}: orthographic must be true or false, got {flag!r:.40}")
        named = isinstance(model, str) and model.upper() == ORTHOGRAPHIC
        if model is not None and flag is not None and named != bool(flag):
            raise ValueError(
                f"{path}: frame {index}: camera_model {model!r:.40} contradicts orthographic {json.dumps(bool(flag))}"
            )
        if model is not None or flag is not None:
            return named or bool(flag)
    return False


def intrinsics_of(
    path: Path, index: int, data: Values, frame: Values, size: tuple[int, int], orthographic: bool = False
) -> Float[Tensor, "3 3"]:
    """The intrinsics of a frame, float64, in pixels (a world unit). What a frame says in any form wins over the file.

    Raises:
        ValueError: no focal length, or one that cannot be.
    """
    height, width = size
    if orthographic:
        # A field of view says nothing of these; instant-ngp writes one all the same.
        data, frame = ({key: v for key, v in values.items() if key not in ANGLES} for values in (data, frame))
    fx = _focal_length(path, frame, "x", width) or _focal_length(path, data, "x", width)
    fy = _focal_length(path, frame, "y", height) or _focal_length(path, data, "y", height)
    if fx is None and fy is None:
        if orthographic:
            raise ValueError(
                f"{path}: frame {index} is orthographic, and has no fl_x, the pixels that a world unit takes"
            )
        raise ValueError(f"{path}: frame {index} has neither fl_x nor camera_angle_x")
    fx, fy = fx or fy, fy or fx
    values = {**data, **frame}
    cx, cy = number(path, values, "cx", width / 2), number(path, values, "cy", height / 2)
    return torch.tensor([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], dtype=torch.float64)


def _focal_length(path: Path, values: Values, axis: str, side: int) -> float | None:
    """Focal length in pixels along an axis, as a length or from the field of view; None if neither is there."""
    length = f"fl_{axis}"
    if length in values:
        focal = number(path, values, length)
        if focal <= 0:
            raise ValueError(f"{path}: focal lengths must be positive, got {length} = {focal}")
        return focal
    # Radians, and instant-ngp's other name, in degrees.
    for key, half_turn, name in ((f"camera_angle_{axis}", math.pi, "pi"), (f"{axis}_fov", 180.0, "180")):
        if key in values:
            field = number(path, values, key)
            if not 0 < field < half_turn:
                raise ValueError(f"{path}: {key} must lie in (0, {name}), got {field}")
            return side / 2 / math.tan(field / half_turn * math.pi / 2)
    return None


def distortion_of(path: Path, index: int, values: Values, orthographic: bool = False) -> Distortion:
    """The lens distortion of a frame.

    k4 is the coefficient of r^8, as nerfstudio has it; of FULL_OPENCV, k4 to k6 are those below the fraction's line.

    Raises:
        ValueError: another kind of lens, or distortion of an orthographic picture.
    """
    model = values.get("camera_model", CAMERA_MODELS[0])
    accepted = (*CAMERA_MODELS, *FISHEYE_MODELS, ORTHOGRAPHIC)
    if not isinstance(model, str) or model.upper() not in accepted:
        raise ValueError(
            f"{path}: frame {index}: camera_model {model!r:.40} is not one of {', '.join(accepted)}; {ADVICE}"
        )
    for key in OTHER_LENSES:
        if values.get(key):
            raise ValueError(f"{path}: frame {index}: pictures that are {key} are not supported; {ADVICE}")
    full, prism = model.upper() == "FULL_OPENCV", model.upper() == "THIN_PRISM_FISHEYE"
    for key in (FTHETA, *(() if full else DIVISOR[1:]), *(() if prism else PRISM)):
        if number(path, values, key, 0.0):
            raise ValueError(f"{path}: frame {index}: lens distortion {key} is not supported; {ADVICE}")
    found = Distortion(
        _coefficients(path, values, RADIAL[:3] if full else RADIAL),
        (number(path, values, "p1", 0.0), number(path, values, "p2", 0.0)),
        _coefficients(path, values, DIVISOR) if full else (),
        (number(path, values, "sx1", 0.0), number(path, values, "sy1", 0.0)),
        model.upper() in FISHEYE_MODELS or bool(values.get("is_fisheye")),
    )
    if orthographic and found:
        raise ValueError(f"{path}: frame {index}: lens distortion of orthographic pictures is not supported; {ADVICE}")
    return found


def _coefficients(path: Path, values: Values, keys: tuple[str, ...]) -> tuple[float, ...]:
    """Numbers of a series, without the zeros at its end."""
    found = [number(path, values, key, 0.0) for key in keys]
    while found and not found[-1]:
        found.pop()
    return tuple(found)
