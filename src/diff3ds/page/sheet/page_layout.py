"""Views laid out on a page: cameras whose pictures are what lies in the place of each, for every file of drawings."""

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from diff3ds._settings import MAX_SIZE
from diff3ds.camera import Cameras
from diff3ds.page.sheet.ink_boxes import Box, union
from diff3ds.page.sheet.page_setup import Fit, PageSetup
from diff3ds.page.sheet.views_grid import grid_columns, hexadecimal
from diff3ds.sketch import Sketch

# Of vector files: the tolerance of paths, a twentieth of a pixel, is then a twentieth of a tenth of a millimetre.
PIXELS_PER_MM = 10.0
# What programs take a pixel for, where no size on paper is asked for (CSS).
PIXELS_PER_MM_OF_SCREENS = 96 / 25.4
# Of the shorter side of a picture that has no page: what stays free around a drawing that fills it. [empirical]
FREE = 0.05
# px. A side that lacks less to a whole pixel is whole but for rounding; what is less wide or high is a line.
ROUNDING, TINY = 1e-6, 1e-6


@dataclass(frozen=True, eq=False)
class Layout:
    """Views on a page.

    Attributes:
        cameras: that see in their pictures what lies in the place of each view.
        corners: of the upper left corner of each view on the page, pixels.
        size: (width, height) of the page, pixels, not always whole ones.
        frame: (width, height) of the place of each view, pixels, not always whole ones.
        pixels_per_mm: of the page; None where no size on paper is asked for.
        widen: times which widths in image units are drawn, as the cameras' pictures have another height.
    """

    cameras: Cameras
    corners: list[tuple[float, float]]
    size: tuple[float, float]
    frame: tuple[float, float]
    pixels_per_mm: float | None = None
    widen: float = 1.0

    def widened(self, sketch: Sketch) -> Sketch:
        """The sketch as wide as it is drawn."""
        return widened(sketch, self.widen)

    def in_pixels(self, view: int) -> "tuple[Layout, tuple[int, int]]":
        """A view on a page of its own whose picture begins at a whole pixel of this one, and at which: x and y."""
        x, y = self.corners[view]
        height, width = self.cameras.size
        place = math.floor(x), math.floor(y)
        shift, size = (x - place[0], y - place[1]), (height + 1, width + 1)
        camera, widen = _zoomed(self.cameras[view], self.widen, 1.0, shift, size)
        return Layout(camera, [(0.0, 0.0)], (width + 1, height + 1), self.frame, self.pixels_per_mm, widen), place

    @property
    def per_mm(self) -> float:
        """Pixels to a millimetre, of screens where no size on paper is asked for."""
        return self.pixels_per_mm or PIXELS_PER_MM_OF_SCREENS

    def svg_head(self, background: Sequence[float] | None, spaces: str, told: str) -> str:
        """How an SVG file of the page begins: with its size, and its ground if it has one.

        Args:
            background: RGB in [0, 1], or None.
            spaces: of names, that the file has.
            told: other attributes of the root.
        """
        width, height = self.size
        unit, scale = ("", 1.0) if self.pixels_per_mm is None else ("mm", 1 / self.pixels_per_mm)
        whole = f'width="{width:.8g}" height="{height:.8g}"'
        size = f'width="{width * scale:.8g}{unit}" height="{height * scale:.8g}{unit}"'
        box = f'viewBox="0 0 {width:.8g} {height:.8g}"'
        head = " ".join(filter(None, ['<svg xmlns="http://www.w3.org/2000/svg"', size, box, spaces, told])) + ">"
        return head if background is None else f'{head}\n<rect {whole} fill="{hexadecimal(background)}"/>'


def widened(sketch: Sketch, widen: float) -> Sketch:
    """A sketch whose widths are so many times as large, if they are of the image."""
    return sketch if widen == 1 or sketch.width_space != "image" else sketch.replace(width=sketch.width * widen)


def lay_out(
    cameras: Cameras,
    page: PageSetup | None,
    boxes: Callable[[Cameras, float], Iterable[Box | None]],
    *,
    alone: bool = False,
    looks: int = 1,
    pixels_per_mm: float = PIXELS_PER_MM,
) -> Layout:
    """Lays views out in a grid that is about square, or each on a page of its own.

    Args:
        cameras: of the views, as they are without a page.
        page: None makes one that the pictures fill, side by side.
        boxes: of what is drawn in each view, given cameras and the factor of widths; None where nothing is.
        alone: whether each view has the page for itself.
        looks: as of `fitted`.
        pixels_per_mm: of the page.

    Raises:
        ValueError: so many views that margins leave nothing for them.
    """
    count = 1 if alone else len(cameras)
    columns = grid_columns(count)
    rows = math.ceil(count / columns)
    places = [divmod(0 if alone else view, columns)[::-1] for view in range(len(cameras))]
    if page is None:
        height, width = cameras.size
        corners = [(float(x * width), float(y * height)) for x, y in places]
        return Layout(cameras, corners, (columns * width, rows * height), (width, height))
    margin = page.margin * pixels_per_mm
    whole = page.width * pixels_per_mm, page.height * pixels_per_mm
    frame = (whole[0] - (columns + 1) * margin) / columns, (whole[1] - (rows + 1) * margin) / rows
    if min(frame) < 1:
        raise ValueError(f"{len(cameras)} views with margins of {page.margin:g} mm have no room on the page")
    placed, widen, (x0, y0) = fitted(cameras, frame, page.fit, boxes, looks)
    corners = [(margin + x0 + x * (frame[0] + margin), margin + y0 + y * (frame[1] + margin)) for x, y in places]
    return Layout(placed, corners, whole, frame, pixels_per_mm, widen)


