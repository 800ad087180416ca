"""Edge maps that a network makes of posed photographs, kept beside the results: `diff3ds views --detector hed`."""

from collections.abc import Callable
from os.path import commonpath
from pathlib import Path

from diff3ds.detectors.hed import LICENCE, load_hed
from diff3ds.formats import save_png
from diff3ds.formats.png import load_reduced, size_of
from diff3ds.photogrammetry.project import present_views
from diff3ds.pictures.content.cutout import premultiplied
from diff3ds.pictures.dataset import reduced
from diff3ds.pictures.reading.read import DECODED
from diff3ds.pictures.reading.resample import area_means
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.tasks.progress import Progress, Report

# The folder of the maps in that of the results.
EDGES = "edges_hed"


def detect_edges(path: Path, out: Path, size: int, resume: bool, report: Report, say: Callable[[str], None]) -> Path:
    """Writes an edge map of each photograph, and returns the folder with them, for `load_posed`.

    Photographs are looked at as they were taken, over white where they are transparent, with the distortion of their
    lenses, which the reader of the maps takes out.

    Args:
        path: project of the photographs.
        out: folder of the results.
        size: photographs are reduced to this many pixels along the longer side.
        resume: maps that are there are kept.
        report: called for each photograph.
        say: told of the licence of the weights.

    Raises:
        ImportError, ValueError: as `load_hed`; a photograph that cannot be read.
        FileNotFoundError, OSError: as `present_views`; the folder cannot be written.
    """
    pictures = [view.picture.absolute() for view in present_views(path, "color")]
    hed = load_hed()
    say(LICENCE)
    folder, base = out / EDGES, Path(commonpath([picture.parent for picture in pictures]))
    for stale in [] if resume else folder.rglob("*.png"):
        stale.unlink()
    # Torch's own threads wait for each other busily, which takes the time of others.
    with torch_on_one_thread():
        for done, picture in enumerate(pictures):
            report(Progress("edges by hed", done, len(pictures), None, 0))
            file = folder / picture.relative_to(base).with_suffix(".png")
            small = reduced(size_of(picture), size)
            if not (resume and file.is_file() and size_of(file) == small):
                image, full, times = load_reduced(picture, (DECODED * small[0], DECODED * small[1]))
                means = area_means(premultiplied(image)[None], small, (full[0] / times, full[1] / times))[0]
                file.parent.mkdir(parents=True, exist_ok=True)
                save_png(file, hed(means[..., :3] + 1 - means[..., 3:])[..., None])
    return folder
