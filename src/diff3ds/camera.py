"""Pinhole and orthographic cameras, batched: orbits and look-at.

Conventions (docs/reference/conventions.md): world z up, OpenCV camera axes (x right, y down, z forward), pixels from
the top-left corner with centres at half integers, degrees at the surface.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import torch

from diff3ds._checks import as_numbers, check_finite
from diff3ds._modes import can_look_at, check_plain, is_ordinary
from diff3ds._settings import MAX_SIZE
from diff3ds._shapes import Float, Int, Tensor
from diff3ds._with_torch import known_to_torch

Angle = float | Sequence[float] | Tensor
Size = int | tuple[int, int]
# An attribute of cameras, what may be wrong with it, which views are good, and the values of all.
Fault = tuple[str, str, Tensor, Tensor]

DEFAULT_NEAR = 0.01
# How far the product of a rotation with its transpose, and the last rows, may be from what they should be: rounding,
# and in dtypes of few bits some steps of theirs.
RIGID, STEPS = 1e-3, 8
# Degrees from the horizon; beyond, z is nearly the view's axis, and an orbit's meridian says what is up.
STEEP = 89.9
# Vertical field of view in degrees of cameras that are given none.
DEFAULT_FOV = 60.0
# What to do with views that differ in what all of a `Cameras` share.
APART = (
    "Make a Cameras of each kind and draw them one after the other, or all at once by "
    "render_batch([sketch] * n, [cameras, ...])"
)


@known_to_torch
@dataclass(frozen=True, eq=False)
class Cameras:
    """V pinhole cameras, or V orthographic ones, that make images of one size.

    Attributes:
        world_to_camera: rigid transforms (a rotation, which mirrors nothing, and a translation), bottom row
            (0, 0, 0, 1).
        intrinsics: in pixels, or of orthographic cameras in pixels a world unit; bottom row (0, 0, 1).
        size: (height, width) of the images in pixels.
        near: depth in world units; what is closer, or behind, is not drawn.
        orthographic: whether all of them are: without perspective, nothing shrinks with its depth.

    Raises:
        TypeError, ValueError: an attribute of the wrong type, shape, dtype or device, a value that is not finite, a
            matrix that is not rigid, a focal length that is not positive; the message names the attribute, the view
            and the value.
    """

    world_to_camera: Float[Tensor, "V 4 4"]
    intrinsics: Float[Tensor, "V 3 3"]
    size: tuple[int, int]
    near: float = DEFAULT_NEAR
    orthographic: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", check_size(self.size))
        if not isinstance(self.orthographic, bool):
            got = type(self.orthographic).__name__
            raise TypeError(f"orthographic must be True or False, for all views of Cameras, got {got}")
        for name, side in (("world_to_camera", 4), ("intrinsics", 3)):
            value = getattr(self, name)
            if not isinstance(value, Tensor) or not value.is_floating_point():
                raise TypeError(f"{name} must be a floating point tensor, got {type(value).__name__}")
            if value.ndim != 3 or value.shape[1:] != (side, side):
                raise ValueError(f"{name} must have shape (V, {side}, {side}), got {tuple(value.shape)}")
        check_plain(world_to_camera=self.world_to_camera, intrinsics=self.intrinsics)
        if len(self.world_to_camera) != len(self.intrinsics):
            got = f"{len(self.world_to_camera)} and {len(self.intrinsics)}"
            raise ValueError(f"world_to_camera and intrinsics must have one matrix a view, got {got}")
        if self.world_to_camera.device != self.intrinsics.device:
            got = f"{self.world_to_camera.device} and {self.intrinsics.device}"
            raise ValueError(f"world_to_camera and intrinsics must be on one device, got {got}")
        if not (isinstance(self.near, int | float) and 0 < self.near < math.inf):
            raise ValueError(f"near must be a positive number, got {self.near}")
        # Where values are not looked at, `render` refuses strokes that bad cameras spoil.
        if can_look_at(self.intrinsics):
            self._check_values()

    def _check_values(self) -> None:
        pose, lens = self.world_to_camera.detach(), self.intrinsics.detach()
        for name, value in (("world_to_camera", pose), ("intrinsics", lens)):
            finite = value.isfinite().flatten(1)
            if not bool(finite.all()):
                view, place = (~finite).nonzero()[0].tolist()
                got = value.flatten(1)[view, place].item()
                raise ValueError(f"{name} of view {view} has a value that is not finite, {got}")
        for name, fault, good, value in (*_pose_faults(pose), *_lens_faults(lens)):
            if not bool(good.all()):
                view = int(good.int().argmin())
                raise ValueError(f"{name} of view {view} {fault} {_rounded(value[view].tolist())}")

    def __len__(self) -> int:
        return self.world_to_camera.shape[0]  # much faster than torch's len

    def __getitem__(self, index: int | slice | list[int] | Tensor) -> "Cameras":
        """Some of the views; an int gives a batch of one."""
        rows = [index] if isinstance(index, int) else index
        return replace(self, world_to_camera=self.world_to_camera[rows], intrinsics=self.intrinsics[rows])

    @staticmethod
    def concatenate(cameras: "Sequence[Cameras]") -> "Cameras":
        """One batch of all views.

        Raises:
            ValueError: none, or cameras that differ in the size of their images, the near plane or the kind.
        """
        if not cameras:
            raise ValueError("expected at least one Cameras, got none")
        first = cameras[0]
        for name in ("size", "near", "orthographic"):
            values = list(dict.fromkeys(getattr(views, name) for views in cameras))
            if len(values) > 1:
                raise ValueError(f"views of one Cameras have one {name}, got {' and '.join(map(str, values))}. {APART}")
        parts = [(views.world_to_camera, views.intrinsics) for views in cameras]
        poses, intrinsics = (torch.cat(part) for part in zip(*parts, strict=True))
        return replace(first, world_to_camera=poses, intrinsics=intrinsics)

    @property
    def centers(self) -> Float[Tensor, "V 3"]:
        """Positions of the cameras in the world: points of depth 0 on their axes."""
        rotation, translation = self.world_to_camera[:, :3, :3], self.world_to_camera[:, :3, 3:]
        return -(rotation.mT @ translation)[..., 0]

    def rays(self, pixels: Float[Tensor, "V 2"]) -> tuple[Float[Tensor, "V 3"], Float[Tensor, "V 3"]]:
        """Where the ray that one pixel of each view looks along begins, at depth 0, and its unit direction; float64."""
        to_world, origins = self.world_to_camera[:, :3, :3].double().mT, self.centers.double()
        places = torch.cat([pixels.double(), torch.ones_like(pixels[:, :1], dtype=torch.float64)], 1)
        seen = torch.linalg.solve(self.intrinsics.double(), places)[..., None]
        if not self.orthographic:
            return origins, torch.nn.functional.normalize((to_world @ seen)[..., 0], dim=-1)
        aside = seen * seen.new_tensor([1.0, 1.0, 0.0])[:, None]
        return origins + (to_world @ aside)[..., 0], torch.nn.functional.normalize(to_world[..., 2], dim=-1)

    def seen(self, projected: Float[Tensor, "*P 4"]) -> tuple[Float[Tensor, "*P 2"], Float[Tensor, "*P"]]:
        """Pixels and depths of points of weight 1 that `projection` made (X, Y, Z, W).

        Only those of points in front of the near plane mean something.
        """
        if self.orthographic:
            return projected[..., :2], projected[..., 3]
        depth = projected[..., 2]
        return projected[..., :2] / depth.clamp(min=self.near)[..., None], depth

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

        The pixel is (X / Z, Y / Z), the depth Z / W; without perspective Z is w, and the depth W / Z.
        """
        pose, lens = self.world_to_camera, self.intrinsics
        # Kept on a GPU it would be that of one stream, or of a graph that was captured: others may read it before it
        # is computed.
        if pose.device.type != "cpu" or not (is_ordinary(pose) and is_ordinary(lens)):
            return self._projection()
        # Frozen is the reference to a tensor, not what it holds.
        state = (pose.data_ptr(), pose._version, lens.data_ptr(), lens._version)
        kept = self.__dict__.get("_kept_projection")
        if kept is None or kept[0] != state:
            made = self._projection()
            if not is_ordinary(made):
                return made
            kept = self.__dict__["_kept_projection"] = (state, made)
        return cast(Tensor, kept[1])

    def _projection(self) -> Float[Tensor, "V 4 4"]:
        to_camera, intrinsics = self.world_to_camera.double(), self.intrinsics.double()
        if self.orthographic:
            # Weight and depth trade places: pixels are divided by the former now.
            to_camera = to_camera[:, [0, 1, 3, 2]]
        return torch.cat([intrinsics @ to_camera[:, :3], to_camera[:, 3:]], 1)


