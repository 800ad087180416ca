"""Pictures with refined cameras, for a fit of their edges or of their colours."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.edges.cameras.coarse_to_fine import refined_cameras
from diff3ds.edges.evidence.edge_views import require_perspective
from diff3ds.photogrammetry.lens_change import LensChange
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.frame import Frame, frame_of
from diff3ds.sketch import DEFAULT_WIDTH
from diff3ds.tasks.progress import Report
from diff3ds.tasks.views.edge_fit.edge_course import EdgeCourse
from diff3ds.tasks.views.edge_fit.edges_of_pictures import MOST_VIEWS, Looked, look, look_again
from diff3ds.tasks.views.edge_fit.refined_cameras import in_world, moves
from diff3ds.tasks.views.views_options import ViewsOptions


@dataclass(frozen=True, eq=False)
class RefinedViews:
    """Pictures of which the cameras were refined.

    Attributes:
        pictures: those whose cameras agree, with these.
        looked: the edges of these.
        lens: how the lenses have changed; the pictures were read with it.
        about: how far cameras moved, for run.json.
    """

    pictures: PosedPictures
    looked: Looked
    lens: LensChange
    about: dict[str, Any]


def refine(
    pictures: PosedPictures,
    looked: Looked,
    frame: Frame,
    course: EdgeCourse,
    say: Callable[[str], None],
) -> RefinedViews:
    """The pictures with refined cameras; read again without the distortion, if any was found.

    Args:
        pictures: of all views.
        looked: the views that are looked at, and their edges.
        frame: in which what the pictures show fills the unit ball.
        course: keeps refined cameras, and has them where a run goes on.
        say: told how far cameras have moved, and which are lost.
    """
    whole, pictures = pictures, pictures.chosen(looked.views)
    given = frame.cameras(pictures.cameras)
    lens = pictures.lens if pictures.again else None
    found = course.kept.refined
    if found is None:
        found = refined_cameras(given, looked.ridges, course.tell, lens, textured=pictures.target != "edges")
        course.save_cameras(found)
    after = in_world(frame, found.cameras(given), pictures.cameras)
    moved = moves(frame, pictures.cameras, after, pictures.names, found, lens)
    for line in moved.lines:
        say(line)
    pictures, change = replace(pictures, cameras=after).chosen(moved.right), moved.lens
    which = [looked.views[i] for i in moved.right]
    if change.k1 and whole.again is not None:
        with warnings.catch_warnings():
            # Said when the pictures were first read.
            warnings.simplefilter("ignore")
            straight = whole.again(change).chosen(which)
        pictures = replace(straight, cameras=pictures.cameras)
        again = replace(look_again(pictures, course.tell), views=which)
        return RefinedViews(pictures, again, change, moved.about)
    some = Looked(which, *([edges[i] for i in moved.right] for edges in (looked.ridges, looked.faint)))
    return RefinedViews(pictures, some, change, moved.about)


def refine_for_color(
    pictures: PosedPictures,
    options: ViewsOptions,
    checkpoint: Path,
    report: Report,
    say: Callable[[str], None],
) -> RefinedViews:
    """Coloured pictures with cameras refined on their edges.

    Args:
        checkpoint: file that keeps refined cameras.

    Raises:
        ValueError: as `require_perspective`, `frame_of` and `read_result`.
    """
    require_perspective(pictures.cameras)
    frame = frame_of(pictures.cameras, pictures.store)
    settings = {"target": pictures.target, "size": list(pictures.cameras.size), "pictures": pictures.digest()}
    course = EdgeCourse(checkpoint, settings, lambda curves: sketch_of(curves, DEFAULT_WIDTH), report, say)
    course.begin(options.resume)
    # Colours need all views: of each fewer edges do.
    return refine(pictures, look(pictures, course.tell, course.cap, MOST_VIEWS), frame, course, say)
