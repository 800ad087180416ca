"""Posed pictures to a 3D sketch: what `diff3ds views` does."""

import dataclasses
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.detectors.hed import require_hed
from diff3ds.edges.evidence.edge_views import require_perspective
from diff3ds.formats import save_png, tile_images
from diff3ds.formats.png import size_of
from diff3ds.library.demo import DEMO_SIZE, demo_cameras, demo_sketch
from diff3ds.optimize.checkpoint import read_checkpoint
from diff3ds.optimize.fit import fit
from diff3ds.photogrammetry.edge_maps import edge_maps_of
from diff3ds.photogrammetry.project import NoCamerasError, find_project
from diff3ds.pictures.content.background import color_or_path, described, parse_background, with_alpha
from diff3ds.pictures.content.clean_plates import CleanPlates, load_clean_plates
from diff3ds.pictures.content.cutout import is_inverted
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.pictures.reading.load_views import Told
from diff3ds.pictures.store import opaque_views, store_of
from diff3ds.render import render
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import Sketch
from diff3ds.surfaces.mesh import TriangleMesh
from diff3ds.tasks.cameras.options import CamerasOptions
from diff3ds.tasks.cameras.run import TRANSFORMS, are_estimated, run_cameras
from diff3ds.tasks.progress import Progress, Report, StageTimes, Stopped
from diff3ds.tasks.results import RunInfo, check_output_folder, evenly_spaced, output_folder, write_results
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.start_sketch import digest_of, finished, held, load_start
from diff3ds.tasks.views.color_sketch import color_scores, held_out_views, plan_color
from diff3ds.tasks.views.detected_edges import detect_edges
from diff3ds.tasks.views.edge_sketch import fit_edges
from diff3ds.tasks.views.hull_surface import hull_surface
from diff3ds.tasks.views.options import ViewsOptions
from diff3ds.tasks.views.placed import PLACED, along_lines, placing_of
from diff3ds.tasks.views.plan import Fitted, Plan
from diff3ds.tasks.views.random_start import plan_random_edges
from diff3ds.tasks.views.refined_cameras import REFINED, save_refined

# Where cameras of photographs are kept.
CAMERAS = "cameras"
# The state of a gradient descent, and what a reconstruction of edges has reached.
CHECKPOINT, EDGES_CHECKPOINT = "checkpoint.safetensors", "edges.safetensors"
PREVIEWS = 8
# A picture of some of the pictures, there as soon as there are strokes beside which to see it.
TARGETS = "targets.png"
# A sketch that reaches farther, in radii of what the pictures show, is of another world. Empirical.
FARTHEST = 10.0
# Gray of what masks leave out, lens distortion takes away, or smaller pictures do not have.
UNKNOWN = 0.5


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
        FileNotFoundError, ValueError: as `find_project`, `load_posed`, `load_clean_plates`, `frame_of`, `fit` and
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
    if source is None and (options.up == "auto" or options.scale is not None):
        raise ValueError("the embedded scene is upright and has a size: leave --up and --scale out")
    if options.detector == "hed":
        # Said before cameras are looked for, which takes minutes.
        require_hed()
    given = None if options.start is None else load_start(options.start, out)
    times = StageTimes()

    def timed(progress: Progress) -> None:
        times.begin(progress.stage)
        report(progress)

    with output_folder(out), logged(out, timed, say) as (told, said):
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
    path = _cameras_of(source, out, options, report, say) if source is not None else None
    pictures = demo_pictures(options.size) if path is None else _pictures(path, out, options, report, say)
    clean_plates = _clean_plates(pictures, path, options, out, report)
    _say_before(options, pictures, say)
    placing = None if path is None else placing_of(path, options.pictures, options)
    # Silhouettes may be wanting, which is said before anything is overwritten.
    surface = _surface(pictures, clean_plates, options, report) if options.contours else None
    read = time.perf_counter()
    if options.overwrite and not options.resume:
        # Killed before its first checkpoint, the new run must not go on from the old one's.
        for checkpoint in (CHECKPOINT, EDGES_CHECKPOINT):
            (out / checkpoint).unlink(missing_ok=True)
    report = after_targets(pictures, out, report)
    refining = options.refining(pictures.target, path is not None and are_estimated(path))
    if refining and not options.refine_cameras:
        say("the cameras were found from photographs: they are refined on the edges, unless --keep-cameras is given")
    chosen = dataclasses.replace(options, refine_cameras=refining)
    fitted = _fitted(pictures, clean_plates, path, chosen, given, out, report, say)
    if placing is not None:
        placing = along_lines(placing, fitted.sketch, options)
        say(placing.line)
        cameras = placing.cameras(fitted.pictures.cameras)
        fitted = dataclasses.replace(
            fitted,
            sketch=placing.sketch(fitted.sketch),
            pictures=dataclasses.replace(fitted.pictures, cameras=cameras),
            chosen={**fitted.chosen, "placed": placing.about},
        )
        surface = None if surface is None else placing.surface(surface)
    shown = preview(fitted.sketch, fitted.pictures, surface)
    info = RunInfo(
        {"source": str(source) if source else "demo", **dataclasses.asdict(options)},
        {"target": pictures.target, **fitted.chosen, "stages": times.seconds()},
        {"read": read - begun, "fit": time.perf_counter() - read},
        fitted.losses,
        fitted.scores,
        fitted.stopped,
    )
    write_results(out, fitted.sketch, fitted.pictures.cameras, shown, info, surface)
    if path is not None and (fitted.refined or placing is not None):
        views = list(fitted.refined or range(len(pictures)))
        zoom = fitted.chosen["cameras"]["focal"] if fitted.refined else 1.0
        if placing is not None and fitted.pictures.cameras.orthographic:
            zoom /= placing.scale
        file = out / (REFINED if fitted.refined else PLACED)
        points = pictures.points
        if points is not None and placing is not None:
            points = placing.scale * points @ placing.turn.mT
        target = options.pictures or pictures.target
        save_refined(file, path, target, views, fitted.pictures.cameras[views], zoom, points)
    return fitted