def fitted(
    cameras: Cameras,
    frame: tuple[float, float],
    fit: Fit,
    boxes: Callable[[Cameras, float], Iterable[Box | None]],
    looks: int = 1,
) -> tuple[Cameras, float, tuple[float, float]]:
    """Cameras that see in a frame what `fit` puts there.

    Args:
        cameras: as they are.
        frame: (width, height), pixels, not always whole ones.
        fit: as of `PageSetup`.
        boxes: as of `lay_out`.
        looks: how often the boxes are looked at: once where all that is drawn grows with the picture.

    Returns:
        The cameras, whose pictures are the frame; the factor of widths in image units; where in the frame their
        pictures begin, pixels.
    """
    height, width = cameras.size
    scale = min(frame[0] / width, frame[1] / height)
    whole = max(int(scale * height + ROUNDING), 1), max(int(scale * width + ROUNDING), 1)
    start, widen = _zoomed(cameras, 1.0, scale, (0.0, 0.0), whole)
    picture = start, widen, ((frame[0] - scale * width) / 2, (frame[1] - scale * height) / 2)
    if fit == "none":
        return picture
    # What lies beside the picture is part of the drawing, as far as the picture is large.
    scale = min(1.0, MAX_SIZE / (3 * max(whole)))
    high, wide = (int(scale * side) for side in whole)
    placed, widen = _zoomed(start, widen, scale, (wide, high), (3 * high, 3 * wide))
    # A pixel more than the frame: what touches the border is not cut by rounding.
    room = math.ceil(frame[1]) + 1, math.ceil(frame[0]) + 1
    tall = False
    for _ in range(looks):
        box = union(boxes(placed, widen))
        if box is None or max(box[2] - box[0], box[3] - box[1]) <= 0:
            return picture
        zoom, shift = to_frame(box, frame, fit)
        tall = zoom * (box[3] - box[1]) > frame[1] + 1
        placed, widen = _zoomed(placed, widen, zoom, shift, room)
    if tall:
        warnings.warn("as wide as the page, the drawing is higher than it: what lies beyond is left out", stacklevel=2)
    return placed, widen, (0.0, 0.0)


def to_frame(box: Box, frame: tuple[float, float], fit: Fit) -> tuple[float, tuple[float, float]]:
    """The scale, and then the shift, by which a box comes to lie in a frame as `fit` says; pixels."""
    across, down = frame[0] / max(box[2] - box[0], TINY), frame[1] / max(box[3] - box[1], TINY)
    zoom = min(across, down) if fit == "page" else across
    return zoom, (frame[0] / 2 - zoom * (box[0] + box[2]) / 2, frame[1] / 2 - zoom * (box[1] + box[3]) / 2)


def filled(
    cameras: Cameras, fit: Fit, boxes: Callable[[Cameras, float], Iterable[Box | None]]
) -> tuple[Cameras, float]:
    """Cameras with pictures as large as they were, in which the drawing leaves free some room all round.

    Args:
        cameras: as they are.
        fit: as of `PageSetup`; none leaves the cameras as they are.
        boxes: as of `lay_out`.

    Returns:
        The cameras, and the factor of widths in image units.
    """
    if fit == "none":
        return cameras, 1.0
    height, width = cameras.size
    free = FREE * min(height, width)
    placed, widen, _ = fitted(cameras, (width - 2 * free, height - 2 * free), fit, boxes)
    return _zoomed(placed, widen, 1.0, (free, free), cameras.size)


def _zoomed(
    cameras: Cameras, widen: float, scale: float, shift: tuple[float, float], size: tuple[int, int]
) -> tuple[Cameras, float]:
    """Cameras at the same places, float64, whose pictures are scaled about their upper left corner, then moved.

    Args:
        cameras: any.
        widen: the factor of widths in image units.
        scale: new pixels to an old one.
        shift: to the right and down, new pixels.
        size: (height, width) of the new pictures.

    Returns:
        The cameras, and the factor that makes widths grow with the pictures.
    """
    lens = cameras.intrinsics.double().clone()
    lens[:, :2] *= scale
    lens[:, :2, 2] += lens.new_tensor(shift)
    moved = replace(cameras, world_to_camera=cameras.world_to_camera.double(), intrinsics=lens, size=size)
    return moved, widen * scale * cameras.size[0] / size[0]
