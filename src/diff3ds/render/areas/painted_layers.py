"""What is painted on a sheet: filled and stroked contours in layers, from the bottom to the top."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Int, Tensor

# Rules of a layer: what of its contours is painted.
NONZERO, EVEN_ODD, STROKE = 0, 1, 2
# Kinds of paint.
PLAIN, LINEAR, RADIAL = 0, 1, 2
# Pixels. No drawing reaches so far, and kernels count rows in 32 bits.
MAX_COORDINATE = 1e9


@dataclass(frozen=True)
class Layers:
    """Filled and stroked contours as tables, each layer painted once over those before it.

    Pixel (0, 0) covers [0, 1] x [0, 1] and y points down. A layer is the union of what its contours fill or stroke;
    open contours are filled as if a straight line closed them, as SVG has it. Tables of whole numbers are read on the
    CPU, and are best there.

    Attributes:
        points: control points, float32 or float64, before the transform of a layer.
        half_widths: half a stroke's width at each point, in the units of the points; not read by fills.
        inner: control points between the ends of each segment: 0 for lines, 1 for quadratics, 2 for cubics.
        contours: first point, number of points, first segment, number of segments, 1 if it is closed: such a contour
            does not repeat its first point.
        layers: first contour, number of contours, rule (`NONZERO`, `EVEN_ODD`, `STROKE`), row of transforms, row of
            paints.
        transforms: from the coordinates of points, or of axes, to pixels.
        paints: kind (`PLAIN`, `LINEAR`, `RADIAL`), first stop, number of stops, row of transforms.
        axes: begin and end of linear gradients, centre and radii of radial ones.
        offsets: where stops are on their gradient, 0 to 1, rising.
        colors: straight red, green, blue and alpha of stops.
    """

    points: Float[Tensor, "P 2"]
    half_widths: Float[Tensor, " P"]
    inner: Int[Tensor, " S"]
    contours: Int[Tensor, "K 5"]
    layers: Int[Tensor, "L 5"]
    transforms: Float[Tensor, "T 2 3"]
    paints: Int[Tensor, "Q 4"]
    axes: Float[Tensor, "Q 4"]
    offsets: Float[Tensor, " M"]
    colors: Float[Tensor, "M 4"]

    def values(self) -> tuple[Tensor, ...]:
        """The tensors that gradients reach, in their order."""
        return self.points, self.half_widths, self.transforms, self.axes, self.offsets, self.colors

    def tables(self) -> tuple[Tensor, ...]:
        """The whole numbers, in their order."""
        return self.inner, self.contours, self.layers, self.paints


def check_layers(layers: Layers, size: tuple[int, int], background: Tensor | None) -> None:
    """Raises TypeError or ValueError for tables that do not belong together and values that cannot be drawn."""
    width, height = size
    if not (width > 0 and height > 0):
        raise ValueError(f"a picture has one pixel or more, got {width} x {height}")
    if background is not None:
        _check_like("background", background, layers.points)
        _check_shape("background", background, (height, width, 4))
    axes_of: dict[str, tuple[int | None, ...]] = {
        "points": (None, 2),
        "half_widths": (len(layers.points),),
        "transforms": (None, 2, 3),
        "axes": (len(layers.paints), 4),
        "offsets": (len(layers.colors),),
        "colors": (None, 4),
    }
    dtype = layers.points.dtype
    if dtype not in (torch.float32, torch.float64):
        raise TypeError(f"points must be float32 or float64, got {dtype}")
    for name, shape in axes_of.items():
        value = getattr(layers, name)
        _check_like(name, value, layers.points)
        _check_shape(name, value, shape)
        if not bool(torch.isfinite(value.detach()).all()):
            raise ValueError(f"{name} must be finite")
    _check_reach(layers)
    for name, columns in (("inner", ()), ("contours", (5,)), ("layers", (5,)), ("paints", (4,))):
        value = getattr(layers, name)
        if value.dtype != torch.int32:
            raise TypeError(f"{name} must be int32, got {value.dtype}")
        _check_shape(name, value, (None, *columns))
    _check_tables(layers)


def _check_reach(layers: Layers) -> None:
    """Raises ValueError if a transform may take a point, or the border of a stroke there, too far away."""
    reach = sum(float(value.detach().abs().max()) for value in (layers.points, layers.half_widths) if value.numel())
    moves = layers.transforms.detach().abs()
    if moves.numel() and 2 * float(moves[:, :, :2].max()) * reach + float(moves[:, :, 2].max()) > MAX_COORDINATE:
        raise ValueError(f"points, half widths and transforms must stay within {MAX_COORDINATE:g} pixels")


def _check_like(name: str, value: Tensor, points: Tensor) -> None:
    if value.dtype != points.dtype:
        raise TypeError(f"{name} must have the dtype of points, {points.dtype}, got {value.dtype}")
    if value.device != points.device:
        raise ValueError(f"{name} must be where points are, on {points.device}, got {value.device}")


def _check_shape(name: str, value: Tensor, shape: tuple[int | None, ...]) -> None:
    if value.ndim != len(shape) or any(n is not None and n != got for n, got in zip(shape, value.shape, strict=True)):
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise ValueError(f"{name} must have shape ({wanted}), got {tuple(value.shape)}")


def _check_tables(layers: Layers) -> None:
    inner, contours, rows, paints = (table.cpu() for table in layers.tables())
    transforms = len(layers.transforms)
    _check_rows("inner", inner, 0, 2)
    first, points, segment, segments, closed = contours.T
    _check_range("contours", first, points, len(layers.points))
    _check_range("contours", segment, segments, len(inner))
    _check_rows("closed", closed, 0, 1)
    before = torch.cat([inner.new_zeros(1), (inner + 1).cumsum(0, dtype=torch.int32)])
    needed = before[(segment + segments).long()] - before[segment.long()] + (1 - closed)
    if len(contours) and bool((needed != points).any()):
        k = int((needed != points).nonzero()[0])
        raise ValueError(
            f"contour {k} has {int(segments[k])} segments, which take {int(needed[k])} points, and {int(points[k])}"
        )
    contour, count, rule, transform, paint = rows.T
    _check_range("layers", contour, count, len(contours))
    _check_rows("the rule of a layer", rule, 0, 2)
    _check_rows("the transform of a layer", transform, 0, transforms - 1)
    _check_rows("the paint of a layer", paint, 0, len(paints) - 1)
    kind, stop, stops, placed = paints.T
    _check_rows("the kind of a paint", kind, 0, 2)
    _check_range("paints", stop, stops, len(layers.colors))
    _check_rows("the stops of a paint", stops, 1, len(layers.colors))
    _check_rows("the transform of a paint", placed, 0, transforms - 1)


def _check_rows(name: str, value: Tensor, low: int, high: int) -> None:
    if value.numel() and not (low <= int(value.min()) and int(value.max()) <= high):
        raise ValueError(f"{name} must be {low} to {high}, got {int(value.min())} to {int(value.max())}")


def _check_range(name: str, first: Tensor, count: Tensor, size: int) -> None:
    if first.numel() and (int(first.min()) < 0 or int(count.min()) < 0 or int((first.long() + count).max()) > size):
        raise ValueError(f"{name} points to what is not there: of {size} entries")
