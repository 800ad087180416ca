"""Edge maps, line drawings, or the edges of coloured pictures to a sketch of lines, arcs and cubics."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.edges.cameras.coarse_to_fine import refined_cameras
from diff3ds.edges.evidence.edge_views import require_perspective
from diff3ds.edges.evidence.ridges import (
    MOST_INK,
    Ridges,
    color_ridges,
    map_ridges,
    narrowed,
    strongest,
    within,
    without_faint,
)
from diff3ds.edges.reconstruct import reconstruct
from diff3ds.edges.shapes.curve_set import Curves
from diff3ds.edges.shapes.primitives import Kind
from diff3ds.edges.shapes.smooth_joints import sketch_of
from diff3ds.edges.watch import Capped, no_report
from diff3ds.edges.watch import Report as Tell
from diff3ds.pictures.content.line_width import line_width
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.frame import Frame, bound_by_points, frame_of
from diff3ds.pictures.store import is_all_known
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.tasks.progress import Report
from diff3ds.tasks.results import evenly_spaced
from diff3ds.tasks.views.edge_course import EdgeCourse
from diff3ds.tasks.views.options import ViewsOptions
from diff3ds.tasks.views.plan import Fitted
from diff3ds.tasks.views.refined_cameras import Moved, in_world, moves

# Beyond so many views, evenly chosen ones do: the rest would cost memory and say the same. Of large pictures fewer are
# kept, 48 of 3840 x 2160: each pixel takes up to eight bytes.
MOST_VIEWS, MOST_PIXELS, FEWEST_VIEWS = 200, 400_000_000, 3
# Where the pictures are full of edges, fewer views do: as many as have so many ridge points together, or FEW_VIEWS. The
# cost of all that follows is linear in them. 50 pictures of 400 x 400 with `MOST_INK` have so many, CAD models 50,000.
FEW_VIEWS, MOST_RIDGES = 50, 400_000


def fit_edges(
    pictures: PosedPictures,
    options: ViewsOptions,
    checkpoint: Path,
    report: Report,
    start: Sketch | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Fitted:
    """The sketch of what the views' edges agree on.

    Args:
        checkpoint: file that keeps what is reached after each stage.
        report: called as it goes on.
        start: curves in the frame of the views, to refine instead of those found by carving.
        say: called with what there was too much of to look at all.

    Raises:
        ValueError: as `require_perspective`, `frame_of`, `reconstruct` and `read_result`.
        KeyboardInterrupt: before the first curves were found.
    """
    require_perspective(pictures.cameras)
    whole = frame_of(pictures.cameras, pictures.store)
    frame = _bound(whole, pictures, say) if options.bound == "auto" and start is None else whole
    bound = None if frame is whole else {"center": frame.center.tolist(), "radius": frame.radius}
    width = line_width(pictures.store) if pictures.target == "edges" else DEFAULT_WIDTH
    settings = {**_settings(pictures, options), "bound": bound}
    course = EdgeCourse(checkpoint, settings, lambda c: frame.to_world(sketch_of(c, width)), report, say)
    course.begin(options.resume)
    stopped = False
    right: Int[Tensor, " B"] | None = None
    about: dict[str, Any] = {} if bound is None else {"bound": bound}
    try:
        views, ridges = _found(pictures, course.tell, course.cap)
        if options.refine_cameras and start is None:
            # Surroundings tell of cameras as much as the object does.
            pictures, moved = _refined(pictures, views, ridges, whole, course)
            about["cameras"] = moved.about
            for line in moved.lines:
                say(line)
            ridges = [ridges[i] for i in moved.right]
            right = views = views[moved.right]
        reconstruct(
            frame.cameras(pictures.cameras[views]),
            ridges,
            start=None if start is None else _free(start),
            reached=course.kept.result,
            save=course.save,
            report=course.tell,
            capped=course.cap,
            seed=options.seed,
        )
    except KeyboardInterrupt:
        if not course.kept.result.stage:
            raise
        stopped = True
    fitted = _fitted(pictures, course, about, stopped)
    return fitted if right is None else replace(fitted, refined=tuple(right.tolist()))


def _bound(frame: Frame, pictures: PosedPictures, say: Callable[[str], None]) -> Frame:
    """The frame, or a smaller one by the points of the reconstruction, which is said."""
    if pictures.points is None:
        return frame
    smaller = bound_by_points(frame, pictures.cameras, pictures.store, pictures.points)
    if smaller is not frame:
        say(
            f"surroundings all over: curves are looked for where most cameras look, {smaller.radius:.3g} units around "
            f"({', '.join(f'{x:.3g}' for x in smaller.center.tolist())}), by the points of the reconstruction; "
            "--bound none looks everywhere"
        )
    return smaller


def _refined(
    pictures: PosedPictures, views: Int[Tensor, " B"], ridges: list[Ridges], frame: Frame, course: EdgeCourse
) -> tuple[PosedPictures, Moved]:
    """The pictures with refined cameras of these views, and how far those have moved."""
    before = pictures.cameras[views]
    given = frame.cameras(before)
    found = course.kept.refined
    if found is None:
        found = refined_cameras(given, ridges, course.tell)
        course.save_cameras(found)
    after = in_world(frame, found.cameras(given), before)
    pose, lens = pictures.cameras.world_to_camera.clone(), pictures.cameras.intrinsics.clone()
    pose[views], lens[views] = after.world_to_camera, after.intrinsics
    cameras = replace(pictures.cameras, world_to_camera=pose, intrinsics=lens)
    names = [pictures.names[i] for i in views.tolist()]
    return replace(pictures, cameras=cameras), moves(frame, before, after, names, found)


def most_views(size: tuple[int, int]) -> int:
    """Counts the views of this size that are looked at, at most."""
    return max(FEWEST_VIEWS, min(MOST_VIEWS, MOST_PIXELS // (size[0] * size[1])))


def _settings(pictures: PosedPictures, options: ViewsOptions) -> dict[str, object]:
    """Names what must be the same for a run to go on."""
    names = ["init", "seed", "refine_cameras", *(["strokes", "steps", "batch"] if options.init == "random" else [])]
    about = {"target": pictures.target, "size": list(pictures.cameras.size), "pictures": pictures.digest()}
    return {**about, **{name: getattr(options, name) for name in names}}


def _found(pictures: PosedPictures, tell: Tell, capped: Capped) -> tuple[Int[Tensor, " B"], list[Ridges]]:
    """Views that together are not too full of edges, and the edges that all that follows looks at."""
    most = min(len(pictures), most_views(pictures.cameras.size))
    views = evenly_spaced(len(pictures), min(most, FEW_VIEWS))
    known: dict[int, Ridges] = {}
    ridges = ridges_of(pictures, views, tell, known)
    height, width = pictures.cameras.size
    full = int(MOST_INK * height * width)
    if most > len(views):
        ink = min(full, sum(map(len, ridges)) // len(views))
        wanted = min(most, max(FEW_VIEWS, MOST_RIDGES // max(1, ink)))
        if wanted < most:
            capped("views", wanted, most)
        views = evenly_spaced(len(pictures), wanted)
        ridges = ridges_of(pictures, views, tell, known)
    room = min(full * len(views), MOST_RIDGES)
    count = sum(map(len, ridges))
    if count > room:
        capped("ridge points", room, count)
    return views, strongest(ridges, room)


def ridges_of(
    pictures: PosedPictures,
    views: Int[Tensor, " B"],
    tell: Tell = no_report,
    known: dict[int, Ridges] | None = None,
) -> list[Ridges]:
    """The edges of these views, at subpixel precision.

    Args:
        tell: called with how many views are done.
        known: those of views that were looked at before; the others are added.
    """
    known = {} if known is None else known
    drawn = pictures.store.pixels.shape[3] == 1
    width = line_width(pictures.store) * pictures.cameras.size[0] if drawn else 0.0
    for done, view in enumerate(views.tolist()):
        tell("edges of the pictures", done, len(views), None, 0)
        if view in known:
            continue
        batch = pictures.batch([view])
        pixels = batch.pixels[0].numpy()
        ridges = map_ridges(narrowed(pixels[..., 0], width)) if drawn else color_ridges(pixels)
        known[view] = ridges if is_all_known(pictures.store.known) else within(ridges, batch.known[0].numpy())
    found = [known[view] for view in views.tolist()]
    # The logarithm of a gradient says nothing about doubt.
    return without_faint(found) if pictures.target == "edges" else found


def _free(start: Sketch) -> Curves:
    """The strokes as cubics that are nothing else yet."""
    count = len(start)
    kind = torch.full((count,), int(Kind.FREE))
    return Curves(start.elevate(3).points, kind, torch.arange(2 * count).reshape(count, 2))


def _fitted(pictures: PosedPictures, course: EdgeCourse, about: dict[str, Any], stopped: bool) -> Fitted:
    curves, bias = course.kept.result.curves, course.kept.result.bias
    of_kind = Counter(curves.kind.tolist())
    chosen = {
        # Several curves may make one stroke; whole circles and ellipses have no ends.
        "curves": {kind.name.lower(): of_kind[kind] for kind in Kind},
        "vertices": len(set(curves.vertex[~curves.closed].flatten().tolist())),
        "bias_pixels": {"dx": bias.dx, "dy": bias.dy, "outward": bias.outward},
        "capped": {what: {"used": used, "of": of} for what, (used, of) in course.capped.items()},
        **about,
    }
    return Fitted(course.sketch, pictures, chosen, course.kept.losses, {}, stopped)
