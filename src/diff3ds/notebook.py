"""Sketches in notebooks: the page of `.html` files as a widget, by anywidget."""

from functools import cache
from importlib.resources import files
from typing import Any

from diff3ds.formats.framing import framed
from diff3ds.formats.png import encoded, tile_images
from diff3ds.formats.scenes.html import sketch_page
from diff3ds.render import Rendering, render
from diff3ds.sketch import Sketch
from diff3ds.surfaces.on_page import SurfaceOnPage
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh


def png_of(thing: Sketch | Rendering) -> bytes:
    """A PNG file of what a notebook shows.

    Of a sketch that is a picture of 256 x 256 pixels, from azimuth 30 and elevation 20; of a rendering all views.
    """
    if isinstance(thing, Rendering):
        return encoded(tile_images(thing.color))
    cameras = framed(thing, 30, 20)
    return encoded(render(thing.detach().to("cpu"), cameras).color[0])


def show(sketch: Sketch, title: str = "sketch", *, surface: TriangleMesh | None = None) -> Any:
    """A widget of Jupyter, Colab, VS Code or marimo, on which a sketch is turned, looked through and edited.

    Assigning another sketch to its attribute `sketch` shows that one, seen from where one looks; edits that are not
    saved stay until the page is told to drop them. Edits are saved as a download, and do not change `sketch`.

    Args:
        sketch: what it shows.
        title: of the page, and name of the file that is saved.
        surface: what hides lines of the sketch and has contours, a `TriangleMesh` in its frame; it stays where another
            sketch is assigned.

    Returns:
        The widget, an `anywidget.AnyWidget`. A cell that ends with it shows it.

    Raises:
        ImportError: anywidget is not installed.
        TypeError: something other than a sketch, or another surface.
        ValueError: values that have become invalid since the sketch was made; a surface of more than 200,000 triangles.
    """
    try:
        made = _widget_class()
    except ImportError as error:
        raise ImportError('a sketch in a notebook takes anywidget: pip install "diff3ds[notebook]"') from error
    return made(sketch, title, surface)


@cache
def _widget_class() -> Any:
    """The class of such widgets."""
    import anywidget
    import traitlets

    class SketchWidget(anywidget.AnyWidget):  # type: ignore[misc]
        """A page in a frame, which follows `page`."""

        _esm = files("diff3ds.viewer").joinpath("notebook.js").read_text(encoding="utf-8")
        page = traitlets.Unicode().tag(sync=True)

        def __init__(self, sketch: Sketch, title: str, surface: TriangleMesh | None) -> None:
            super().__init__(page=_page(title, sketch, surface))
            self._title, self._sketch, self._surface = title, sketch, surface

        @property
        def sketch(self) -> Sketch:
            """What is shown. Assigned again, it is read again: tensors may have changed."""
            return self._sketch

        @sketch.setter
        def sketch(self, sketch: Sketch) -> None:
            self.page = _page(self._title, sketch, self._surface)
            self._sketch = sketch

    return SketchWidget


def _page(title: str, sketch: Sketch, surface: TriangleMesh | None) -> str:
    if not isinstance(sketch, Sketch):
        raise TypeError(f"a widget shows a diff3ds.Sketch, got {type(sketch).__name__}")
    return sketch_page(title, sketch, framed=True, surface=SurfaceOnPage.of(surface))
