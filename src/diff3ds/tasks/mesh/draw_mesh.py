"""A mesh to a sketch: strokes that are there from everywhere, and drawings with contours and without hidden lines."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.formats import save_png, save_svg, tile_images
from diff3ds.formats.cad.step import save_step
from diff3ds.formats.framing import framed
from diff3ds.formats.movie import save_movie
from diff3ds.losses import lengths
from diff3ds.page.drawn_paths import ink_boxes
from diff3ds.page.sheet.page_layout import filled, widened
from diff3ds.render import render
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import Sketch
from diff3ds.surfaces.chosen_strokes import choose_strokes
from diff3ds.surfaces.draw import CONTOUR, Lines, lines_for_pixels, visible_lines
from diff3ds.surfaces.fitted_strokes import fit_strokes
from diff3ds.surfaces.form.form_mesh import FormMesh
from diff3ds.surfaces.form.solid_mesh import SolidMesh
from diff3ds.surfaces.hatching.tones import Hatch
from diff3ds.surfaces.line_drawings import SIZE
from diff3ds.surfaces.lines.feature_curves import outline_share
from diff3ds.surfaces.seen_around import ranked_around
from diff3ds.surfaces.shape.coarse import coarse, without_specks
from diff3ds.surfaces.shape.colors import SurfaceColors, colored
from diff3ds.surfaces.shape.smooth_surface import smooth_for_pictures
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.svg.path_ids import KEPT
from diff3ds.tasks.detail_options import DetailOptions
from diff3ds.tasks.form_lines import thinned
from diff3ds.tasks.mesh.mesh_lines import FixedLines, feature_lines
from diff3ds.tasks.mesh.mesh_options import SMOOTH_STROKES, MeshOptions
from diff3ds.tasks.mesh.solid_lines import layers_of, with_faces
from diff3ds.tasks.mesh.source import LEAST_OUTLINE, read_source
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.render.stroke_layers import layers_by
from diff3ds.tasks.results import RunInfo, check_output_folder, write_results
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.sketch_input import at_level
from diff3ds.transforms import load_transforms

# The turntable, pixels of its frames, and frames a second.
TURNTABLE, FRAME, FPS = "turntable.webp", 384, 12
# Borders of a smooth thing that are shorter are cracks, no openings. Empirical.
CRACK = 0.05
# Cells along the longest side of the coarse mesh that stands for a large one: less than a pixel each in the drawings
# that strokes are fitted to and in a turntable. Of the finer one features are nearer than what counts as on a surface.
FIT_CELLS, FINE_CELLS = 128, 256


@dataclass(frozen=True, eq=False)
class MeshSketch:
    """What a mesh became.

    Attributes:
        sketch: the strokes that are there from everywhere.
        kinds: what each is: "crease", "border", "intersection", or "contour": a stroke for outlines of smooth parts.
        outlines: the share of the outlines from all sides that creases and borders draw.
    """

    sketch: Sketch
    kinds: tuple[str, ...]
    outlines: float

    @property
    def features(self) -> tuple[Sketch, list[str]]:
        """All but the contours, which are others from each side."""
        rows = [i for i, kind in enumerate(self.kinds) if kind != CONTOUR]
        return self.sketch[rows], [self.kinds[i] for i in rows]


def run_mesh(
    source: Path,
    out: Path,
    options: MeshOptions,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Sketch:
    """Makes a sketch of the mesh in a file and drawings of it, and writes the folder of the run.

    Args:
        source: OBJ, STL, PLY, OFF or glTF; STEP, IGES or BREP.
        out: folder of the results.
        options: of the command.
        report: called after every drawing.
        say: told what is smooth.

    Raises:
        ValueError, OSError, ImportError: as `load_surface`, `check_output_folder` and `load_transforms`; too many
            creases; nothing to draw.
    """
    with logged(out, report, say) as (report, say):
        return _drawn_mesh(source, out, options, report, say)


@torch_on_one_thread()
def _drawn_mesh(source: Path, out: Path, options: MeshOptions, report: Report, say: Callable[[str], None]) -> Sketch:
    """Reads, draws and writes."""
    begun = time.perf_counter()
    read = read_source(source, options, report, say)
    check_output_folder(out, out / "run.json", False, options.overwrite)
    cameras = _cameras(read.mesh, options)
    seconds = {"read": time.perf_counter() - begun}
    read = read.by_forms(options, say)
    mesh, colors = read.mesh, read.colors
    made = sketch_mesh(mesh, options, report, read.edges)
    made = _at_detail(made, mesh, options.detail)
    made = replace(made, sketch=_colored(made.sketch, mesh, colors))
    if made.outlines < LEAST_OUTLINE and CONTOUR in made.kinds:
        say(
            f"the mesh is smooth: its creases and borders draw {made.outlines:.0%} of its outlines; strokes "
            "fitted to outlines from all around are in the sketch, and the drawings have those of their own views"
        )
    seconds["strokes"] = time.perf_counter() - begun - sum(seconds.values())
    features, kinds = made.features
    shown = _in_pictures(mesh, options.size)

    def told(done: int) -> None:
        report(Progress("drawings", done, len(cameras), None, len(made.sketch), sketch=made.sketch.detach))

    hatch = options.tone.made()
    views = visible_lines(features, cameras, shown, kinds=kinds, contours=options.contours, hatch=hatch, told=told)
    views = [replace(lines, sketch=with_faces(lines.sketch, mesh)) for lines in views]
    drawings = [_drawn(lines, options, mesh, colors) for lines in views]
    pictures = torch.cat([render(d, cameras[v]).color for v, d in enumerate(drawings)]).float()
    seconds["drawings"] = time.perf_counter() - begun - sum(seconds.values())
    results = _found(mesh, made) | read.told
    info = RunInfo({"source": str(source), **_told(options)}, results, seconds, [], {}, False)
    sketch = with_faces(thinned(made.sketch, made.kinds, options.tangent), mesh).replace(kinds=made.kinds)
    sketch, order = ranked_around(sketch, mesh)
    # Where the strokes of the drawings are in the sketch that is written.
    place = {stroke: number for number, stroke in enumerate(order)}
    rows = [place[row] for row, kind in enumerate(made.kinds) if kind != CONTOUR]
    names = _write_drawings(out, views, drawings, pictures, options, mesh, rows, say)
    if options.turntable:
        save_movie(out / TURNTABLE, _frames(features, mesh, shown, colors, options, report), options.turntable, FPS)
        names.add(TURNTABLE)
    # Last, since run.json says that all of it is there.
    sheet = tile_images(pictures, columns=min(len(pictures), 2))
    written = write_results(out, sketch, cameras, sheet, info, mesh, layers_of(sketch.kinds or (), sketch, mesh))
    for old in (*out.glob("drawing-*.*"), *out.glob(TURNTABLE)):
        # Of a run that is overwritten, all of which was there until now.
        if old.name not in names:
            old.unlink()
    return written


def _write_drawings(
    out: Path,
    views: list[Lines],
    drawings: list[Sketch],
    pictures: Float[Tensor, "V H W 3"],
    options: MeshOptions,
    mesh: TriangleMesh,
    rows: list[int],
    say: Callable[[str], None],
) -> set[str]:
    """Writes each view as SVG, STEP and PNG, and says what the files are called.

    Args:
        rows: of the strokes that the views were given their numbers in the sketch.
    """
    names = set()
    for view, (lines, drawing) in enumerate(zip(views, drawings, strict=True)):
        name = f"drawing-{view + 1:0{len(str(len(drawings)))}}"
        layers = layers_of(lines.layers(options.hidden), drawing, mesh)
        origins = lines.origins(options.hidden)
        numbers = [-1 if (given := lines.numbers[row]) < 0 else rows[given] for row, _ in origins]
        groups = layers_by(drawing, options.layers, [seen for _, seen in origins]) or layers
        how: dict[str, Any] = {"layers": groups, "centerline": options.centerline, "numbers": numbers}
        travel = save_svg(out / f"{name}.svg", drawing, lines.cameras, kept=KEPT[:1], **how)
        if travel is not None:
            say(f"{name}.svg: {travel.told('pixels')}")
        if len(drawing):
            save_step(out / f"{name}.step", drawing, layers=layers)
            names.add(f"{name}.step")
        save_png(out / f"{name}.png", pictures[view])
        names |= {f"{name}.svg", f"{name}.png"}
    return names


def _at_detail(made: MeshSketch, mesh: TriangleMesh, detail: float) -> MeshSketch:
    """The strokes that say most, in the order that they had."""
    if detail == 1:
        return made
    rows = sorted(at_level(made.sketch, DetailOptions(detail), mesh).strokes)
    return replace(made, sketch=made.sketch[rows], kinds=tuple(made.kinds[row] for row in rows))


def _colored(sketch: Sketch, mesh: TriangleMesh, colors: SurfaceColors | None) -> Sketch:
    return sketch if colors is None else colored(sketch, mesh, colors)


def _found(mesh: TriangleMesh, made: MeshSketch) -> dict[str, object]:
    """What run.json says of the mesh."""
    return {
        "kinds": dict(Counter(made.kinds)),
        "outlines_drawn": round(made.outlines, 4),
        "faces": len(mesh),
        "closed": mesh.is_closed,
        "bounds": mesh.bounds.tolist(),
    }


def sketch_mesh(
    mesh: TriangleMesh,
    options: MeshOptions,
    report: Report = lambda progress: None,
    edges: FixedLines | None = None,
) -> MeshSketch:
    """The strokes of a mesh that are there from everywhere.

    Args:
        edges: its lines that are there from everywhere, and what each is; by default its creases and borders.

    Raises:
        ValueError: more creases than a drawing has, or nothing to draw.
    """
    features, kinds = edges or feature_lines(mesh)
    outlines = outline_share(mesh)
    # Solids have their own edges, however round they are.
    smooth = outlines < LEAST_OUTLINE and not (isinstance(mesh, SolidMesh) and len(features))
    if options.strokes is None and not smooth:
        return MeshSketch(features, kinds, outlines)
    if smooth:
        features, kinds = without_cracks(features, kinds, CRACK * mesh.size)

    def told(done: int, of: int) -> None:
        report(Progress("strokes", done, of, None, len(features)))

    count, keep = options.strokes or SMOOTH_STROKES, options.strokes is None
    mesh = _in_small(mesh, FINE_CELLS if len(features) else FIT_CELLS, SIZE)
    chosen = choose_strokes(mesh, features, kinds, count, keep, told)
    if not len(chosen.sketch):
        raise ValueError("the mesh shows no line from any side: it may lie in one plane without a border")
    # Features stay where they are, and come first.
    first = sorted(range(len(chosen.kinds)), key=lambda i: chosen.kinds[i] == CONTOUR)
    start, named = chosen.sketch[first], tuple(chosen.kinds[i] for i in first)
    held = len(named) - named.count(CONTOUR)
    if held == len(named):
        return MeshSketch(start, named, outlines)

    def fitting(done: int, of: int) -> None:
        report(Progress("fit", done, of, None, len(start)))

    return MeshSketch(fit_strokes(mesh, features.to(torch.float64), start, held, fitting), named, outlines)


def without_cracks(features: Sketch, kinds: tuple[str, ...], least: float) -> tuple[Sketch, tuple[str, ...]]:
    """The features but for borders that are shorter, world units."""
    long = (lengths(features) >= least).tolist()
    rows = [i for i, kind in enumerate(kinds) if kind != "border" or long[i]]
    return features[rows], tuple(kinds[i] for i in rows)


def _in_small(mesh: TriangleMesh, cells: int, size: int) -> TriangleMesh:
    """What stands for a mesh in small pictures: a coarse mesh for one of many faces, a smooth one for one of few."""
    less = coarse(mesh, cells)
    return less if less is not mesh else _in_pictures(mesh, size)


def _in_pictures(mesh: TriangleMesh, size: int) -> TriangleMesh:
    """A smooth mesh for one of few faces; one that is moved onto its forms has their normals already."""
    return mesh if isinstance(mesh, FormMesh) else smooth_for_pictures(mesh, size)


def _cameras(mesh: TriangleMesh, options: MeshOptions) -> Cameras:
    view = options.view
    if view.cameras is not None:
        path = view.cameras / "transforms.json" if view.cameras.is_dir() else view.cameras
        return load_transforms(path)[0]
    return _around(mesh, view.azimuth, options, options.size)


def _around(mesh: TriangleMesh, azimuth: tuple[float, ...], options: MeshOptions, size: int) -> Cameras:
    view = options.view
    corners = Sketch(torch.from_numpy(mesh.vertices[:, None].repeat(2, 1)))
    return framed(corners, azimuth, view.elevation, size=size, distance=view.distance, fov=view.fov, height=view.height)


def _frames(
    features: Sketch,
    mesh: TriangleMesh,
    shown: TriangleMesh,
    colors: SurfaceColors | None,
    options: MeshOptions,
    report: Report,
) -> Iterator[Float[Tensor, "H W 3"]]:
    count = options.turntable
    start = options.view.azimuth[0]
    cameras = _around(mesh, tuple(start + 360 * i / count for i in range(count)), options, FRAME)
    less = coarse(mesh, FINE_CELLS)
    # What the drawings have made of a mesh, such as its seams, is not made again.
    shown = shown if less is mesh else less

    def told(done: int) -> None:
        report(Progress("turntable", done, count, None, len(features)))

    def seen(strokes: Sketch, cameras: Cameras, hatch: Hatch | None) -> list[Sketch]:
        views = lines_for_pixels(strokes, cameras, shown, options.contours, told, hatch)
        drawn = [_drawn(lines, options, mesh, colors) for lines in views]
        if len(shown) == len(mesh):
            return drawn
        return [without_specks(each, 3 * mesh.size / FINE_CELLS) for each in drawn]

    strokes = seen(features, cameras, None)
    cameras, widen = filled(cameras, "page", ink_boxes(strokes))
    strokes = [widened(each, widen) for each in strokes]
    if (hatch := options.tone.made()) is not None:
        # Lines are as far apart as asked in the pictures that are fitted.
        strokes = seen(widened(features, widen), cameras, hatch)
    for i, each in enumerate(strokes):
        yield render(each, cameras[i]).color[0].float()


def _drawn(lines: Lines, options: MeshOptions, mesh: TriangleMesh, colors: SurfaceColors | None) -> Sketch:
    """What is drawn in a view; contours, which are the view's own, in the colours of what is seen of them."""
    layers = lines.layers(options.hidden)
    drawn = thinned(lines.drawn(options.hidden), layers, options.tangent)
    own = [i for i, layer in enumerate(layers) if layer.startswith(CONTOUR)]
    if colors is None or not own:
        return drawn
    color = drawn.color.clone()
    color[own] = colored(drawn[own], mesh, colors).color
    return replace(drawn, color=color)


def _told(options: MeshOptions) -> dict[str, object]:
    """The options for run.json."""
    told = asdict(replace(options))
    return {**told.pop("view"), **told.pop("tone"), **told}
