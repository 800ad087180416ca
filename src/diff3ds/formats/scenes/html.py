"""One page for browsers, offline: the sketch in all its numbers, drawn, turned and looked through there.

It keeps everything: the page holds the sketch.json, bit for bit, and draws it as `render` does, widths in image units
too. Nothing is read back from it.
"""

from pathlib import Path
from typing import Any

from diff3ds._files import write_text
from diff3ds.formats.framing import FILLED, FOV, ball_of
from diff3ds.formats.sketch_json import json_text
from diff3ds.sketch import Sketch
from diff3ds.viewer.page import Served, page_text

# Where the camera of the page begins, degrees: as in a notebook.
AZIMUTH, ELEVATION = 30.0, 20.0


def save_html(path: str | Path, sketch: Sketch, beside: tuple[str, Sketch] | None = None) -> None:
    """Writes a page that shows the sketch in any browser with WebGL 2, whole or not at all.

    Args:
        path: the file.
        sketch: what it shows.
        beside: title and strokes of a second sketch, which stands beside it and is seen by the same camera.

    Raises:
        ValueError: values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    write_text(path, sketch_page(path.stem, sketch, beside=beside))


def sketch_page(
    title: str,
    sketch: Sketch,
    served: Served | None = None,
    beside: tuple[str, Sketch] | None = None,
    framed: bool = False,
) -> str:
    """The text of such a page.

    Args:
        title: of the page.
        sketch: what it shows.
        served: of a page that a server shows.
        beside: title and strokes of a second sketch.
        framed: whether what the page is a frame of may show other sketches on it.
    """
    if beside is None:
        return page_text(title, json_text(sketch), start_of(sketch), served, framed=framed)
    other = beside[0], json_text(beside[1])
    return page_text(title, json_text(sketch), start_of(sketch, beside[1]), served, other, framed)


def start_of(*sketches: Sketch) -> dict[str, Any]:
    """From where such a page shows sketches at first, as `page_text` wants it."""
    middle, radius = ball_of(*sketches)
    return {
        "middle": middle.tolist(),
        "radius": radius,
        "azimuth": AZIMUTH,
        "elevation": ELEVATION,
        "fov": FOV,
        "filled": FILLED,
    }
