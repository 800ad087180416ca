"""Exact projection of sketches: linear in homogeneous control points (docs/explanation/mathematics.md, eq. 1)."""

from dataclasses import dataclass, replace

import torch

from diff3ds._modes import can_look_at, is_ordinary
from diff3ds._shapes import Float, Int, Tensor
from diff3ds._with_torch import known_to_torch
from diff3ds.bezier.curves import elevate_homogeneous, homogeneous
from diff3ds.camera import DEFAULT_NEAR, Cameras
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch, WidthSpace


@known_to_torch
@dataclass(frozen=True, eq=False)
class Strokes2D:
    """N strokes of M segments in all, seen in V views: what `rasterize` draws.

    Attributes:
        cubics: homogeneous control points (X, Y, Z, W), float64. On screen the curve is (X / Z, Y / Z) in pixels from
            the top-left corner, its camera depth is Z / W in world units, and W / Z in orthographic views.
        half_width: pixels (`width_space="image"`), or pixels times depth ("world": the half width at a point is this
            over its depth). One row, shared by all views, or one a view. One value a stroke, or the four Bernstein
            coefficients of a cubic in the segment's parameter. Where there is `square`, of pixels there.
        color: straight RGB.
        opacity: in [0, 1].
        width_space: see half_width; orthographic views have none but "image".
        near: parts with depth <= near are not drawn.
        orthographic: whether the views are.
        chains: which segments make which stroke; None where each is one.
        square: float64 maps from pixels to planes where pixels are square, and strokes as wide in all directions: what
            is round in the world is an ellipse where fx and fy differ, or the intrinsics have a skew. No length shrinks
            in them. None where pixels are square, or widths are of the image.
    """

    cubics: Float[Tensor, "V M 4 4"]
    half_width: Float[Tensor, "U N"] | Float[Tensor, "U M 4"]
    color: Float[Tensor, "N 3"]
    opacity: Float[Tensor, " N"]
    width_space: WidthSpace = "image"
    near: float = DEFAULT_NEAR
    orthographic: bool = False
    chains: Chains | None = None
    square: Float[Tensor, "V 2 2"] | None = None

    def stroke_of(self, segment: Int[Tensor, " P"]) -> Int[Tensor, " P"]:
        """The strokes of segments."""
        return segment if self.chains is None else self.chains.stroke[segment]

    def detach(self) -> "Strokes2D":
        """The same strokes without their history, and without tangents of forward mode."""
        names = ("cubics", "half_width", "color", "opacity")
        square = None if self.square is None else self.square.detach()
        return replace(self, square=square, **{name: getattr(self, name).detach() for name in names})

    def on_square(self, view: Int[Tensor, " P"], values: Float[Tensor, "P *K C"]) -> Float[Tensor, "P *K C"]:
        """Places or homogeneous points, whose first two numbers are in pixels of views, where pixels are square."""
        if self.square is None:
            return values
        maps = self.square[view].reshape(len(view), *[1] * (values.ndim - 2), 2, 2)
        return torch.cat([(maps @ values[..., :2, None])[..., 0], values[..., 2:]], -1)

    @property
    def depth_ratio(self) -> tuple[int, int]:
        """The places in (X, Y, Z, W) of the two whose quotient is depth; the second is the weight of the curve."""
        return (3, 2) if self.orthographic else (2, 3)

    def depth(self, points: Float[Tensor, "*P 4"]) -> Float[Tensor, "*P"]:
        """Camera depth of homogeneous points, world units."""
        over, under = self.depth_ratio
        return points[..., over] / points[..., under]

    @property
    def margin(self) -> Float[Tensor, "V M 4"]:
        """Bernstein coefficients of what is positive where the depth is more than `near`."""
        over, under = self.depth_ratio
        return self.cubics[..., over] - self.near * self.cubics[..., under]


def project(sketch: Sketch, cameras: Cameras) -> Strokes2D:
    """The strokes as every camera sees them, raised to cubics; gradients flow to the sketch and to the cameras.

    The projection is computed in float64, whatever the dtype of the sketch: at 4096 pixels float32 would move strokes
    by 1e-3 px.

    Raises:
        ValueError: sketch and cameras are on different devices.
    """
    check_devices(sketch, cameras)
    control = elevate_homogeneous(homogeneous(sketch.points.double(), sketch.weights.double()))
    cubics = control @ cameras.projection[:, None].mT
    square = squares(sketch, cameras)
    appearance = half_widths(sketch, cameras, square is None), sketch.color, sketch.opacity
    space = width_space(sketch, cameras)
    return Strokes2D(cubics, *appearance, space, cameras.near, cameras.orthographic, sketch.chains, square)


def half_widths(sketch: Sketch, cameras: Cameras, square: bool) -> Float[Tensor, "U N"] | Float[Tensor, "U M 4"]:
    """`Strokes2D.half_width` of a sketch; square: whether pixels are, so that there is no `Strokes2D.square`."""
    width = sketch.width
    if width.ndim == 2:
        width = elevate_homogeneous(width[..., None])[..., 0]
    if sketch.width_space == "image":
        return (width * (cameras.size[0] / 2))[None]
    focal = cameras.intrinsics[:, 0, 0] if square else _longest(cameras)
    # Without perspective that is all.
    return focal.to(width.dtype).reshape(-1, *[1] * width.ndim) * width / 2


def squares(sketch: Sketch, cameras: Cameras) -> Float[Tensor, "V 2 2"] | None:
    """`Strokes2D.square` of a sketch; where values are not looked at also that of square pixels.

    Raises:
        ValueError: intrinsics that show a plane as a line, or mirrored.
    """
    if sketch.width_space == "image":
        return None
    if can_look_at(cameras.intrinsics) and is_ordinary(cameras.intrinsics):
        rows = cameras.intrinsics[:, :2, :2].tolist()
        for view, ((a, b), (c, d)) in enumerate(rows):
            if a * d <= b * c:
                raise ValueError(f"intrinsics of view {view} show a plane as a line, or mirrored: {rows[view]}")
        if all(a == d and b == c == 0 for (a, b), (c, d) in rows):
            return None
    lens = cameras.intrinsics[:, :2, :2].double()
    area = lens[:, 0, 0] * lens[:, 1, 1] - lens[:, 0, 1] * lens[:, 1, 0]
    adjugate = torch.stack([lens[:, 1, 1], -lens[:, 0, 1], -lens[:, 1, 0], lens[:, 0, 0]], -1).reshape(-1, 2, 2)
    return _longest(cameras)[:, None, None].double() * adjugate / area[:, None, None]


def _longest(cameras: Cameras) -> Float[Tensor, " V"]:
    """Pixels of a unit at depth 1 in the direction in which they are most; without gradient, since half widths and
    squares have it as a common factor that no picture knows of.
    """
    (a, b), (c, d) = cameras.intrinsics[:, :2, :2].detach().permute(1, 2, 0)
    return (torch.hypot(a + d, c - b) + torch.hypot(a - d, b + c)) / 2


def width_space(sketch: Sketch, cameras: Cameras) -> WidthSpace:
    """`Strokes2D.width_space` of a sketch: widths in world units are pixels where nothing shrinks with depth."""
    return "image" if cameras.orthographic else sketch.width_space


def check_devices(sketch: Sketch, cameras: Cameras) -> None:
    """Raises ValueError if sketch and cameras are on different devices."""
    if sketch.points.device != cameras.world_to_camera.device:
        got = f"{sketch.points.device} and {cameras.world_to_camera.device}"
        raise ValueError(f"sketch and cameras must be on one device, got {got}: use .to(device)")
