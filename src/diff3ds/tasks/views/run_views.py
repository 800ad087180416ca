"""Posed pictures to a 3D sketch: what `diff3ds views` does."""

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from diff3ds.camera import evenly_spaced
from diff3ds.curves.importance import ranked
from diff3ds.detectors.hed import require_hed
from diff3ds.edges.clean.false_strokes import false_strokes
from diff3ds.edges.reconstruct import NoEdgesError
from diff3ds.edges.watch import no_report, not_said
from diff3ds.formats.png import size_of
from diff3ds.library.demo import DEMO_SIZE, demo_cameras, demo_sketch
from diff3ds.photogrammetry.edge_maps import edge_maps_of
from diff3ds.photogrammetry.find_project import NoCameras, project_of
from diff3ds.photogrammetry.markers import require_opencv
from diff3ds.pictures.content.background import color_or_path, parse_background, with_alpha
from diff3ds.pictures.content.clean_plates import CleanPlates, load_clean_plates
from diff3ds.pictures.content.cutout import is_inverted
from diff3ds.pictures.content.foreground import require_rembg
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.pictures.reading.decoded_once import decoded_once
from diff3ds.pictures.reading.load_views import Told
from diff3ds.pictures.reading.read_view import DECODED
from diff3ds.pictures.store import opaque_views, store_of
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.hull_surface import hull_surface
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.cameras.registration_options import RegistrationOptions
from diff3ds.tasks.cameras.run_cameras import TRANSFORMS, are_estimated, run_cameras
from diff3ds.tasks.mesh.draw_mesh import sketch_mesh
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.progress import Progress, Report, StageTimes, Stopped
from diff3ds.tasks.results import SURFACE, RunInfo, check_output_folder, output_folder, write_results
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.start_sketch import load_start
from diff3ds.tasks.views.beside_targets import PREVIEWS, after_targets, preview
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
from diff3ds.tasks.views.network_maps.cut_out import INSTEAD, cut_out
from diff3ds.tasks.views.network_maps.detected_edges import detect_edges
from diff3ds.tasks.views.placed import PLACED, Placing, along_lines, placing_of
from diff3ds.tasks.views.plan import Fitted
from diff3ds.tasks.views.views_options import ViewsOptions

# Where cameras of photographs are kept.
CAMERAS = "cameras"
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

    with output_folder(out), logged(out, timed, say) as (told, said), decoded_once(DECODED * options.size):
        fitted = _run(source, out, options, given, told, said, times)
    if fitted.stopped:
        raise Stopped
    return fitted.sketch