def check_size(size: Size) -> tuple[int, int]:
    """(height, width) from one number or a pair.

    Raises:
        ValueError: not one or two positive integers of at most 65,536.
    """
    pair = tuple(size) if isinstance(size, tuple | list) else (size, size)
    if isinstance(size, Tensor) or any(isinstance(n, tuple | list | Tensor) for n in pair):
        raise ValueError(f"size must be one for all views, an int or (height, width), got one a view? {APART}")
    if len(pair) != 2 or not all(isinstance(n, int) and 0 < n <= MAX_SIZE for n in pair):
        raise ValueError(f"size must be a positive int or (height, width) up to {MAX_SIZE}, got {size}")
    return pair


def look_at(
    eye: Float[Tensor, "V 3"],
    target: Sequence[float] | Float[Tensor, " 3"] | Float[Tensor, "V 3"] = (0.0, 0.0, 0.0),
    *,
    fov: Angle | None = None,
    height: Angle | None = None,
    size: Size = 512,
    up: Sequence[float] | Float[Tensor, " 3"] | Float[Tensor, "V 3"] = (0.0, 0.0, 1.0),
    near: float = DEFAULT_NEAR,
) -> Cameras:
    """Cameras at `eye` that look at `target`; `up` points upwards in the images.

    Args:
        fov: vertical field of view in degrees, one for all or one a view; 60 unless a height is given.
        height: of what orthographic cameras show, in world units from the lower edge of the images to the upper one;
            one for all or one a view. Instead of a field of view.
        size: image size in pixels, an int or (height, width).

    Raises:
        TypeError, ValueError: what is no numbers, wrong shapes, values that are not finite, an eye on its target, a
            view along `up`, a field of view outside (0, 180), a height that is not positive, or both.
    """
    rows, columns = check_size(size)
    eye = as_numbers("eye", eye)
    eye = eye if eye.is_floating_point() else eye.to(torch.get_default_dtype())
    if eye.ndim != 2 or eye.shape[1] != 3:
        raise ValueError(f"eye must have shape (V, 3), got {tuple(eye.shape)}")
    center, upwards = _place("target", target, eye), _place("up", up, eye)
    focal = _pixels_a_unit(fov, height, rows, eye)
    forward = center - eye
    right = torch.linalg.cross(forward, upwards.expand_as(forward))
    lengths = torch.linalg.vector_norm(torch.stack([forward, right]), dim=-1)
    sideways = lengths[1] > 1e-6 * lengths[0]
    if not bool(sideways.all()):
        view = int(sideways.int().argmin())
        high = upwards.expand_as(forward)[view].tolist()
        raise ValueError(
            f"eye of view {view} must be finite, apart from its target and not above or below it (up is {high}), "
            f"got {eye[view].tolist()}"
        )
    forward, right = forward / lengths[0, :, None], right / lengths[1, :, None]
    rotation = torch.stack([right, torch.linalg.cross(forward, right), forward], 1)
    top = torch.cat([rotation, -(rotation @ eye[..., None])], -1)
    bottom = eye.new_tensor([0.0, 0.0, 0.0, 1.0]).expand(len(eye), 1, 4)
    intrinsics = _intrinsics(focal, focal, columns / 2, rows / 2)
    return Cameras(torch.cat([top, bottom], 1), intrinsics, (rows, columns), near, height is not None)


