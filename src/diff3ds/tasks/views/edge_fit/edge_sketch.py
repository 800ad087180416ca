"""Edge maps, line drawings, or the edges of coloured pictures to a sketch of lines, arcs and cubics."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from diff3ds.curves.importance import TOGETHER, ranked
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.edges.cameras.find_again import agreement_of, are_surely_lost
from diff3ds.edges.evidence.drawn_ink import drawn_in
from diff3ds.edges.evidence.edge_views import require_perspective
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.reconstruct import reconstruct
from diff3ds.pictures.content.line_width import line_width
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.frame import Frame, bound_by_points, frame_of
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.tasks.progress import Report
from diff3ds.tasks.views.edge_fit.edge_course import EdgeCourse
from diff3ds.tasks.views.edge_fit.edges_of_pictures import Looked, look
from diff3ds.tasks.views.edge_fit.refined_cameras import NAMED
from diff3ds.tasks.views.edge_fit.refined_views import RefinedViews, refine
from diff3ds.tasks.views.plan import Fitted
from diff3ds.tasks.views.views_options import ViewsOptions

# Many lines of photographs hang on one or on none. At detail .5 and .2 .33 and .42 of the strokes of
# the NeRF chair are free with `TOGETHER`, .12 and .17 with this; of the fox's .59 and .71, and .05 and .33.
TOGETHER_IN_PHOTOGRAPHS = 4.0


# Torch's own threads wait for each other busily, and what they would share here is small.
@torch_on_one_thread()
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
    textured = pictures.target == "color-edges"
    course = EdgeCourse(checkpoint, settings, lambda c: frame.to_world(sketch_of(c, width, textured)), report, say)
    course.begin(options.resume)
    stopped = False
    looked: Looked | None = None
    refined: RefinedViews | None = None
    about: dict[str, Any] = {} if bound is None else {"bound": bound}
    try:
        looked = look(pictures, course.tell, course.cap)
        cameras = pictures.cameras[looked.views]
        if options.refine_cameras and start is None:
            # Surroundings tell of cameras as much as the object does.
            refined = refine(pictures, looked, whole, course, say)
            pictures, looked, about["cameras"] = refined.pictures, refined.looked, refined.about
            cameras = pictures.cameras
        reconstruct(
            frame.cameras(cameras),
            looked.ridges,
            start=None if start is None else _free(start),
            reached=course.kept.result,
            save=course.save,
            report=course.tell,
            capped=course.cap,
            seed=options.seed,
            faint=looked.faint if textured else None,
        )
        if refined is None and start is None:
            about["disagreeing"] = _disagreeing(pictures.chosen(looked.views), frame, looked.ridges, course, say)
    except KeyboardInterrupt:
        if not course.kept.result.stage:
            raise
        stopped = True
    fitted = _fitted(pictures, course, about, stopped)
    if looked is not None:
        together = TOGETHER_IN_PHOTOGRAPHS if textured else TOGETHER
        fitted = replace(
            fitted, sketch=ranked(fitted.sketch, drawn_in(cameras, looked.ridges), together=together).sketch
        )
    return fitted if refined is None else replace(fitted, refined=tuple(refined.looked.views), lens=refined.lens)


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


def _disagreeing(
    pictures: PosedPictures, frame: Frame, ridges: list[Ridges], course: EdgeCourse, say: Callable[[str], None]
) -> list[str]:
    """The pictures that show hardly any of the curves that the others show, which is said."""
    reached = course.kept.result
    lost = are_surely_lost(agreement_of(frame.cameras(pictures.cameras), ridges, reached.curves, reached.bias))
    names = [name for name, gone in zip(pictures.names, lost.tolist(), strict=True) if gone]
    if names:
        some = ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
        say(
            f"{len(names)} of {len(pictures)} views agree with the edges of the others hardly more than by chance: "
            f"{some}. Are their cameras right, and do they show the same thing, standing still? --refine-cameras finds "
            "cameras that are off by some pixels; leave out what is off by more"
        )
    return names


def _settings(pictures: PosedPictures, options: ViewsOptions) -> dict[str, object]:
    """Names what must be the same for a run to go on."""
    names = ["init", "seed", "refine_cameras", *(["strokes", "steps", "batch"] if options.init == "random" else [])]
    about = {"target": pictures.target, "size": list(pictures.cameras.size), "pictures": pictures.digest()}
    return {**about, **{name: getattr(options, name) for name in names}}


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
