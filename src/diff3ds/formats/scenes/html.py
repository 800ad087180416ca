"""One page for browsers, offline: the sketch in all its numbers, drawn, turned and looked through there.

It keeps everything: the page holds the sketch.json, bit for bit, and draws it as `render` does, widths in image units
too. Nothing is read back from it.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from diff3ds._files import write_text
from diff3ds.formats.framing import FILLED, FOV, ball_of
from diff3ds.formats.sketch_json import json_text
from diff3ds.sketch import Sketch
from diff3ds.viewer.page import Served, page_text

# Where the camera of the page begins, degrees: as in a notebook.
AZIMUTH, ELEVATION = 30.0, 20.0


@runtime_checkable
class PageSurface(Protocol):
    """A surface that hides lines on a page; `SurfaceOnPage` of `surfaces` makes one of a mesh."""

    @property
    def mesh(self) -> Any:
        """Its triangles: vertices (V, 3), world units, and faces (F, 3) of these."""

    def data(self, sketch: Sketch) -> dict[str, Any]:
        """What the page knows of it, as JSON has it, where it shows this sketch."""

    def reach(self, *sketches: Sketch) -> float:
        """How far it reaches from the middle of sketches, in radii of their ball."""


def save_html(
    path: str | Path, sketch: Sketch, beside: tuple[str, Sketch] | None = None, *, surface: PageSurface | None = None
) -> None:
    """Writes a page that shows the sketch in any browser with WebGL 2, whole or not at all.

    Args:
        path: the file.
        sketch: what it shows.
        beside: title and strokes of a second sketch, which stands beside it and is seen by the same camera.
        surface: what hides lines of the sketch, in its frame.

    Raises:
        ValueError: values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    write_text(path, sketch_page(path.stem, sketch, beside=beside, surface=surface))


def sketch_page(
    title: str,
    sketch: Sketch,
    served: Served | None = None,
    beside: tuple[str, Sketch] | None = None,
    framed: bool = False,
    surface: PageSurface | None = None,
    surface_beside: PageSurface | None = None,
) -> str:
    """The text of such a page.

    Args:
        title: of the page.
        sketch: what it shows.
        served: of a page that a server shows.
        beside: title and strokes of a second sketch.
        framed: whether what the page is a frame of may show other sketches on it.
        surface: what hides lines of the sketch.
        surface_beside: the same of the second sketch.
    """
    sketches, solids = [sketch], [surface]
    if beside is not None:
        sketches, solids = [sketch, beside[1]], [surface, surface_beside]
    data = [json.dumps(solid and solid.data(each)) for solid, each in zip(solids, sketches, strict=True)]
    other = None if beside is None else (beside[0], json_text(beside[1]), data[1])
    start = start_of(*sketches, surfaces=solids)
    return page_text(title, json_text(sketch), start, served, other, framed, data[0])


def start_of(*sketches: Sketch, surfaces: Sequence[PageSurface | None] = ()) -> dict[str, Any]:
    """From where such a page shows sketches at first, as `page_text` wants it; surfaces are beside or around them."""
    middle, radius = ball_of(*sketches)
    start: dict[str, Any] = {
        "middle": middle.tolist(),
        "radius": radius,
        "azimuth": AZIMUTH,
        "elevation": ELEVATION,
        "fov": FOV,
        "filled": FILLED,
    }
    reaches = [surface.reach(*sketches) for surface in surfaces if surface is not None]
    return start | ({"reach": max(reaches)} if reaches else {})
