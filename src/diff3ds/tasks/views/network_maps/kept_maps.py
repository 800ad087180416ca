"""Maps that a network makes of posed photographs, one a photograph, kept beside the results."""

import warnings
from collections.abc import Callable, Sequence
from os.path import commonpath
from pathlib import Path

from diff3ds._shapes import Float, Tensor
from diff3ds.formats import save_png
from diff3ds.formats.orientation import load_of_size
from diff3ds.formats.png import size_of
from diff3ds.photogrammetry.find_project import present_views
from diff3ds.pictures.content.cutout import premultiplied
from diff3ds.pictures.dataset import reduced
from diff3ds.pictures.picture_options import Target
from diff3ds.pictures.reading.decoded_once import load_once
from diff3ds.pictures.reading.read_view import DECODED
from diff3ds.pictures.reading.resample import area_means
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.tasks.progress import Progress, Report
from diff3ds.transforms import View, of_picture_sizes

# (height, width).
Size = tuple[int, int]
Make = Callable[[Float[Tensor, "h w 3"], Size], Float[Tensor, "H W 1"]]


def views_of(path: Path, target: Target | None) -> list[View]:
    """The views of a project, with the sizes of their photographs; warnings are those of who reads them later."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return of_picture_sizes(path, present_views(path, target))


def _files(views: Sequence[View], folder: Path) -> list[Path]:
    pictures = [view.picture.absolute() for view in views]
    base = Path(commonpath([picture.parent for picture in pictures]))
    return [folder / picture.relative_to(base).with_suffix(".png") for picture in pictures]


def keep_maps(
    views: Sequence[View],
    folder: Path,
    size: int,
    make: Make,
    full: bool,
    stage: str,
    resume: bool,
    report: Report,
) -> list[Path]:
    """Writes a map of each photograph, which is looked at as it was taken, over white where it is transparent.

    Maps lie below the folder as their photographs lie below that of all.

    Args:
        views: with the sizes of their photographs.
        folder: for the maps.
        size: photographs are reduced to this many pixels along the longer side.
        make: makes a map of a reduced photograph, of the size that is wanted.
        full: whether maps are wanted in the size of the photograph, or reduced as it is.
        stage: what this is called.
        resume: maps that are there are kept.
        report: called for each photograph.

    Returns:
        Their files.

    Raises:
        ValueError, OSError: a photograph cannot be read, or a map written.
    """
    files = _files(views, folder)
    for stale in [] if resume else folder.rglob("*.png"):
        stale.unlink()
    # Torch's own threads wait for each other busily, which takes the time of others.
    with torch_on_one_thread():
        for done, (view, file) in enumerate(zip(views, files, strict=True)):
            report(Progress(stage, done, len(views), None, 0))
            small = reduced(view.size, size)
            wanted = view.size if full else small
            if not (resume and file.is_file() and size_of(file) == wanted):
                file.parent.mkdir(parents=True, exist_ok=True)
                save_png(file, make(_over_white(view, small), wanted))
    return files


def _over_white(view: View, small: Size) -> Float[Tensor, "h w 3"]:
    image, stored, times = load_once(view.picture, (DECODED * small[0], DECODED * small[1]))
    if stored != view.size:
        image, times = load_of_size(view.picture, view.size, "the cameras say"), 1
    extent = (view.size[0] / times, view.size[1] / times)
    means = area_means(premultiplied(image)[None], small, extent)[0]
    return means[..., :3] + 1 - means[..., 3:]
