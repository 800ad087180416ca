"""What a run of `diff3ds views` looks at: cameras, pictures, what is behind them, and the surface of what they show."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from diff3ds.camera import evenly_spaced
from diff3ds.formats.png import size_of
from diff3ds.library.demo import DEMO_SIZE, demo_cameras, demo_sketch
from diff3ds.photogrammetry.edge_maps import edge_maps_of
from diff3ds.photogrammetry.find_project import NoCameras, present_views, project_of
from diff3ds.pictures.content.background import color_or_path, parse_background, with_alpha
from diff3ds.pictures.content.clean_plates import CleanPlates, load_clean_plates
from diff3ds.pictures.content.cutout import is_inverted
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.pictures.reading.load_views import Told
from diff3ds.pictures.store import opaque_views, store_of
from diff3ds.render import render
from diff3ds.surfaces.shape.hull_surface import hull_surface
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.cameras.registration_options import RegistrationOptions
from diff3ds.tasks.cameras.run_cameras import TRANSFORMS, run_cameras
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.views.beside_targets import PREVIEWS
from diff3ds.tasks.views.network_maps.cut_out import cut_out
from diff3ds.tasks.views.network_maps.detected_edges import detect_edges
from diff3ds.tasks.views.placed import Placing, placing_of
from diff3ds.tasks.views.views_options import SIZE, ViewsOptions

# [pictures, px; empirical] Fewer photographs are kept larger, half as many twice as large, but no larger than this:
# what few views show is in their details.
MANY, LARGEST = 22, 1024
# Pictures in which edges are looked for (docs/results/photographs.md).
FEWEST = 8
# Where cameras of photographs are kept.
CAMERAS = "cameras"


@dataclass(frozen=True, eq=False)
class Scene:
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


def sized(source: Path | None, options: ViewsOptions) -> ViewsOptions:
    """The options with the size of the pictures, which depends on how many photographs there are.

    Raises:
        FileNotFoundError, ValueError: as `project_of` and `present_views`.
    """
    if source is None or options.size is not None or options.pictures != "color-edges":
        return replace(options, size=options.longest)
    with warnings.catch_warnings():
        # They are said when the pictures are read.
        warnings.simplefilter("ignore")
        found = project_of(source, options.pictures)
        pictures = found.pictures if isinstance(found, NoCameras) else present_views(found, options.pictures)
    size = min(round(SIZE * MANY / max(len(pictures), 1)), LARGEST)
    return replace(options, size=max(size, SIZE))


def read_scene(
    source: Path | None, out: Path, options: ViewsOptions, report: Report, say: Callable[[str], None]
) -> Scene:
    """Reads all that a run looks at, and says what a user should know of it before the fit."""
    path = _cameras_of(source, out, options, report, say) if source is not None else None
    pictures = demo_pictures(options.longest) if path is None else _pictures(path, out, options, report, say)
    clean_plates = _clean_plates(pictures, path, options, out, report)
    _say_before(options, pictures, say)
    placing = None if path is None else placing_of(path, options.pictures, options)
    # Silhouettes may be wanting, which is said before anything is overwritten.
    surface = surface_of(pictures, clean_plates, options, report) if options.contours else None
    return Scene(path, pictures, clean_plates, placing, surface)


def surface_of(
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
        cut = cut_out(path, options.pictures, out, options.longest, options.resume, report)
    if options.detector == "hed":
        edges = detect_edges(path, out, options.longest, options.resume, report, say)
    pictures = load_posed(path, options.target, options.longest, out, options.masks, told, edges, cut)
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
    looked_for = target != "color" and options.init == "carve" and options.start is None
    if looked_for and len(pictures) < FEWEST:
        say(
            f"{len(pictures)} pictures are few: lines are told from chance by the views that agree on them, so that "
            f"many will be missing; {FEWEST} are the fewest that were measured"
        )
    if pictures.masked and options.masks == "ignore" and not options.cut_out:
        some = f"{pictures.masked} of {len(pictures)} pictures" if pictures.masked < len(pictures) else "the pictures"
        say(f"masks: what is black in the masks of {some} counts nowhere; if white is the object, say --masks object")
    if target != "edges" and is_inverted(pictures.batch(evenly_spaced(len(pictures), PREVIEWS)).alpha):
        say("the pictures are opaque all along their borders, and transparent inside: are alpha or masks inverted?")
    if target == "color" and 0 < (opaque := int(opaque_views(pictures.store).sum())) < len(pictures):
        behind = options.background or "the colour along their borders"
        say(f"{opaque} of {len(pictures)} pictures have no transparent areas: {behind} is taken for their background")


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
    return load_clean_plates(path, background, options.longest, scratch, _counted("read backgrounds", report))
