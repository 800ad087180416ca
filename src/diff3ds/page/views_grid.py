"""Views side by side on one page: how large it is, where each lies, and what cannot be put there."""

import math
from collections.abc import Iterable, Sequence

from diff3ds.camera import Cameras
from diff3ds.sketch import Sketch


def check_page(
    sketch: Sketch,
    cameras: Cameras,
    background: Sequence[float] | None,
    width_mm: float | None,
    tolerance: float,
) -> Sketch:
    """Sees that the views can be written; returns the sketch, on the CPU and without its history.

    Raises:
        ValueError: they cannot.
    """
    if len(cameras) == 0:
        raise ValueError("a file of views needs at least one view, got none")
    if background is not None and len(background) != 3:
        raise ValueError(f"background must be three numbers in [0, 1] or None, got {background}")
    for name, value in (("width_mm", width_mm), ("tolerance", tolerance)):
        if value is not None and not 0 < value < math.inf:
            raise ValueError(f"{name} must be positive, got {value}")
    sketch = sketch.detach()
    sketch.check_values()
    return sketch


def grid_columns(count: int) -> int:
    """Columns of a grid of `count` pictures that is as square as it gets, wider rather than higher."""
    return math.ceil(math.sqrt(count))


def page_size(cameras: Cameras) -> tuple[int, int]:
    """(width, height) in pixels of the page that holds all views."""
    columns = grid_columns(len(cameras))
    height, width = cameras.size
    return columns * width, math.ceil(len(cameras) / columns) * height


def corner(cameras: Cameras, view: int) -> tuple[int, int]:
    """Where a view is on the page: x and y of its upper left corner, pixels."""
    row, column = divmod(view, grid_columns(len(cameras)))
    return column * cameras.size[1], row * cameras.size[0]


def hexadecimal(color: Iterable[float]) -> str:
    """A colour of numbers from 0 to 1 as "#rrggbb"."""
    return "#" + "".join(f"{round(min(max(float(c), 0.0), 1.0) * 255):02x}" for c in color)
