"""A mesh to a sketch: strokes that are there from everywhere, and drawings with contours and without hidden lines."""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from diff3ds._settings import option_values
from diff3ds.formats.movie import save_movie
from diff3ds.losses import lengths
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import Sketch
from diff3ds.surfaces.chosen_strokes import choose_strokes
from diff3ds.surfaces.draw import CONTOUR
from diff3ds.surfaces.fitted_strokes import fit_strokes
from diff3ds.surfaces.form.solid_mesh import SolidMesh
from diff3ds.surfaces.line_drawings import SIZE
from diff3ds.surfaces.lines.feature_curves import outline_share
from diff3ds.surfaces.seen_around import ranked_around
from diff3ds.surfaces.shape.coarse import coarse
from diff3ds.surfaces.shape.colors import colored
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.detail_options import DetailOptions
from diff3ds.tasks.form_lines import thinned
from diff3ds.tasks.mesh.mesh_lines import FixedLines, feature_lines
from diff3ds.tasks.mesh.mesh_options import SMOOTH_STROKES, MeshOptions
from diff3ds.tasks.mesh.mesh_views import FINE_CELLS, MeshViews, cameras_of, in_pictures
from diff3ds.tasks.mesh.solid_lines import layers_of, with_faces
from diff3ds.tasks.mesh.source import LEAST_OUTLINE, read_source
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.results import RunInfo, check_output_folder, write_results
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.sketch_input import at_level

# The turntable, and frames a second.
TURNTABLE, FPS = "turntable.webp", 12
# Borders of a smooth thing that are shorter are cracks, no openings. Empirical.
CRACK = 0.05
# Cells along the longest side of the coarse mesh that stands for a large one: less than a pixel each in the drawings
# that strokes are fitted to. Of the finer one of turntables features are nearer than what counts as on a surface.
FIT_CELLS = 128


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
    # Else a picture that cannot be read would be told after all is found.
    options.tone.made()
    check_output_folder(out, out / "run.json", False, options.overwrite)
    cameras = cameras_of(read.mesh, options)
    seconds = {"read": time.perf_counter() - begun}
    read = read.by_forms(options, say)
    mesh, colors = read.mesh, read.colors
    made = sketch_mesh(mesh, options, report, read.edges)
    made = _at_detail(made, mesh, options.detail)
    if colors is not None:
        made = replace(made, sketch=colored(made.sketch, mesh, colors))
    if made.outlines < LEAST_OUTLINE and CONTOUR in made.kinds:
        say(
            f"the mesh is smooth: its creases and borders draw {made.outlines:.0%} of its outlines; strokes "
            "fitted to outlines from all around are in the sketch, and the drawings have those of their own views"
        )
    seconds["strokes"] = time.perf_counter() - begun - sum(seconds.values())

    def told(done: int) -> None:
        report(Progress("drawings", done, len(cameras), None, len(made.sketch), sketch=made.sketch.detach))

    shown = MeshViews(*made.features, mesh, colors, options)
    drawings = shown.drawings(cameras, told)
    pictures, sheet = drawings.pictures()
    seconds["drawings"] = time.perf_counter() - begun - sum(seconds.values())
    results = _found(mesh, made) | read.told
    info = RunInfo({"source": str(source), **option_values(options)}, results, seconds, [], {}, False)
    sketch = with_faces(thinned(made.sketch, made.kinds, options.tangent), mesh).replace(kinds=made.kinds)
    sketch, order = ranked_around(sketch, mesh)
    # Where the strokes of the drawings are in the sketch that is written.
    place = {stroke: number for number, stroke in enumerate(order)}
    rows = [place[row] for row, kind in enumerate(made.kinds) if kind != CONTOUR]
    names = drawings.write(out, pictures, rows, say)
    if options.turntable:
        save_movie(out / TURNTABLE, shown.frames(report), options.turntable, FPS)
        names.add(TURNTABLE)
    # Last, since run.json says that all of it is there.
    layers = layers_of(sketch.kinds or (), sketch, mesh)
    written = write_results(out, sketch, cameras, sheet, info, mesh, layers, page=options.page)
    for old in (*out.glob("drawing-*.*"), *out.glob(TURNTABLE)):
        # Of a run that is overwritten, all of which was there until now.
        if old.name not in names:
            old.unlink()
    return written


def _at_detail(made: MeshSketch, mesh: TriangleMesh, detail: float) -> MeshSketch:
    """The strokes that say most, in the order that they had."""
    if detail == 1:
        return made
    rows = sorted(at_level(made.sketch, DetailOptions(detail), mesh).strokes)
    return replace(made, sketch=made.sketch[rows], kinds=tuple(made.kinds[row] for row in rows))


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
    return less if less is not mesh else in_pictures(mesh, size)
