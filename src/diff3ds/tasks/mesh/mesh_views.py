"""The views of a mesh's run: its drawings, on pages where that is asked for, and its turntable."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.formats import save_png, save_svg, tile_images
from diff3ds.formats.cad.step import save_step
from diff3ds.formats.framing import framed
from diff3ds.page.drawn_paths import ink_boxes
from diff3ds.page.sheet.page_layout import PIXELS_PER_MM, filled, lay_out, widened
from diff3ds.parallel.in_copies import in_copies
from diff3ds.sketch import Sketch
from diff3ds.surfaces.draw import CONTOUR, Lines, lines_for_pixels, visible_lines
from diff3ds.surfaces.form.form_mesh import FormMesh
from diff3ds.surfaces.hatching.tones import Hatch
from diff3ds.surfaces.shape.coarse import coarse, without_specks
from diff3ds.surfaces.shape.colors import SurfaceColors, colored
from diff3ds.surfaces.shape.smooth_surface import smooth_for_pictures
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.svg.path_ids import KEPT
from diff3ds.tasks.form_lines import thinned
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.mesh.solid_lines import layers_of, with_faces
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.render.page_pictures import Image, page_pictures, view_pictures
from diff3ds.tasks.render.stroke_layers import layers_by
from diff3ds.transforms import load_transforms

# Pixels of the frames of a turntable.
FRAME = 384
# Cells along the longest side of the coarse mesh that stands for a large one in a turntable: less than a pixel each. Of
# a coarser one features are not nearer than what counts as on a surface.
FINE_CELLS = 256


def in_pictures(mesh: TriangleMesh, size: int) -> TriangleMesh:
    """A smooth mesh for one of few faces; one that is moved onto its forms has their normals already."""
    return mesh if isinstance(mesh, FormMesh) else smooth_for_pictures(mesh, size)


def cameras_of(mesh: TriangleMesh, options: MeshOptions) -> Cameras:
    """The cameras of the drawings.

    Raises:
        ValueError, OSError: as `load_transforms`.
    """
    view = options.view
    if view.cameras is not None:
        path = view.cameras / "transforms.json" if view.cameras.is_dir() else view.cameras
        return load_transforms(path)[0]
    return _around(mesh, view.azimuth, options, options.size)


def _around(mesh: TriangleMesh, azimuth: tuple[float, ...], options: MeshOptions, size: int) -> Cameras:
    view = options.view
    corners = Sketch(torch.from_numpy(mesh.vertices[:, None].repeat(2, 1)))
    return framed(corners, azimuth, view.elevation, size=size, distance=view.distance, fov=view.fov, height=view.height)


@dataclass(frozen=True, eq=False)
class MeshViews:
    """A mesh with its lines, as views show them.

    Attributes:
        features: the lines that are there from everywhere.
        kinds: what each is.
        mesh: the mesh.
        colors: that strokes are drawn in, or None.
        options: of the command.
    """

    features: Sketch
    kinds: list[str]
    mesh: TriangleMesh
    colors: SurfaceColors | None
    options: MeshOptions

    @cached_property
    def shown(self) -> TriangleMesh:
        """What is seen in place of the mesh, for pictures as large as the drawings."""
        page = self.options.page.setup
        size = self.options.size if page is None else round(max(page.width, page.height) * PIXELS_PER_MM)
        return in_pictures(self.mesh, size)

    def drawings(self, cameras: Cameras, told: Callable[[int], None]) -> "Drawings":
        """The lines of each view; on a page, which each has for itself, the mesh is looked at as large as there."""
        options, page = self.options, self.options.page.setup

        def seen(strokes: Sketch, cameras: Cameras, hatch: Hatch | None, done: int = 0) -> list[Lines]:
            views = visible_lines(
                strokes,
                cameras,
                self.shown,
                kinds=self.kinds,
                contours=options.contours,
                hatch=hatch,
                told=lambda more: told(done + more),
            )
            return [replace(lines, sketch=with_faces(lines.sketch, self.mesh)) for lines in views]

        if page is None:
            views = seen(self.features, cameras, options.tone.made())
            return Drawings(self, cameras, views, [self._drawn(lines) for lines in views])
        views, sketches = [], []
        for view in range(len(cameras)):
            (rough,) = seen(self.features, cameras[view], None, view)
            layout = lay_out(cameras[view], page, ink_boxes([self._drawn(rough)]))
            hatch = options.tone.made(layout.per_mm)
            (lines,) = seen(layout.widened(self.features), layout.cameras, hatch, view)
            views.append(lines)
            sketches.append(widened(self._drawn(lines), 1 / layout.widen))
        return Drawings(self, cameras, views, sketches)

    def frames(self, report: Report) -> Iterator[Float[Tensor, "H W 3"]]:
        """The pictures of a turntable."""
        options, count = self.options, self.options.turntable
        start = options.view.azimuth[0]
        cameras = _around(self.mesh, tuple(start + 360 * i / count for i in range(count)), options, FRAME)
        less = coarse(self.mesh, FINE_CELLS)
        # What the drawings have made of a mesh, such as its seams, is not made again.
        shown = self.shown if less is self.mesh else less

        def told(done: int) -> None:
            report(Progress("turntable", done, count, None, len(self.features)))

        def seen(strokes: Sketch, cameras: Cameras, hatch: Hatch | None) -> list[Sketch]:
            def drawn(lines: Lines, view: int) -> Sketch:
                all_of_it = self._drawn(lines)
                if len(shown) == len(self.mesh):
                    return all_of_it
                return without_specks(all_of_it, 3 * self.mesh.size / FINE_CELLS)

            return lines_for_pixels(drawn, strokes, cameras, shown, contours=options.contours, hatch=hatch, told=told)

        strokes = seen(self.features, cameras, None)
        cameras, widen = filled(cameras, options.page.fit or "page", ink_boxes(strokes))
        strokes = [widened(each, widen) for each in strokes]
        if (hatch := options.tone.made()) is not None:
            # Lines are as far apart as asked in the pictures that are fitted.
            strokes = seen(widened(self.features, widen), cameras, hatch)
        for image in view_pictures(strokes, cameras):
            yield image.float()

    def _drawn(self, lines: Lines) -> Sketch:
        """What is drawn in a view; contours, which are the view's own, in the colours of what is seen of them."""
        sketch, origins = lines.drawn_from(self.options.hidden)
        layers = lines.named(origins)
        drawn = thinned(sketch, layers, self.options.tangent)
        own = [i for i, layer in enumerate(layers) if layer.startswith(CONTOUR)]
        if self.colors is None or not own:
            return drawn
        color = drawn.color.clone()
        color[own] = colored(drawn[own], self.mesh, self.colors).color
        return replace(drawn, color=color)


