"""Posed pictures to a 3D sketch: what `diff3ds views` does."""

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path

from diff3ds._settings import option_values
from diff3ds.curves.importance import ranked
from diff3ds.detectors.hed import require_hed
from diff3ds.edges.clean.false_strokes import false_strokes
from diff3ds.edges.reconstruct import NoEdgesError
from diff3ds.edges.watch import no_report, not_said
from diff3ds.photogrammetry.markers import require_opencv
from diff3ds.pictures.content.foreground import require_rembg
from diff3ds.pictures.reading.decoded_once import decoded_once
from diff3ds.pictures.reading.read_view import DECODED
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.cameras.run_cameras import are_estimated
from diff3ds.tasks.detail_options import DetailOptions
from diff3ds.tasks.mesh.draw_mesh import sketch_mesh
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.progress import Progress, Report, StageTimes, Stopped
from diff3ds.tasks.results import SURFACE, RunInfo, check_output_folder, output_folder, write_results
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.sketch_input import at_level
from diff3ds.tasks.start_sketch import load_start
from diff3ds.tasks.views.beside_targets import after_targets, preview
from diff3ds.tasks.views.descents import (
    CHECKPOINT,
    EDGES_CHECKPOINT,
    fit_color,
    fit_given_edges,
    fit_random_edges,
)
from diff3ds.tasks.views.edge_fit.edge_sketch import fit_edges
from diff3ds.tasks.views.edge_fit.edges_of_pictures import look
from diff3ds.tasks.views.edge_fit.refined_cameras import REFINED, save_refined
from diff3ds.tasks.views.network_maps.cut_out import INSTEAD
from diff3ds.tasks.views.placed import PLACED, along_lines
from diff3ds.tasks.views.plan import Fitted
from diff3ds.tasks.views.read_scene import Scene, read_scene, sized, surface_of
from diff3ds.tasks.views.views_options import ViewsOptions

# Says in run.json how many strokes are outlines of the surface, where there are no others.
OUTLINES = "outlines_of_surface"


