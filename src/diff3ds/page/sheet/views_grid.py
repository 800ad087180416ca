"""What all writers of views see to before they begin, the columns of a grid of views, and colours in words."""

import math
from collections.abc import Iterable, Sequence

from diff3ds.camera import Cameras
from diff3ds.sketch import Sketch


def check_page(
    sketch: Sketch | Sequence[Sketch], cameras: Cameras, background: Sequence[float] | None, tolerance: float
) -> list[Sketch]:
    """Sees that the views can be written; returns the sketch of each view, on the CPU and without its history.

    Args:
        sketch: one for all views, or one a view.
        cameras: of the views.
        background: RGB, or None.
        tolerance: pixels.

    Raises:
        ValueError: they cannot.
    """
    if len(cameras) == 0:
        raise ValueError("a file of views needs at least one view, got none")
    if background is not None and len(background) != 3:
        raise ValueError(f"background must be three numbers in [0, 1] or None, got {background}")
    if not 0 < tolerance < math.inf:
        raise ValueError(f"tolerance must be positive, got {tolerance}")
    if isinstance(sketch, Sketch):
        sketch = sketch.detach()
        sketch.check_values()
        return [sketch] * len(cameras)
    if len(sketch) != len(cameras):
        raise ValueError(f"sketches must be one for all views or one for each of {len(cameras)}, got {len(sketch)}")
    return [check_page(each, cameras[0], background, tolerance)[0] for each in sketch]


def grid_columns(count: int) -> int:
    """Columns of a grid of `count` pictures that is as square as it gets, wider rather than higher."""
    return math.ceil(math.sqrt(count))


def hexadecimal(color: Iterable[float]) -> str:
    """A colour of numbers from 0 to 1 as "#rrggbb"."""
    return "#" + "".join(f"{round(min(max(float(c), 0.0), 1.0) * 255):02x}" for c in color)
