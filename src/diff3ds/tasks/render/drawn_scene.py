"""What is drawn: a sketch with what hides it and the style, as strokes of views, and as their pixels."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from diff3ds.camera import Cameras
from diff3ds.page.drawn_paths import ink_boxes
from diff3ds.page.sheet.page_layout import filled, lay_out, widened
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.sketch import Sketch
from diff3ds.surfaces.draw import Lines, lines_for_pixels, visible_lines
from diff3ds.surfaces.hatching.tones import Hatch
from diff3ds.surfaces.shape.smooth_surface import smooth_for_pictures
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.render.page_options import PageOptions
from diff3ds.tasks.render.page_pictures import Image, page_pictures, view_pictures
from diff3ds.tasks.render.render_options import LayerBy, PictureOptions, SurfaceOptions
from diff3ds.tasks.render.stroke_layers import HIDDEN, PLAIN, layers_by
from diff3ds.tasks.styling import Styling


class Shown(NamedTuple):
    """Strokes that are drawn.

    Attributes:
        sketch: the strokes.
        numbers: of each that of the sketch's, -1 for lines of the view alone.
        seen: which are visible, None for all.
        dashes: as `save_svg` says, where hidden lines are dashed.
    """

    sketch: Sketch
    numbers: list[int]
    seen: list[bool] | None
    dashes: list[int] | None = None

    def layers(self, by: Sequence[LayerBy]) -> list[tuple[str, ...]] | None:
        """The layers that are asked for."""
        return layers_by(self.sketch, by, self.seen)

    def told(self) -> list[str] | None:
        """What each stroke is, and whether it is hidden: "crease", "crease, hidden"; None where nothing is known."""
        if self.seen is None:
            return None if self.sketch.kinds is None else list(self.sketch.kinds)
        kinds = self.sketch.kinds or ("",) * len(self.sketch)
        return [kind if seen else f"{kind or PLAIN}, {HIDDEN}" for kind, seen in zip(kinds, self.seen, strict=True)]


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
            return [self._shown(lines) for lines in views]
        return lines_for_pixels(
            lambda lines, view: self._shown(lines), sketch, cameras, surface, contours=contours, hatch=hatch
        )

    def _shown(self, lines: Lines) -> Shown:
        hidden = self.hiding.hidden or "drop"
        sketch, origins = lines.drawn_from(hidden)
        given = [lines.numbers[row] for row, _ in origins]
        numbers = [-1 if number < 0 else self.numbers[number] for number in given]
        return Shown(sketch, numbers, [seen for _, seen in origins], lines.dashes(hidden))

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
        yield from view_pictures(sketches, cameras, self.picture.color, self.surface is None)

    def _pages(self, cameras: Cameras, page: PageSetup, alone: bool) -> Iterator[Image]:
        """Pictures of pages, each of one view or of all."""
        per_mm = self.page.pixels_per_mm
        sketches = [each.sketch for each in self.shown(cameras, alone)]
        if self.styling is not None:
            many = range(len(cameras)) if alone else [slice(None)]
            for some in many:
                yield self.styling.image(sketches[some], cameras[some], self.picture.color, page, per_mm)
            return
        yield from page_pictures(sketches, cameras, page, per_mm, self.picture.color, alone)
