"""Edge maps that a network makes of posed photographs: `diff3ds views --detector hed`."""

from collections.abc import Callable
from pathlib import Path

from diff3ds.detectors.hed import LICENCE, load_hed
from diff3ds.tasks.progress import Report
from diff3ds.tasks.views.network_maps.kept_maps import keep_maps, views_of

# The folder of the maps in that of the results.
EDGES = "edges_hed"


def detect_edges(path: Path, out: Path, size: int, resume: bool, report: Report, say: Callable[[str], None]) -> Path:
    """Writes an edge map of each photograph, and returns the folder with them, for `load_posed`.

    Photographs are looked at with the distortion of their lenses, which the reader of the maps takes out.

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
    views = views_of(path, "color")
    hed = load_hed()
    say(LICENCE)
    keep_maps(views, out / EDGES, size, lambda c, _: hed(c)[..., None], False, "edges by hed", resume, report)
    return out / EDGES