def orbit(
    azimuth: Angle,
    elevation: Angle = 0.0,
    distance: Angle = 2.0,
    *,
    fov: Angle | None = None,
    height: Angle | None = None,
    size: Size = 512,
    target: Sequence[float] = (0.0, 0.0, 0.0),
    near: float = DEFAULT_NEAR,
) -> Cameras:
    """Cameras on a sphere that look at its centre, z up.

    Plan views, from straight above or below, are upright as their neighbours of the same azimuth are: from above,
    azimuth -90 has x to the right and y up.

    Args:
        azimuth: degrees, 0 on +x, counter-clockwise seen from +z; a number or one a view, as are the next four.
        elevation: degrees above the horizon, in [-90, 90].
        distance: from the target, world units.
        fov: vertical field of view in degrees; 60 unless a height is given.
        height: of what orthographic cameras show, world units, as `look_at` has it.
        size: image size in pixels, an int or (height, width).

    Raises:
        TypeError, ValueError: what is no numbers, values out of range, lists of different lengths, or a target without
            three coordinates.
    """
    given = {"azimuth": azimuth, "elevation": elevation, "distance": distance}
    values = [as_numbers(name, value, torch.get_default_dtype()).reshape(-1) for name, value in given.items()]
    lengths = sorted({len(v) for v in values} - {1})
    if len(lengths) > 1:
        raise ValueError(f"azimuth, elevation and distance must have one value or one a view, got {lengths} values")
    around, up, radius = torch.broadcast_tensors(*values)  # type: ignore[no-untyped-call]
    if not bool((around.isfinite() & (up.abs() <= 90) & (radius > 0) & radius.isfinite()).all()):
        raise ValueError(
            "azimuth must be finite, elevation in [-90, 90] degrees and distance positive, "
            f"got {azimuth}, {elevation} and {distance}"
        )
    steep = up.abs() > STEEP
    around, up = torch.deg2rad(around.double()), torch.deg2rad(up.double())
    direction = torch.stack([up.cos() * around.cos(), up.cos() * around.sin(), up.sin()], -1)
    # Along the meridian: the part of z across the view, but well defined on the poles too.
    north = torch.stack([-up.sin() * around.cos(), -up.sin() * around.sin(), up.cos()], -1)
    upwards = torch.where(steep[:, None], north, north.new_tensor([0.0, 0.0, 1.0]))
    center = as_numbers("target", target, torch.float64)
    if center.shape != (3,):
        raise ValueError(f"target must have 3 coordinates, got shape {tuple(center.shape)}")
    eye = center + radius[:, None] * direction
    cameras = look_at(eye, center, fov=fov, height=height, size=size, up=upwards, near=near)
    return cameras.to(torch.get_default_dtype())