def run_views(
    source: Path | None,
    out: Path,
    options: ViewsOptions | None = None,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Sketch:
    """Fits a sketch to posed pictures and writes sketch.json, .svg, .step, preview.png and run.json.

    Ctrl-C ends the fit early; what was reached is written, then `Stopped` is raised, a KeyboardInterrupt.

    Args:
        source: a transforms.json or a folder with one; None is the scene that the package generates.
        out: folder of the results and of the checkpoint.
        options: default `ViewsOptions()`.
        report: called after every step and stage.
        say: called with what a user should know before the fit: options that change nothing.

    Returns:
        The sketch in the world of the cameras.

    Raises:
        FileNotFoundError, ValueError: as `project_of`, `load_posed`, `load_clean_plates`, `frame_of`, `fit` and
            `reconstruct`; a background picture for what has no colours; a folder that holds another run.
        OSError: the folder cannot be made, or there is no room.
    """
    options = options or ViewsOptions()
    if not options.resume:
        for checkpoint in (CHECKPOINT, EDGES_CHECKPOINT):
            check_output_folder(out, out / checkpoint, resume=False, overwrite=options.overwrite)
    if source is None and options.pictures not in (None, "edges"):
        needless = "--edges" if options.edges else "--detector" if options.detector == "hed" else "--target"
        raise ValueError(f"the embedded scene is line drawings (--target edges): leave {needless} out")
    if source is None and options.cut_out:
        raise ValueError("the embedded scene is line drawings, of which nothing is cut out: leave --cut-out out")
    if source is None and (options.up == "auto" or options.scale is not None):
        raise ValueError("the embedded scene is upright and has a size: leave --up and --scale out")
    if options.detector == "hed":
        # Said before cameras are looked for, which takes minutes.
        require_hed()
    if options.cut_out:
        require_rembg(INSTEAD)
    require_opencv(options.between)
    given = None if options.start is None else load_start(options.start, out)
    times = StageTimes()

    def timed(progress: Progress) -> None:
        times.begin(progress.stage)
        report(progress)

    options = sized(source, options)
    with output_folder(out), logged(out, timed, say) as (told, said), decoded_once(DECODED * options.longest):
        fitted = _run(source, out, options, given, told, said, times)
    if fitted.stopped:
        raise Stopped
    return fitted.sketch


def _run(
    source: Path | None,
    out: Path,
    options: ViewsOptions,
    given: Sketch | None,
    report: Report,
    say: Callable[[str], None],
    times: StageTimes,
) -> Fitted:
    """Reads, fits and writes."""
    begun = time.perf_counter()
    scene = read_scene(source, out, options, report, say)
    read = time.perf_counter()
    if options.overwrite and not options.resume:
        # Killed before its first checkpoint, the new run must not go on from the old one's.
        for checkpoint in (CHECKPOINT, EDGES_CHECKPOINT):
            (out / checkpoint).unlink(missing_ok=True)
    report = after_targets(scene.pictures, out, report)
    fitted = _fitted(scene, _with_refining(scene, options, say), given, out, report, say)
    if scene.surface is not None and fitted.refined:
        scene = dataclasses.replace(scene, surface=_surface_again(scene, fitted, options, report, say))
    if scene.surface is not None and scene.pictures.target != "color" and OUTLINES not in fitted.chosen:
        fitted = _without_outlines(fitted, scene.surface, report, say)
    # Colours and random curves are fitted with so many strokes from the start.
    found = scene.pictures.target != "color" and options.init == "carve"
    fitted = _at_level(fitted, DetailOptions(options.detail, options.strokes if found else None), say)
    fitted, scene = _placed(fitted, scene, options, say)
    # Outlines of its surface are drawn exactly, each view's own.
    strokes = fitted.sketch[:0] if OUTLINES in fitted.chosen else fitted.sketch
    shown = preview(strokes, fitted.pictures, scene.surface) if options.page.page is None else None
    info = RunInfo(
        {"source": str(source) if source else "demo", **option_values(options)},
        {"target": scene.pictures.target, **fitted.chosen, "stages": times.seconds()},
        {"read": read - begun, "fit": time.perf_counter() - read},
        fitted.losses,
        fitted.scores,
        fitted.stopped,
    )
    # Lines in pockets, which a hull fills, are seen as well as others.
    sketch = fitted.sketch
    if sketch.importance is None:
        sketch = ranked(sketch, sort=options.start is None).sketch
    sketch = write_results(out, sketch, fitted.pictures.cameras, shown, info, scene.surface, page=options.page)
    if scene.path is not None and (fitted.refined or scene.placing is not None):
        _write_cameras(out, scene.path, scene, fitted, options)
    return dataclasses.replace(fitted, sketch=sketch)


def _with_refining(scene: Scene, options: ViewsOptions, say: Callable[[str], None]) -> ViewsOptions:
    """The options, in which cameras are refined if they have to be, even unasked."""
    refining = options.refining(scene.pictures.target, scene.path is not None and are_estimated(scene.path))
    if refining and not options.refine_cameras:
        say("the cameras were found from photographs: they are refined on the edges, unless --keep-cameras is given")
    return dataclasses.replace(options, refine_cameras=refining)


def _without_outlines(fitted: Fitted, surface: TriangleMesh, report: Report, say: Callable[[str], None]) -> Fitted:
    """The sketch without strokes along outlines of smooth parts, of which the surface has the contours."""
    report(Progress("outlines", 0, None, None, len(fitted.sketch)))
    looked = look(fitted.pictures, no_report, not_said)
    false = false_strokes(fitted.sketch, surface, fitted.pictures.cameras[looked.views], looked.ridges)
    # Without a stroke there is no sketch.
    if not bool(false.any()) or bool(false.all()):
        return fitted
    count = int(false.sum())
    say(f"{count} of {len(false)} strokes are outlines of smooth parts, which contours draw: they are left out")
    chosen = {**fitted.chosen, "outlines_left_out": count}
    return dataclasses.replace(fitted, sketch=fitted.sketch[~false], chosen=chosen)


def _at_level(fitted: Fitted, level: DetailOptions, say: Callable[[str], None]) -> Fitted:
    """The sketch with its most important strokes alone, if all are not asked for."""
    sketch = at_level(fitted.sketch, level).sketch
    if len(sketch) < len(fitted.sketch):
        say(f"{len(sketch)} of {len(fitted.sketch)} strokes are kept, the most important ones")
    return dataclasses.replace(fitted, sketch=sketch)


def _placed(fitted: Fitted, scene: Scene, options: ViewsOptions, say: Callable[[str], None]) -> tuple[Fitted, Scene]:
    """The sketch, its cameras and its surface where the options want them."""
    if scene.placing is None:
        return fitted, scene
    placing = along_lines(scene.placing, fitted.sketch, options)
    say(placing.line)
    cameras = placing.cameras(fitted.pictures.cameras)
    fitted = dataclasses.replace(
        fitted,
        sketch=placing.sketch(fitted.sketch),
        pictures=dataclasses.replace(fitted.pictures, cameras=cameras),
        chosen={**fitted.chosen, "placed": placing.about},
    )
    surface = None if scene.surface is None else placing.surface(scene.surface)
    return fitted, dataclasses.replace(scene, placing=placing, surface=surface)


def _write_cameras(out: Path, path: Path, scene: Scene, fitted: Fitted, options: ViewsOptions) -> None:
    """Writes the cameras of the sketch, where they are others than those of the project."""
    pictures, placing, cameras = scene.pictures, scene.placing, fitted.pictures.cameras
    points, lens = pictures.points, fitted.lens
    if placing is not None:
        if cameras.orthographic:
            lens = dataclasses.replace(lens, zoom=lens.zoom / placing.scale)
        points = None if points is None else placing.scale * points @ placing.turn.mT
    views = fitted.refined or range(len(pictures))
    target = options.pictures or pictures.target
    file = out / (REFINED if fitted.refined else PLACED)
    save_refined(file, path, target, views, cameras, lens, points)


def _fitted(
    scene: Scene,
    options: ViewsOptions,
    given: Sketch | None,
    out: Path,
    report: Report,
    say: Callable[[str], None],
) -> Fitted:
    """Fits a sketch in the way that suits the pictures."""
    pictures = scene.pictures
    if pictures.target == "color":
        return fit_color(pictures, scene.clean_plates, scene.path, options, given, out, report, say)
    if given is not None:
        return fit_given_edges(pictures, options, given, out, report)
    if options.init == "random":
        return fit_random_edges(pictures, options, out, report, say)
    try:
        return fit_edges(pictures, options, out / EDGES_CHECKPOINT, report, say=say)
    except NoEdgesError as error:
        if scene.surface is None:
            raise
        # Outlines alone, as of a ball or a duck: they agree nowhere, and say all the same what it is.
        say(f"{error} The strokes are outlines of its surface from all around, as `diff3ds mesh` draws smooth things")
        made = sketch_mesh(scene.surface, MeshOptions(), report)
        return Fitted(made.sketch, pictures, {OUTLINES: len(made.sketch)}, [], {}, False)


def _surface_again(
    scene: Scene, fitted: Fitted, options: ViewsOptions, report: Report, say: Callable[[str], None]
) -> TriangleMesh | None:
    """The surface by the refined cameras; by those before them if they show none, which must not cost the sketch."""
    try:
        plates = scene.clean_plates and scene.clean_plates.refined(fitted.lens, fitted.refined)
        return surface_of(fitted.pictures, plates, options, report)
    except ValueError as error:
        say(f"{error} This is of the refined cameras: {SURFACE} is by those that were given")
        return scene.surface
