"""What a program says of one picture, before the picture is looked for on this disk; and the numbers of its camera."""

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import check_size
from diff3ds.distortion import NO_DISTORTION, Distortion
from diff3ds.frames import Values, pose_of
from diff3ds.transforms import NAMED

# Numbers beyond are taken for damage: squares of them are finite still.
LARGEST = 1e100
# Coefficients of wide fisheye lenses are a few units.
LARGEST_COEFFICIENT = 1e6


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture with its camera, as a program has written them.

    Attributes:
        name: of the picture's file, as written; perhaps a path of another machine.
        size: (height, width) in pixels; None is that of the picture.
        world_to_camera: float64, OpenCV axes.
        intrinsics: float64, pixels.
        distortion: of the lens.
        centered: whether the principal point is the middle of the picture, whatever the intrinsics say.
    """

    name: str
    size: tuple[int, int] | None
    world_to_camera: Float[Tensor, "4 4"]
    intrinsics: Float[Tensor, "3 3"]
    distortion: Distortion = NO_DISTORTION
    centered: bool = False


@contextmanager
def damaged(path: Path, what: str) -> Iterator[None]:
    """Has what fails while the values of a file are taken say which file it is.

    Args:
        path: the file.
        what: it should be: "Meshroom's: expected views and poses".

    Raises:
        ValueError: in place of what broken values raise; errors that name the file stay as they are.
    """
    try:
        yield
    except (AttributeError, IndexError, KeyError, OverflowError, RuntimeError, TypeError, ValueError) as error:
        if isinstance(error, ValueError) and str(path) in str(error):
            raise
        raise ValueError(f"{path}: damaged, or not {what} ({error!r:.80})") from error


def warn_left_out(path: Path, names: Sequence[str], total: int, why: str) -> None:
    """Warns of pictures of a project that are left out, if there are any."""
    if names:
        some = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
        warnings.warn(f"{path}: {len(names)} of {total} pictures are left out, {why}: {some}", stacklevel=4)


def pinhole(where: str, fx: float, fy: float, cx: float, cy: float, skew: float = 0.0) -> Float[Tensor, "3 3"]:
    """Intrinsics.

    Args:
        where: for the error.
        fx: focal length, pixels.
        fy: the same down the picture.
        cx: principal point.
        cy: the same down the picture.
        skew: the first row's second number.

    Raises:
        ValueError: a number that is not finite, or no positive focal length.
    """
    numbers = (fx, fy, cx, cy, skew)
    if not all(abs(n) < LARGEST for n in numbers) or not min(fx, fy) > 0:
        raise ValueError(f"{where}: focal lengths must be positive and all numbers finite, got {list(numbers)}")
    return torch.tensor([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], dtype=torch.float64)


def finite_points(found: Float[Tensor, "N 3"] | Sequence[Sequence[float]]) -> Float[Tensor, "P 3"]:
    """Those of some places that are finite, float64: one that is damaged must not make the bounds of all infinite.

    Args:
        found: as a program has written them; may be empty.

    Raises:
        ValueError: places that are not of three numbers.
    """
    points = torch.as_tensor(found, dtype=torch.float64)
    points = points.reshape(-1, 3) if not len(points) else points
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"places must be of three numbers, got {tuple(points.shape)}")
    return points[(points.abs() < LARGEST).all(1)]


def checked(where: str, lens: Distortion) -> Distortion:
    """The lens.

    Raises:
        ValueError: a coefficient that is not finite, or far from any lens's.
    """
    numbers = (*lens.radial, *lens.tangential, *lens.divisor, *lens.prism)
    if not all(abs(n) < LARGEST_COEFFICIENT for n in numbers):
        raise ValueError(f"{where}: lens distortion must be finite, got {list(numbers)}")
    return lens


def picture_size(where: str, width: object, height: object) -> tuple[int, int]:
    """(height, width).

    Raises:
        ValueError: they are no sizes.
    """
    try:
        return check_size((int(str(height)), int(str(width))))
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error


def quaternion_pose(where: str, quaternion: Sequence[float], translation: Sequence[float]) -> Float[Tensor, "4 4"]:
    """The rigid transform of a rotation (w, x, y, z) of any length, and a translation.

    Raises:
        ValueError: a number that is not finite, or four zeros.
    """
    length = math.hypot(*quaternion)
    if not all(abs(n) < LARGEST for n in (*quaternion, *translation)) or not length > 0:
        raise ValueError(f"{where}: no rotation and translation: {[*quaternion, *translation]}")
    w, x, y, z = (n / length for n in quaternion)
    return torch.tensor(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), translation[0]],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), translation[1]],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), translation[2]],
            [0.0, 0.0, 0.0, 1.0],
        ],
        dtype=torch.float64,
    )


def rigid(path: Path, index: int, matrix: object, key: str) -> Float[Tensor, "4 4"]:
    """A rotation and translation from nested lists, checked as those of a transforms.json are.

    Args:
        path: for the error.
        index: of the picture, for the error.
        matrix: 4x4 or its upper 3x4.
        key: what the file calls it.

    Raises:
        ValueError: it is none; says what it is instead.
    """
    frame: Values = {} if matrix is None else {key: matrix}
    return pose_of(path, index, frame, key)


def inverse(pose: Float[Tensor, "4 4"]) -> Float[Tensor, "4 4"]:
    """Of a rotation and translation."""
    turned = pose[:3, :3].mT
    found = torch.eye(4, dtype=torch.float64)
    found[:3, :3], found[:3, 3] = turned, -turned @ pose[:3, 3]
    return found