def sheet(width: int, height: int) -> Cameras:
    """One view of a sheet of paper, on which a world unit is a pixel: x to the right, y down, strokes at z = 0.

    Strokes at one depth lie over those before them, so that the order of a flat sketch is the order of painting.

    Args:
        width: pixels.
        height: see there.

    Raises:
        ValueError: sizes that are no positive whole numbers, or too large.
    """
    pose = torch.eye(4)
    pose[2, 3] = 1.0  # the camera stands one unit before the sheet
    return Cameras(pose[None], torch.eye(3)[None], check_size((height, width)), orthographic=True)


def evenly_spaced(count: int, wanted: int) -> Int[Tensor, " M"]:
    """Picks up to `wanted` of `count` views, evenly spaced: their indices."""
    return torch.arange(min(count, wanted)) * count // min(count, wanted)


def _place(name: str, value: object, eye: Float[Tensor, "V 3"]) -> Tensor:
    """A place or direction in the world, one for all eyes or one for each."""
    value = as_numbers(name, value, eye.dtype, eye.device)
    if value.shape not in ((3,), eye.shape):
        raise ValueError(f"{name} must have shape (3,) or {tuple(eye.shape)}, got {tuple(value.shape)}")
    check_finite(**{name: value})
    return value


def _pixels_a_unit(
    fov: Angle | None, height: Angle | None, rows: int, eye: Float[Tensor, "V 3"]
) -> Float[Tensor, " V"]:
    """Pixels of a world unit at depth 1, or with a height at any depth."""
    if fov is not None and height is not None:
        raise ValueError(
            "fov is of cameras with perspective, height of orthographic ones: give one of them, "
            f"got fov={fov} and height={height}"
        )
    name, given = ("fov", DEFAULT_FOV if fov is None else fov) if height is None else ("height", height)
    value, views = as_numbers(name, given, eye.dtype, eye.device), len(eye)
    if value.shape not in ((), (1,), (views,)):
        raise ValueError(f"{name} must have one value or one for each of {views} views, got shape {tuple(value.shape)}")
    if name == "height":
        if not bool(((value > 0) & value.isfinite()).all()):
            raise ValueError(f"height must be positive and finite, in world units, got {value.tolist()}")
        return (rows / value).expand(views)
    if not bool(((value > 0) & (value < 180)).all()):
        raise ValueError(f"fov must lie in (0, 180) degrees, got {value.tolist()}")
    return (rows / 2 / torch.tan(torch.deg2rad(value) / 2)).expand(views)


