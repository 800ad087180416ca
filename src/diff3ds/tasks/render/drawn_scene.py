"""What is drawn: a sketch with what hides it and the style, as strokes of views, and as their pixels."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.page.drawn_paths import ink_boxes
from diff3ds.page.sheet.page_layout import Layout, filled, lay_out, widened
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.surfaces.draw import Lines, lines_for_pixels, visible_lines
from diff3ds.surfaces.hatching.tones import Hatch
from diff3ds.surfaces.shape.smooth_surface import smooth_for_pictures
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.render.page_options import PageOptions
from diff3ds.tasks.render.render_options import LayerBy, PictureOptions, SurfaceOptions
from diff3ds.tasks.render.stroke_layers import layers_by
from diff3ds.tasks.styling import Styling

# Pixels that are drawn in one call: some 200 MB.
PIXELS_AT_ONCE = 1 << 22
Image = Float[Tensor, "H W C"]


class Shown(NamedTuple):
    """Strokes that are drawn: their numbers, -1 for lines of the view alone, and which are visible, None for all."""

    sketch: Sketch
    numbers: list[int]
    seen: list[bool] | None

    def layers(self, by: Sequence[LayerBy]) -> list[tuple[str, ...]] | None:
        """The layers that are asked for."""
        return layers_by(self.sketch, by, self.seen)


@dataclass(frozen=True)
class Scene:
    """A sketch, and how it is drawn.

    Attributes:
        sketch: all strokes.
        numbers: that they had in the sketch that they are of.
        surface: what hides them, or None.
        hiding: how.
        styling: the style, or None.
        picture: what is made of the views.
        page: that they lie on.
    """

    sketch: Sketch
    numbers: list[int]
    surface: TriangleMesh | None
    hiding: SurfaceOptions
    styling: Styling | None
    picture: PictureOptions
    page: PageOptions

    def shown(self, cameras: Cameras, alone: bool) -> list[Shown]:
        """What is drawn in each view.

        With a surface it is looked at as large as on the page: its outlines are as fine, and lines of hatching as far
        apart, as there.

        Args:
            cameras: of the views.
            alone: whether each view has a page of its own.
        """
        if self.surface is None:
            return [Shown(self.sketch, self.numbers, None)] * len(cameras)
        hatching, page = self.hiding.tone, self.page.setup
        if page is None and self.picture.turntable is None:
            return self._lines(self.sketch, cameras, hatching.made())
        rough = self._lines(self.sketch, cameras, None)
        boxes = ink_boxes([each.sketch for each in rough])
        if page is not None:
            layout = lay_out(cameras, page, boxes, alone=alone)
            placed, widen, hatch = layout.cameras, layout.widen, hatching.made(layout.per_mm)
        elif (hatch := hatching.made()) is not None:
            placed, widen = filled(cameras, self.page.fit or "page", boxes)
        else:
            return rough
        found = self._lines(widened(self.sketch, widen), placed, hatch)
        return [each._replace(sketch=widened(each.sketch, 1 / widen)) for each in found]

    def _lines(self, sketch: Sketch, cameras: Cameras, hatch: Hatch | None) -> list[Shown]:
        """The lines of each view as they are drawn."""
        assert self.surface is not None
        surface, contours = smooth_for_pictures(self.surface, max(cameras.size)), self.hiding.contours
        if self.picture.turntable is None:
            views = visible_lines(sketch, cameras, surface, contours=contours, hatch=hatch)
        else:
            views = lines_for_pixels(sketch, cameras, surface, contours, lambda done: None, hatch)
        return [self._shown(lines) for lines in views]

    def _shown(self, lines: Lines) -> Shown:
        hidden = self.hiding.hidden or "drop"
        origins = lines.origins(hidden)
        given = [lines.numbers[row] for row, _ in origins]
        numbers = [-1 if number < 0 else self.numbers[number] for number in given]
        return Shown(lines.drawn(hidden), numbers, [seen for _, seen in origins])

    def images(self, cameras: Cameras) -> Iterator[Image]:
        """Each view as an RGB picture, or where the background is transparent straight RGBA."""
        if self.page.setup is not None:
            yield from self._pages(cameras, self.page.setup, alone=True)
            return
        sketches = [each.sketch for each in self.shown(cameras, alone=True)]
        if self.picture.turntable is not None:
            cameras, widen = filled(cameras, self.page.fit or "page", ink_boxes(sketches))
            sketches = [widened(sketch, widen) for sketch in sketches]
        yield from self._drawn(sketches, cameras)

    def sheet(self, cameras: Cameras, page: PageSetup) -> Image:
        """All views on one page."""
        (image,) = self._pages(cameras, page, alone=False)
        return image

    def _drawn(self, sketches: Sequence[Sketch], cameras: Cameras) -> Iterator[Image]:
        """Views in the style, or as the kernels draw them, those of one sketch a few at once."""
        if self.styling is not None:
            for view, sketch in enumerate(sketches):
                yield self.styling.image(sketch, cameras[view], self.picture.color)
            return
        at_once = max(1, PIXELS_AT_ONCE // (cameras.size[0] * cameras.size[1])) if self.surface is None else 1
        color = self.picture.color
        for first in range(0, len(cameras), at_once):
            sketch = sketches[first]
            ground = torch.tensor(color or (0.0, 0.0, 0.0), dtype=sketch.color.dtype)
            drawn = render(sketch, cameras[first : first + at_once], background=ground)
            images = drawn.color
            if color is None:
                alpha = drawn.alpha[..., None]
                images = torch.cat([images / alpha.clamp(min=1e-6), alpha], -1)
            yield from images

    def _pages(self, cameras: Cameras, page: PageSetup, alone: bool) -> Iterator[Image]:
        """Pictures of pages, each of one view or of all."""
        per_mm = self.page.pixels_per_mm
        sketches = [each.sketch for each in self.shown(cameras, alone)]
        if self.styling is not None:
            many = range(len(cameras)) if alone else [slice(None)]
            for some in many:
                yield self.styling.image(sketches[some], cameras[some], self.picture.color, page, per_mm)
            return
        layout = lay_out(cameras, page, ink_boxes(sketches), alone=alone, pixels_per_mm=per_mm)
        blank = torch.tensor(self.picture.color or (0.0, 0.0, 0.0, 0.0)).repeat(*_pixels(layout), 1)
        sheet = blank.clone()
        for view, sketch in enumerate(sketches):
            alone_there, (x, y) = layout.in_pixels(view)
            (image,) = self._drawn([alone_there.widened(sketch)], alone_there.cameras)
            place = sheet[y : y + image.shape[0], x : x + image.shape[1]]
            place[:] = image[: place.shape[0], : place.shape[1]]
            if alone:
                yield sheet
                sheet = blank.clone()
        if not alone:
            yield sheet


def _pixels(layout: Layout) -> tuple[int, int]:
    """(height, width) of a picture of the page."""
    width, height = layout.size
    return max(round(height), 1), max(round(width), 1)
