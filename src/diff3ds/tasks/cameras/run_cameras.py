"""Photographs, or a project of another program, to a transforms.json: what `diff3ds cameras` does."""

import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import existing_folder, read_json, write_text
from diff3ds._shapes import Float, Tensor
from diff3ds.photogrammetry.find_project import NoCameras, present_views, project_of, sparse_points
from diff3ds.photogrammetry.markers import require_opencv
from diff3ds.photogrammetry.picture_files import masks_for
from diff3ds.photogrammetry.placing import distance_between, looked_at, moved, turned_up, up_of
from diff3ds.photogrammetry.point_files import save_points
from diff3ds.tasks.cameras.register import register
from diff3ds.tasks.cameras.registration_options import RegistrationOptions
from diff3ds.tasks.progress import Report
from diff3ds.transforms import View, of_picture_sizes, save_views

TRANSFORMS, REPORT, POINTS = "transforms.json", "cameras.json", "points.ply"
# The key of a transforms.json whose cameras were found from its pictures, and may be off by a pixel or two.
ESTIMATED = "cameras_from_pictures"


@dataclass(frozen=True, eq=False)
class Found:
    """Views with what is said about them.

    Attributes:
        views: in their world.
        points: of the reconstruction, in the same world; perhaps none.
        about: for the report.
        lines: for the user.
    """

    views: list[View]
    points: Float[Tensor, "P 3"]
    about: dict[str, Any]
    lines: list[str]


def run_cameras(
    source: Path,
    out: Path,
    options: RegistrationOptions | None = None,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Path:
    """Finds where photographs were taken from; writes transforms.json, points.ply and cameras.json.

    A folder that has cameras already (`project_of`) is converted; of others pycolmap finds them.

    Args:
        source: a folder of photographs, or a project.
        out: folder of the results.
        options: default `RegistrationOptions()`.
        report: called as it goes on.
        say: called with what a user should know.

    Returns:
        The transforms.json.

    Raises:
        FileNotFoundError: no photographs.
        ImportError: pycolmap is not installed, or OpenCV, where places are markers.
        ValueError: cameras that cannot be found, or as `present_views`; names of `between` that are none.
        OSError: the folder cannot be written.
    """
    existing_folder(out)
    options = options or RegistrationOptions()
    require_opencv(options.between)
    project = project_of(source)
    photographs = isinstance(project, NoCameras)
    found = _estimated(project, options, report, say) if isinstance(project, NoCameras) else _read(project)
    place = _placing(found.views, options, photographs)
    views = moved(found.views, *place)
    out.mkdir(parents=True, exist_ok=True)
    named: dict[str, Any] = {ESTIMATED: True} if photographs else {}
    if len(found.points):
        origin, turn, scale = place
        save_points(out / POINTS, scale * (found.points - origin) @ turn.mT)
        named["ply_file_path"] = POINTS
    save_views(out / TRANSFORMS, [_relative(view, out) for view in views], named)
    about = {"options": asdict(options), **found.about, "pictures": [view.picture.name for view in views]}
    write_text(out / REPORT, json.dumps(about, indent=1))
    for line in found.lines:
        say(line)
    return out / TRANSFORMS


def _read(path: Path) -> Found:
    """The cameras of a project."""
    views, points = of_picture_sizes(path, present_views(path)), sparse_points(path)
    return Found(views, points, {"source": str(path), "points": len(points)}, [f"{path}: {len(views)} cameras"])


def _estimated(
    photographs: NoCameras, options: RegistrationOptions, report: Report, say: Callable[[str], None]
) -> Found:
    """The cameras of photographs, with the masks that lie beside these."""
    if not photographs.pictures:
        raise photographs.error()
    for line in (photographs.not_read, *photographs.others):
        if line:
            say(f"{photographs.folder}: {line}")
    found = register(photographs.pictures, options, report, say)
    pictures = [view.picture for view in found.views]
    masks = masks_for(pictures, pictures[0].parent) or [None] * len(pictures)
    views = [replace(view, mask=mask) for view, mask in zip(found.views, masks, strict=True)]
    return Found(views, found.points, found.about, found.lines)


def are_estimated(path: Path) -> bool:
    """Whether cameras were found from photographs by `run_cameras`, and written here.

    Args:
        path: as `find_project` finds it.

    Raises:
        ValueError, OSError: the file cannot be read.
    """
    data = read_json(path) if path.suffix == ".json" and path.is_file() else {}
    return isinstance(data, dict) and data.get(ESTIMATED) is True


def _placing(
    views: list[View], options: RegistrationOptions, photographs: bool
) -> tuple[Float[Tensor, " 3"], Float[Tensor, "3 3"], float]:
    """What makes a world upright and in the user's unit, for `moved`: origin, rotation and scale.

    What photographs have no scale of gets that of the cameras' distance.
    """
    turn, origin, scale = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64), 1.0
    if options.up == "auto" and photographs:
        turn = turned_up(up_of(views))
    if photographs:
        origin = looked_at(views)
        reach = torch.stack([-(v.world_to_camera[:3, :3].mT @ v.world_to_camera[:3, 3]) for v in views]) - origin
        scale = 1 / float(reach.norm(dim=1).median())
    if options.between is not None and options.scale is not None:
        scale = options.scale / distance_between(views, options.between)
    return origin, turn, scale


def _relative(view: View, out: Path) -> View:
    """Paths from the folder of the file, where there are such."""

    def seen(file: Path) -> Path:
        try:
            return Path(os.path.relpath(file, out))
        except ValueError:  # another drive
            return file.absolute()

    return replace(view, picture=seen(view.picture), mask=seen(view.mask) if view.mask else None)