def _pose_faults(pose: Float[Tensor, "V 4 4"]) -> Iterator[Fault]:
    tolerance, pose = _tolerance(pose.dtype), pose.double()
    axes, one = pose[:, :3, :3], torch.eye(4, dtype=torch.float64)
    last = (pose[:, 3] - one[3]).abs().amax(1) <= tolerance
    yield "world_to_camera", "has a last row that is not (0, 0, 0, 1), but", last, pose[:, 3]
    square = (axes @ axes.mT - one[:3, :3]).abs().amax((1, 2)) <= tolerance
    fault = "is no rotation and translation: its axes are not of length 1 at right angles, but"
    yield "world_to_camera", fault, square, axes
    yield "world_to_camera", "is mirrored: its rotation has determinant -1, axes", axes.det() > 0, axes


def _lens_faults(lens: Float[Tensor, "V 3 3"]) -> Iterator[Fault]:
    last = (lens[:, 2] - lens.new_tensor([0.0, 0.0, 1.0])).abs().amax(1) <= _tolerance(lens.dtype)
    yield "intrinsics", "has a last row that is not (0, 0, 1), but", last, lens[:, 2]
    focal = lens[:, [0, 1], [0, 1]]
    yield "intrinsics", "has focal lengths that are not positive:", (focal > 0).all(1), focal


def _tolerance(dtype: torch.dtype) -> float:
    return max(RIGID, STEPS * torch.finfo(dtype).eps)


def _rounded(value: Any) -> Any:
    """Numbers of an error, rounded for the eye."""
    return [_rounded(v) for v in value] if isinstance(value, list) else float(f"{value:.4g}")


def _intrinsics(fx: Tensor, fy: Tensor, cx: float | Tensor, cy: float | Tensor) -> Float[Tensor, "V 3 3"]:
    matrix = torch.eye(3, dtype=fx.dtype, device=fx.device).repeat(len(fx), 1, 1)
    matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 0, 2], matrix[:, 1, 2] = fx, fy, cx, cy
    return matrix