@dataclass(frozen=True, eq=False)
class Drawings:
    """What is drawn in the views of a run.

    Attributes:
        of: what is seen.
        cameras: the views, as they are without a page.
        views: the lines of each.
        sketches: what is drawn of these.
    """

    of: MeshViews
    cameras: Cameras
    views: list[Lines]
    sketches: list[Sketch]

    def pictures(self) -> tuple[list[Image], Float[Tensor, "all_H all_W C"]]:
        """A picture of each view, and one of all."""
        page = self.of.options.page
        if page.setup is None:
            pictures = [image.float() for image in view_pictures(self.sketches, self.cameras)]
            return pictures, tile_images(torch.stack(pictures), columns=min(len(pictures), 2))

        def on_page(some: slice) -> Image:
            assert page.setup is not None
            (image,) = page_pictures(self.sketches[some], self.cameras[some], page.setup, page.pixels_per_mm)
            return image

        return [on_page(slice(view, view + 1)) for view in range(len(self.cameras))], on_page(slice(None))

    def write(self, out: Path, pictures: list[Image], rows: list[int], say: Callable[[str], None]) -> set[str]:
        """Writes each view as SVG, STEP and PNG; says what the files are called, and how far a pen goes.

        Args:
            out: the folder.
            pictures: of the views.
            rows: of the strokes that the views were given, their numbers in the sketch.
            say: told of pens.
        """
        options, page = self.of.options, self.of.options.page.setup

        def written(view: int) -> tuple[set[str], list[str]]:
            lines, drawing, said = self.views[view], self.sketches[view], list[str]()
            name = f"drawing-{view + 1:0{len(str(len(self.sketches)))}}"
            layers = layers_of(lines.layers(options.hidden), drawing, self.of.mesh)
            origins = lines.origins(options.hidden)
            numbers = [-1 if (given := lines.numbers[row]) < 0 else rows[given] for row, _ in origins]
            groups = layers_by(drawing, options.layers, [seen for _, seen in origins]) or layers
            how: dict[str, Any] = {"layers": groups, "centerline": options.centerline, "pen_mm": options.pen_mm}
            how |= {"numbers": numbers, "kept": KEPT[:1], "page": page, "dashes": lines.dashes(options.hidden)}
            travel = save_svg(out / f"{name}.svg", drawing, self.cameras[view], **how)
            if travel is not None:
                said.append(f"{name}.svg: {travel.told('pixels' if page is None else 'mm', options.speed)}")
            if len(drawing):
                save_step(out / f"{name}.step", drawing, layers=layers)
            save_png(out / f"{name}.png", pictures[view], pixels_per_mm=options.page.picture_per_mm)
            return {f"{name}.{suffix}" for suffix in ("svg", "png", *["step"] * (len(drawing) > 0))}, said

        found = in_copies(written, len(self.views), len(self.views))
        for line in (line for _, said in found for line in said):
            say(line)
        return set[str]().union(*(names for names, _ in found))