def _cameras_of(source: Path, out: Path, options: ViewsOptions, report: Report, say: Callable[[str], None]) -> Path:
    """The file with the cameras; of photographs without one they are found first, and kept in the folder `cameras`."""
    try:
        return find_project(source, options.pictures)
    except NoCamerasError as missing:
        if not missing.pictures:
            raise
        if options.edges:
            edge_maps_of(missing.pictures, [size_of(picture) for picture in missing.pictures], options.edges)
        kept = out / CAMERAS / TRANSFORMS
        if kept.is_file() and options.resume:
            return kept
        say(f"{source}: photographs without cameras. These are found first, and kept in {kept}")
        return run_cameras(source, kept.parent, CamerasOptions(), report, say)


def _pictures(
    path: Path, out: Path, options: ViewsOptions, report: Report, say: Callable[[str], None]
) -> PosedPictures:
    told, edges = _counted("read", report), options.edges
    if options.detector == "hed":
        edges = detect_edges(path, out, options.size, options.resume, report, say)
    return load_posed(path, options.target, options.size, out, options.masks, told, edges)


def _counted(stage: str, report: Report) -> Told:
    """Reports of a stage that counts."""
    return lambda done, total: report(Progress(stage, done, total, None, 0))


def _say_before(options: ViewsOptions, pictures: PosedPictures, say: Callable[[str], None]) -> None:
    """Says which options change nothing, and which pictures are treated in another way than the rest."""
    target = pictures.target
    if unused := options.unused(target):
        how = target if target == "color" else f"{target} --init {options.init}"
        say(f"{', '.join(unused)}: no effect with --target {how}")
    if pictures.masked and options.masks == "ignore":
        some = f"{pictures.masked} of {len(pictures)} pictures" if pictures.masked < len(pictures) else "the pictures"
        say(f"masks: what is black in the masks of {some} counts nowhere; if white is the object, say --masks object")
    if target != "edges" and is_inverted(pictures.batch(evenly_spaced(len(pictures), PREVIEWS)).alpha):
        say("the pictures are opaque all along their borders, and transparent inside: are alpha or masks inverted?")
    if target == "color" and 0 < (opaque := int(opaque_views(pictures.store).sum())) < len(pictures):
        behind = options.background or "the colour along their borders"
        say(f"{opaque} of {len(pictures)} pictures have no transparent areas: {behind} is taken for their background")


def _fitted(
    pictures: PosedPictures,
    clean_plates: CleanPlates | None,
    path: Path | None,
    options: ViewsOptions,
    given: Sketch | None,
    out: Path,
    report: Report,
    say: Callable[[str], None],
) -> Fitted:
    """Fits a sketch in the way that suits the pictures."""
    if pictures.target == "color":
        return _fit_color(pictures, clean_plates, path, options, given, out, report)
    if given is not None:
        return _fit_given_edges(pictures, options, given, out, report)
    if options.init == "random":
        return _fit_random_edges(pictures, options, out, report, say)
    return fit_edges(pictures, options, out / EDGES_CHECKPOINT, report, say=say)


def _surface(
    pictures: PosedPictures, clean_plates: CleanPlates | None, options: ViewsOptions, report: Report
) -> TriangleMesh:
    """The surface of what the pictures show."""
    report(Progress("visual hull", 0, None, None, 0))
    if pictures.target == "edges":
        return hull_surface(pictures)
    color = None if options.background is None or clean_plates else parse_background(options.background)
    return hull_surface(with_alpha(pictures, clean_plates or color)[0])


def preview(sketch: Sketch, pictures: PosedPictures, surface: TriangleMesh | None = None) -> Float[Tensor, "H W 3"]:
    """Eight views, each target beside the rendering of the sketch; gray is what is not known of a target.

    Args:
        sketch: in the world of the cameras.
        pictures: the targets.
        surface: hides lines of the sketch, and is drawn by its contours.
    """
    drawn = render(sketch, pictures.cameras[evenly_spaced(len(pictures), PREVIEWS)], surface=surface).color
    return tile_images(torch.cat([_some(pictures), drawn.clamp(0, 1)], 2), columns=2)


