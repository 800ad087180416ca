"""Held-out pictures of a scene beside the same views of the sketch, for what judges the likeness of pictures."""

from collections.abc import Iterator
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.photogrammetry.find_project import find_project, present_views
from diff3ds.pictures.content.background import color_or_path
from diff3ds.pictures.content.clean_plates import CleanPlates, load_clean_plates
from diff3ds.pictures.dataset import reduced
from diff3ds.sketch import Sketch
from diff3ds.tasks.evaluate.runs import Run
from diff3ds.tasks.views.color_fit.color_sketch import held_out_pictures, held_out_views, view_pairs

Pair = tuple[Float[Tensor, "1 H W 3"], Float[Tensor, "1 H W 3"]]


def cameras_of(run: Run) -> Path | None:
    """The file with the cameras of a coloured run whose scene has held-out pictures beside it; else None.

    A sketch that was turned or scaled after its fit is in another world than they are.

    Raises:
        FileNotFoundError, ValueError: the scene is not where it was; a damaged file of held-out pictures.
    """
    if run.kind != "scene" or run.record.get("target") != "color" or "placed" in run.record:
        return None
    path = find_project(Path(run.options["source"]), run.options.get("target"))
    return path if held_out_views(path) is not None else None


def held_out_pairs(run: Run, sketch: Sketch, path: Path) -> Iterator[Pair]:
    """The sketch and the picture, view by view, over the run's background and in its size, both in [0, 1].

    Of what is not known of a picture both are the same.

    Args:
        path: as `cameras_of` gives it.

    Raises:
        FileNotFoundError, ValueError: as `load_posed` and `load_clean_plates`.
    """
    size = max(max(reduced(view.size, run.options["size"])) for view in present_views(path, "color"))
    masks = run.options.get("masks", "ignore")
    found = held_out_pictures(path, size, _background(run, path, size), masks)
    if found is None:
        return
    for drawn, wanted, known in view_pairs(sketch, *found):
        yield torch.where(known[..., None], drawn.clamp(0, 1), wanted), wanted


def _background(run: Run, path: Path, size: int) -> Tensor | CleanPlates | None:
    """What lay behind the pictures of the fit: as it was given, or the colour that was found at their borders."""
    given, found = run.options.get("background"), run.record.get("background")
    if given is None:
        return torch.tensor(found) if isinstance(found, list) else None
    behind = color_or_path(given)
    return load_clean_plates(path, behind, size) if isinstance(behind, Path) else behind
