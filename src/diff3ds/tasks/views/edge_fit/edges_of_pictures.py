"""The edges of posed pictures that a run looks at: of how many views, and how many of them."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.camera import evenly_spaced
from diff3ds.edges.evidence.ridges import (
    COLOR_SIGMA,
    MAP_SIGMA,
    MOST_INK,
    Ridges,
    color_tops,
    map_tops,
    narrowed,
    strongest,
    unshrunk,
    within,
    without_faint,
)
from diff3ds.edges.watch import Capped, no_report
from diff3ds.edges.watch import Report as Tell
from diff3ds.parallel.in_copies import in_copies
from diff3ds.pictures.content.line_width import line_width
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.store import is_all_known

# Beyond so many views, evenly chosen ones do: the rest would cost memory and say the same. Of large pictures fewer are
# kept, 48 of 3840 x 2160: each pixel takes up to eight bytes.
MOST_VIEWS, MOST_PIXELS, FEWEST_VIEWS = 200, 400_000_000, 3
# Where the pictures are full of edges, fewer views do: as many as have so many ridge points together, or FEW_VIEWS. The
# cost of all that follows is linear in them. 50 pictures of 400 x 400 with `MOST_INK` have so many, CAD models 50,000.
FEW_VIEWS, MOST_RIDGES = 50, 400_000
# Of fainter ones, which are looked at where known curves say, so many: about all of 50 pictures of 400 x 400.
MOST_FAINT = 2_000_000


@dataclass(frozen=True, eq=False)
class Looked:
    """What is looked at.

    Attributes:
        views: of the pictures.
        ridges: of these, the strongest.
        faint: the same and fainter ones, where the smoothing has pulled them.
    """

    views: list[int]
    ridges: list[Ridges]
    faint: list[Ridges]


def most_views(size: tuple[int, int]) -> int:
    """Counts the views of this size that are looked at, at most."""
    return max(FEWEST_VIEWS, min(MOST_VIEWS, MOST_PIXELS // (size[0] * size[1])))


def look(pictures: PosedPictures, tell: Tell, capped: Capped, few: int = FEW_VIEWS) -> Looked:
    """Views that together are not too full of edges, and the edges that all that follows looks at.

    Args:
        tell: called with how many views are done.
        capped: told of what there was too much.
        few: so many views do where the pictures are full of edges.
    """
    most = min(len(pictures), most_views(pictures.cameras.size))
    views = evenly_spaced(len(pictures), min(most, few))
    known: dict[int, Ridges] = {}
    tops = _tops_of(pictures, views, tell, known)
    height, width = pictures.cameras.size
    full = int(MOST_INK * height * width)
    if most > len(views):
        ink = min(full, sum(map(len, tops)) // len(views))
        wanted = min(most, max(few, MOST_RIDGES // max(1, ink)))
        if wanted < most:
            capped("views", wanted, most)
        views = evenly_spaced(len(pictures), wanted)
        tops = _tops_of(pictures, views, tell, known)
    room = min(full * len(views), MOST_RIDGES)
    count = sum(map(len, tops))
    if count > room:
        capped("ridge points", room, count)
    return _looked(pictures, views.tolist(), tops, room)


def look_again(pictures: PosedPictures, tell: Tell) -> Looked:
    """The edges of all these pictures, as many as `look` leaves of the views that it has chosen."""
    height, width = pictures.cameras.size
    tops = _tops_of(pictures, torch.arange(len(pictures)), tell, {})
    room = min(int(MOST_INK * height * width) * len(pictures), MOST_RIDGES)
    return _looked(pictures, list(range(len(pictures))), tops, room)


def ridges_of(pictures: PosedPictures, views: Int[Tensor, " B"]) -> list[Ridges]:
    """All edges of these views, at subpixel precision."""
    tops = _tops_of(pictures, views, no_report, {})
    return _looked(pictures, views.tolist(), tops, sum(map(len, tops))).ridges


def _looked(pictures: PosedPictures, views: list[int], tops: list[Ridges], room: int) -> Looked:
    """The strongest of the tops, so many, as ridges."""
    sigma = MAP_SIGMA if _is_drawn(pictures) else COLOR_SIGMA
    chosen = strongest(tops, room)
    ridges = in_copies(lambda k: unshrunk(chosen[k], sigma, tops[k]), len(views), len(views))
    return Looked(views, ridges, strongest(tops, MOST_FAINT))


def _is_drawn(pictures: PosedPictures) -> bool:
    return pictures.store.pixels.shape[3] == 1


def _tops_of(pictures: PosedPictures, views: Int[Tensor, " B"], tell: Tell, known: dict[int, Ridges]) -> list[Ridges]:
    """The edges of these views, where the smoothing has pulled them.

    Args:
        tell: called with how many views are done.
        known: those of views that were looked at before; the others are added.
    """
    drawn = _is_drawn(pictures)
    width = line_width(pictures.store) * pictures.cameras.size[0] if drawn else 0.0
    new = [view for view in views.tolist() if view not in known]

    def tops_of(k: int) -> Ridges:
        batch = pictures.batch([new[k]])
        pixels = batch.pixels[0].numpy()
        tops = map_tops(narrowed(pixels[..., 0], width)) if drawn else color_tops(pixels)
        return tops if is_all_known(pictures.store.known) else within(tops, batch.known[0].numpy())

    def told(done: int) -> None:
        tell("edges of the pictures", done, len(new), None, 0)

    told(0)
    known.update(zip(new, in_copies(tops_of, len(new), len(new), told), strict=True))
    found = [known[view] for view in views.tolist()]
    # The logarithm of a gradient says nothing about doubt.
    return without_faint(found) if pictures.target == "edges" else found