def _some(pictures: PosedPictures) -> Float[Tensor, "B H W 3"]:
    """The pictures of the preview's views; gray is what is not known of them."""
    targets = pictures.batch(evenly_spaced(len(pictures), PREVIEWS))
    return torch.where(targets.known[..., None], targets.images, torch.tensor(UNKNOWN))


def after_targets(pictures: PosedPictures, out: Path, report: Report) -> Report:
    """Reports that write `TARGETS` before the first of them that has strokes."""
    written = False

    def told(progress: Progress) -> None:
        nonlocal written
        if progress.sketch is not None and not written:
            written = True
            save_png(out / TARGETS, tile_images(_some(pictures), columns=4))
        report(progress)

    return told


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


def _fit_color(
    pictures: PosedPictures,
    clean_plates: CleanPlates | None,
    path: Path | None,
    options: ViewsOptions,
    given: Sketch | None,
    out: Path,
    report: Report,
) -> Fitted:
    held_out_views(path)
    # Torch's own threads wait for each other busily, which takes the time of those that work where others do as well.
    with torch_on_one_thread():
        plan = _going_on(plan_color(pictures, options, out / CHECKPOINT, clean_plates, report), given, options)
    sketch, losses, stopped = _descended(plan, "fit", report)
    world = _in_world(sketch, plan, given)
    chosen = {"steps": plan.config.steps, "strokes": len(plan.start), "background": described(plan.background)}
    scores: dict[str, float] = {}
    try:
        with torch_on_one_thread():
            scores = color_scores(world, plan, path, options.masks, report)
    except KeyboardInterrupt:
        # The sketch is there, and is written without them.
        stopped = True
    return Fitted(world, plan.pictures, chosen, losses, scores, stopped)


def _fit_given_edges(
    pictures: PosedPictures, options: ViewsOptions, given: Sketch, out: Path, report: Report
) -> Fitted:
    """The strokes of the user, pulled onto the lines of edge maps or drawings."""
    if pictures.target != "edges":
        raise ValueError("--from follows edge maps, drawings and colours: give --target edges or color")
    plan = _going_on(plan_random_edges(pictures, options, out / CHECKPOINT), given, options)
    sketch, losses, stopped = _descended(plan, "fit", report)
    chosen = {"steps": plan.config.steps, "strokes": len(plan.start)}
    return Fitted(_in_world(sketch, plan, given), pictures, chosen, losses, {}, stopped)


def _going_on(plan: Plan, given: Sketch | None, options: ViewsOptions) -> Plan:
    """The plan with the strokes of the user, which keep their number, where there are some."""
    if given is None or options.start is None:
        return plan
    start = plan.frame.from_world(given)
    reach = float(start.points.norm(dim=-1).max())
    if reach > FARTHEST:
        raise ValueError(
            f"{options.start}: its strokes reach {reach:.3g} times as far as what the pictures show: is it in the "
            "world of their cameras?"
        )
    identity = {**plan.config.identity, "start": digest_of(options.start)}
    config = dataclasses.replace(plan.config, refinements=(), constraints=held(start), identity=identity)
    return dataclasses.replace(plan, start=start, config=config)


def _in_world(sketch: Sketch, plan: Plan, given: Sketch | None) -> Sketch:
    world = plan.frame.to_world(sketch)
    return world if given is None else finished(world, given, plan.config.rates)


def _fit_random_edges(
    pictures: PosedPictures, options: ViewsOptions, out: Path, report: Report, say: Callable[[str], None]
) -> Fitted:
    if pictures.target != "edges":
        raise ValueError("random curves find the lines of edge maps and drawings only: leave --init out")
    # Which is what cleans the curves up in the end.
    require_perspective(pictures.cameras)
    plan = plan_random_edges(pictures, options, out / CHECKPOINT)
    sketch, losses, stopped = _descended(plan, "random curves", report)
    chosen = {"steps": plan.config.steps, "strokes": len(plan.start)}
    if stopped:
        return Fitted(plan.frame.to_world(sketch), pictures, chosen, losses, {}, stopped)
    try:
        clean = fit_edges(pictures, options, out / EDGES_CHECKPOINT, report, sketch, say)
    except KeyboardInterrupt:
        # Before anything was cleaned up.
        return Fitted(plan.frame.to_world(sketch), pictures, chosen, losses, {}, stopped=True)
    return dataclasses.replace(clean, chosen={**chosen, **clean.chosen}, losses=[*losses, *clean.losses])


def _descended(plan: Plan, stage: str, report: Report) -> tuple[Sketch, list[float], bool]:
    """The last complete sketch of a gradient descent, its losses, and whether Ctrl-C came before the end."""
    checkpoint, total = plan.config.checkpoint, plan.config.steps
    assert checkpoint is not None
    stopped = False
    report(Progress(stage, 0, total, None, len(plan.start)))
    with closing(fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config)) as steps:
        try:
            for step in steps:
                told = Progress(stage, step.index + 1, total, step.loss, len(step.sketch))
                report(dataclasses.replace(told, sketch=partial(plan.frame.to_world, step.sketch)))
        except KeyboardInterrupt:
            stopped = True
    state = read_checkpoint(checkpoint)
    return state.sketch, list(state.losses), stopped