@dataclass(frozen=True, eq=False)
class _Scene:
    """What a run looks at.

    Attributes:
        path: project of the pictures; None for the package's own.
        pictures: with their cameras.
        clean_plates: what lies behind them, if the options name pictures of it.
        placing: what becomes of their world, if anything does.
        surface: of what they show, if it is asked for.
    """

    path: Path | None
    pictures: PosedPictures
    clean_plates: CleanPlates | None
    placing: Placing | None
    surface: TriangleMesh | None


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
    scene = _read(source, out, options, report, say)
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
    fitted, scene = _placed(fitted, scene, options, say)
    # Outlines of its surface are drawn exactly, each view's own.
    strokes = fitted.sketch[:0] if OUTLINES in fitted.chosen else fitted.sketch
    shown = preview(strokes, fitted.pictures, scene.surface)
    info = RunInfo(
        {"source": str(source) if source else "demo", **dataclasses.asdict(options)},
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
    sketch = write_results(out, sketch, fitted.pictures.cameras, shown, info, scene.surface)
    if scene.path is not None and (fitted.refined or scene.placing is not None):
        _write_cameras(out, scene.path, scene, fitted, options)
    return dataclasses.replace(fitted, sketch=sketch)


def _read(source: Path | None, out: Path, options: ViewsOptions, report: Report, say: Callable[[str], None]) -> _Scene:
    """Reads all that a run looks at, and says what a user should know of it before the fit."""
    path = _cameras_of(source, out, options, report, say) if source is not None else None
    pictures = demo_pictures(options.size) if path is None else _pictures(path, out, options, report, say)
    clean_plates = _clean_plates(pictures, path, options, out, report)
    _say_before(options, pictures, say)
    placing = None if path is None else placing_of(path, options.pictures, options)
    # Silhouettes may be wanting, which is said before anything is overwritten.
    surface = _surface(pictures, clean_plates, options, report) if options.contours else None
    return _Scene(path, pictures, clean_plates, placing, surface)


def _with_refining(scene: _Scene, options: ViewsOptions, say: Callable[[str], None]) -> ViewsOptions:
    """The options, in which cameras are refined if they have to be, even unasked."""
    refining = options.refining(scene.pictures.target, scene.path is not None and are_estimated(scene.path))
    if refining and not options.refine_cameras:
        say("the cameras were found from photographs: they are refined on the edges, unless --keep-cameras is given")
    return dataclasses.replace(options, refine_cameras=refining)


def _without_outlines(fitted: Fitted, surface: TriangleMesh, report: Report, say: Callable[[str], None]) -> Fitted:
    """The sketch without strokes along outlines of smooth parts, of which the surface has the contours."""
    report(Progress("outlines", 0, None, None, len(fitted.sketch)))
    views, ridges = look(fitted.pictures, no_report, not_said)
    false = false_strokes(fitted.sketch, surface, fitted.pictures.cameras[views], ridges)
    # Without a stroke there is no sketch.
    if not bool(false.any()) or bool(false.all()):
        return fitted
    count = int(false.sum())
    say(f"{count} of {len(false)} strokes are outlines of smooth parts, which contours draw: they are left out")
    chosen = {**fitted.chosen, "outlines_left_out": count}
    return dataclasses.replace(fitted, sketch=fitted.sketch[~false], chosen=chosen)


def _placed(fitted: Fitted, scene: _Scene, options: ViewsOptions, say: Callable[[str], None]) -> tuple[Fitted, _Scene]:
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


def _write_cameras(out: Path, path: Path, scene: _Scene, fitted: Fitted, options: ViewsOptions) -> None:
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


def _cameras_of(source: Path, out: Path, options: ViewsOptions, report: Report, say: Callable[[str], None]) -> Path:
    """The file with the cameras; of photographs without one they are found first, and kept in the folder `cameras`."""
    found = project_of(source, options.pictures)
    if not isinstance(found, NoCameras):
        return found
    # Cameras that are there are not estimated anew unasked.
    if not found.pictures or found.not_read:
        raise found.error()
    if options.edges:
        edge_maps_of(found.pictures, [size_of(picture) for picture in found.pictures], options.edges)
    kept = out / CAMERAS / TRANSFORMS
    if kept.is_file() and options.resume:
        return kept
    say(f"{source}: photographs without cameras. These are found first, and kept in {kept}")
    return run_cameras(source, kept.parent, RegistrationOptions(), report, say)


def _pictures(
    path: Path, out: Path, options: ViewsOptions, report: Report, say: Callable[[str], None]
) -> PosedPictures:
    told, edges, cut = _counted("read", report), options.edges, None
    if options.cut_out:
        cut = cut_out(path, options.pictures, out, options.size, options.resume, report)
    if options.detector == "hed":
        edges = detect_edges(path, out, options.size, options.resume, report, say)
    pictures = load_posed(path, options.target, options.size, out, options.masks, told, edges, cut)
    if cut is not None and pictures.target == "edges" and edges is None:
        raise ValueError(f"{path}: the pictures are line drawings, of which nothing is cut out: leave --cut-out out")
    return pictures


def _counted(stage: str, report: Report) -> Told:
    """Reports of a stage that counts."""
    return lambda done, total: report(Progress(stage, done, total, None, 0))


def _say_before(options: ViewsOptions, pictures: PosedPictures, say: Callable[[str], None]) -> None:
    """Says which options change nothing, and which pictures are treated in another way than the rest."""
    target = pictures.target
    if unused := options.unused(target):
        how = target if target == "color" else f"{target} --init {options.init}"
        say(f"{', '.join(unused)}: no effect with --target {how}")
    if pictures.masked and options.masks == "ignore" and not options.cut_out:
        some = f"{pictures.masked} of {len(pictures)} pictures" if pictures.masked < len(pictures) else "the pictures"
        say(f"masks: what is black in the masks of {some} counts nowhere; if white is the object, say --masks object")
    if target != "edges" and is_inverted(pictures.batch(evenly_spaced(len(pictures), PREVIEWS)).alpha):
        say("the pictures are opaque all along their borders, and transparent inside: are alpha or masks inverted?")
    if target == "color" and 0 < (opaque := int(opaque_views(pictures.store).sum())) < len(pictures):
        behind = options.background or "the colour along their borders"
        say(f"{opaque} of {len(pictures)} pictures have no transparent areas: {behind} is taken for their background")


def _fitted(
    scene: _Scene,
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


def _surface(
    pictures: PosedPictures,
    clean_plates: CleanPlates | None,
    options: ViewsOptions,
    report: Report,
) -> TriangleMesh:
    """The surface of what the pictures show."""
    report(Progress("visual hull", 0, None, None, 0))
    if pictures.target == "edges":
        return hull_surface(pictures)
    color = None if options.background is None or clean_plates else parse_background(options.background)
    return hull_surface(with_alpha(pictures, clean_plates or color)[0])


def _surface_again(
    scene: _Scene, fitted: Fitted, options: ViewsOptions, report: Report, say: Callable[[str], None]
) -> TriangleMesh | None:
    """The surface by the refined cameras; by those before them if they show none, which must not cost the sketch."""
    try:
        plates = scene.clean_plates and scene.clean_plates.refined(fitted.lens, fitted.refined)
        return _surface(fitted.pictures, plates, options, report)
    except ValueError as error:
        say(f"{error} This is of the refined cameras: {SURFACE} is by those that were given")
        return scene.surface


def demo_pictures(size: int = DEMO_SIZE) -> PosedPictures:
    """Line drawings of the package's own scene from all around, reduced to this size as other pictures are."""
    cameras = demo_cameras(size=min(size, DEMO_SIZE))
    alpha = render(demo_sketch(), cameras).alpha
    return PosedPictures(cameras, "edges", store_of(alpha[..., None]), tuple(f"view {i}" for i in range(len(cameras))))


def _clean_plates(
    pictures: PosedPictures, path: Path | None, options: ViewsOptions, scratch: Path, report: Report
) -> CleanPlates | None:
    """The pictures that lie behind, if the options name some."""
    background = None if options.background is None else color_or_path(options.background)
    if not isinstance(background, Path):
        return None
    if path is None or pictures.target != "color":
        raise ValueError(f"{background}: a background picture is for --target color, not {pictures.target}")
    return load_clean_plates(path, background, options.size, scratch, _counted("read backgrounds", report))
