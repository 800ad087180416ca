"""What compiled kernels are given: curves, in space or projected, their appearance, and options."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

import torch

from diff3ds._modes import is_ordinary, transformed
from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.project import Strokes2D, half_widths, squares, width_space
from diff3ds.render.antialiasing import Analytic, MonteCarlo
from diff3ds.sketch import Sketch

Images = tuple[Float[Tensor, "V H W 3"], Float[Tensor, "V H W"], Float[Tensor, "V H W"]]
# Homogeneous cubics in pixels, or what gives them: control points, weights, and the projections of the views.
Curves = tuple[Tensor] | tuple[Tensor, Tensor, Tensor]
# Poses (V, 4, 4) and intrinsics (V, 3, 3), both in float32 or in float64, of cameras without gradients.
PlainCameras = tuple[Tensor, Tensor]
# Half widths in pixels, a row for all views or one a view (`Strokes2D.half_width`), or with one axis the full widths of
# a sketch's strokes, in units of which `Options.width_scale` speaks; colours; opacities; the background, whose first
# three axes may be 1; `Strokes2D.square`, empty where there is none.
Appearance = tuple[Tensor, Tensor, Tensor, Tensor, Tensor]


class Options(NamedTuple):
    """What the kernels need besides tensors: field by field `Options` of csrc/cpu/driver.h, and part of CUDA's `Job`.

    Attributes:
        world, orthographic, near: as of `Strokes2D`.
        blur: standard deviation of the filter, pixels.
        strata: samples per pixel and direction, 0 for analytic antialiasing.
        seed: of the samples.
        width_scale: half widths in pixels of a full width of 1, where full widths are given; else 1.
        differ_squares: whether the gradient of `Strokes2D.square` is wanted.
    """

    world: bool
    orthographic: bool
    near: float
    blur: float
    strata: int
    seed: int
    width_scale: float
    differ_squares: bool = False


@dataclass(frozen=True, eq=False)
class Batch:
    """Which views, strokes and segments belong to which of B sketches, as `Layout` of csrc/common/layout.h wants it.

    Attributes:
        table: of each sketch its first view, stroke, segment, row of strokes and row of segments, and then the number
            of all. A row is a pair of a view and of a stroke, or segment, that it sees.
    """

    table: Int[Tensor, "5 F"]

    @staticmethod
    def of(sketches: Sequence[Sketch], cameras: Sequence[Cameras]) -> "Batch":
        """That of sketches, each seen by its own cameras."""
        views, strokes, segments = map(len, cameras), map(len, sketches), (len(s.points) for s in sketches)
        counts = [(v, n, m, v * n, v * m) for v, n, m in zip(views, strokes, segments, strict=True)]
        return Batch(
            torch.tensor([[0, *accumulate(column)] for column in zip(*counts, strict=True)], dtype=torch.int32)
        )

    @property
    def rows(self) -> tuple[int, int]:
        """How many rows of strokes and of segments there are."""
        return int(self.table[3, -1]), int(self.table[4, -1])


class KernelInputs(NamedTuple):
    """One call of the kernels; `size` is (height, width), `chains` as of `Strokes2D`, `batch` None for one sketch.

    Where there are `cameras`, the projections of `curves` are room for what the kernels make of them.
    The tensors of a batch are those of its sketches one after the other; half widths that differ between views stand in
    one row, (1, rows) or (1, rows, 4).
    """

    curves: Curves
    cameras: PlainCameras | None
    chains: Chains | None
    batch: Batch | None
    appearance: Appearance
    size: tuple[int, int]
    options: Options

    def tensors(self) -> tuple[Tensor, ...]:
        """The appearance, and then the curves."""
        return (*self.appearance, *self.curves)


def of_sketch(
    sketch: Sketch,
    cameras: Cameras,
    background: Float[Tensor, "V1 H1 W1 3"],
    antialiasing: Analytic | MonteCarlo,
    backend: str = "",
) -> KernelInputs:
    """Those of a sketch, projected by the kernels: a tenth faster than before them where images are tiny.

    Those of the backend "cuda" make the cameras' matrices as well, if nothing wants gradients of those.
    """
    square = squares(sketch, cameras)
    widths, scale = sketch.width, cameras.size[0] / 2
    if not is_plain(sketch):
        widths, scale = half_widths(sketch, cameras, square is None), 1.0
    appearance = (widths, sketch.color, sketch.opacity, background, _given(square, background))
    world = width_space(sketch, cameras) == "world"
    options = _options(antialiasing, (world, cameras.orthographic, cameras.near), scale, square)
    matrices, of_kernels = _projections([cameras], backend)
    curves = (sketch.points, sketch.weights, matrices)
    return KernelInputs(curves, of_kernels, sketch.chains, None, appearance, cameras.size, options)


def of_sketches(
    sketches: Sequence[Sketch],
    cameras: Sequence[Cameras],
    background: Float[Tensor, "V1 H1 W1 3"],
    antialiasing: Analytic,
    backend: str = "",
) -> KernelInputs:
    """Those of sketches of one kind (`kind`), each seen by its own cameras, of which there is one at least."""
    first, seen = sketches[0], cameras[0]
    found = [squares(s, c) for s, c in zip(sketches, cameras, strict=True)]
    if is_plain(first):
        widths, scale = torch.cat([s.width for s in sketches]), seen.size[0] / 2
    else:
        given = zip(sketches, cameras, found, strict=True)
        rows = [half_widths(s, c, square is None).flatten(0, 1) for s, c, square in given]
        widths, scale = torch.cat(rows)[None], 1.0
    color, opacity = (torch.cat([getattr(s, name) for s in sketches]) for name in ("color", "opacity"))
    chains = None
    if any(s.chains is not None for s in sketches):
        device = first.points.device
        chains = Chains.concatenate([s.chains or Chains.plain(len(s), device) for s in sketches])
    points, weights = (torch.cat([getattr(s, name) for s in sketches]) for name in ("points", "weights"))
    matrices, of_kernels = _projections(cameras, backend)
    curves = (points, weights, matrices)
    square = _joined_squares(found, cameras)
    world = width_space(first, seen) == "world"
    options = _options(antialiasing, (world, seen.orthographic, seen.near), scale, square)
    appearance = (widths, color, opacity, background, _given(square, background))
    batch = Batch.of(sketches, cameras)
    return KernelInputs(curves, of_kernels, chains, batch, appearance, seen.size, options)


def kind(sketch: Sketch, cameras: Cameras) -> tuple[object, ...]:
    """What must agree in sketches and cameras that are drawn in one call."""
    space = "image" if is_plain(sketch) else f"{sketch.width_space} seen as {width_space(sketch, cameras)}"
    axes = sketch.points.shape[1], sketch.width.ndim, space
    return *axes, sketch.points.dtype, sketch.points.device, cameras.size, cameras.orthographic, cameras.near


def is_plain(sketch: Sketch) -> bool:
    """Whether strokes have one width each, in units of the image: then the kernels scale it."""
    return sketch.width.ndim == 1 and sketch.width_space == "image"


def of_strokes(
    strokes: Strokes2D,
    size: tuple[int, int],
    background: Float[Tensor, "V1 H1 W1 3"],
    antialiasing: Analytic | MonteCarlo,
) -> KernelInputs:
    """Those of strokes that are projected already."""
    square = _given(strokes.square, background)
    appearance = (strokes.half_width, strokes.color, strokes.opacity, background, square)
    how = strokes.width_space == "world", strokes.orthographic, strokes.near
    options = _options(antialiasing, how, 1.0, strokes.square)
    return KernelInputs((strokes.cubics,), None, strokes.chains, None, appearance, size, options)


def _projections(cameras: Sequence[Cameras], backend: str) -> tuple[Tensor, PlainCameras | None]:
    """The projections of all views, or room for them and the cameras that kernels make them of."""
    if backend != "cuda":
        return _joined([c.projection for c in cameras]), None
    given = [t for c in cameras for t in (c.world_to_camera, c.intrinsics)]
    dtype = given[0].dtype
    # On a GPU the five operations of torch that it takes last longer than many a drawing.
    if dtype not in (torch.float32, torch.float64) or not all(t.dtype == dtype and is_ordinary(t) for t in given):
        return _joined([c.projection for c in cameras]), None
    poses, intrinsics = _joined(given[::2]).contiguous(), _joined(given[1::2]).contiguous()
    return poses.new_empty(poses.shape, dtype=torch.float64), (poses, intrinsics)


def _joined(parts: Sequence[Tensor]) -> Tensor:
    return parts[0] if len(parts) == 1 else torch.cat(list(parts))


def _given(square: Tensor | None, like: Tensor) -> Tensor:
    return like.new_empty(0, dtype=torch.float64) if square is None else square


def _joined_squares(found: Sequence[Tensor | None], cameras: Sequence[Cameras]) -> Tensor | None:
    """Of all views; where some need none those of square pixels."""
    if all(square is None for square in found):
        return None
    one = torch.eye(2, dtype=torch.float64, device=cameras[0].intrinsics.device)
    return torch.cat([one.expand(len(c), 2, 2) if s is None else s for s, c in zip(found, cameras, strict=True)])


def _options(
    antialiasing: Analytic | MonteCarlo, how: tuple[bool, bool, float], width_scale: float, square: Tensor | None
) -> Options:
    # Below transforms, and in forward mode, derivatives do not tell of themselves.
    differ = square is not None and (transformed() or square.requires_grad)
    if isinstance(antialiasing, Analytic):
        return Options(*how, antialiasing.blur, 0, 0, width_scale, differ)
    strata, seed = math.isqrt(antialiasing.samples), antialiasing.seed()
    return Options(*how, 0.0, strata, seed, width_scale, differ)
