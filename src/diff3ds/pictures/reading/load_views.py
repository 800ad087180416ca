"""The pictures of many views, read side by side and put on one canvas."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.pictures.content.masks import has_left_out
from diff3ds.pictures.picture_options import Masks
from diff3ds.pictures.reading.decoded_once import at_a_time
from diff3ds.pictures.reading.read_view import decoded_size, read_view
from diff3ds.pictures.store import MEMORY, Store, all_known, as_bytes, byte_array
from diff3ds.transforms import View

# The sizes of a pyramid, each half the last, take a third more than the first.
PYRAMID = 4 / 3

# Called with the number of pictures that have been read, and of all.
Told = Callable[[int, int], None]
# Makes RGB times alpha, and alpha, of a view, and where they are known.
Read = Callable[[View, tuple[int, int], Masks], tuple[Float[Tensor, "h w 4"], Bool[Tensor, "h w"]]]


@dataclass(frozen=True, eq=False)
class Some:
    """Colours of some of the views.

    Attributes:
        places: in the store, by the view's index.
        store: of C = 4.
    """

    places: dict[int, int]
    store: Store


def canvas_of(sizes: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """(height, width) of the canvas that holds pictures of all these sizes."""
    return max(height for height, _ in sizes), max(width for _, width in sizes)


def load_some(
    views: list[View],
    sizes: list[tuple[int, int]],
    decoded: list[tuple[int, int]],
    chosen: list[int],
    read: Read,
    scratch: Path | None = None,
    masks: Masks = "ignore",
    told: Told = lambda done, total: None,
) -> Some:
    """The colours of the chosen views, for `load_views`, which then need not be read again.

    Args:
        decoded: (height, width) for which each view is decoded.
        read: makes the pictures.
    """
    store = _room([views[i] for i in chosen], canvas_of(sizes), 4, scratch, whole=False)

    def put(place: int) -> None:
        height, width = size = sizes[chosen[place]]
        rgba, seen = read(views[chosen[place]], size, masks)
        store.pixels[place, :height, :width], store.known[place, :height, :width] = as_bytes(rgba), seen

    some = [views[i] for i in chosen], [decoded[i] for i in chosen]
    _put_all(put, *some, masks, lambda done, _: told(done, len(views)))
    return Some({index: place for place, index in enumerate(chosen)}, store)


def load_views(
    views: list[View],
    sizes: list[tuple[int, int]],
    background: float | None,
    scratch: Path | None = None,
    masks: Masks = "ignore",
    told: Told = lambda done, total: None,
    there: Some | None = None,
    read: Read = read_view,
) -> Store:
    """The pictures of these views, each in its (height, width), at the top left of a canvas that holds all.

    Args:
        background: value behind ink, 0 or 1; None for colour.
        scratch: as for `load_posed`.
        masks: as for `load_posed`.
        told: called after each picture.
        there: those that have been read.
        read: makes the others.

    Raises:
        ValueError, OSError: as `read_view` and `byte_array`.
    """
    canvas = canvas_of(sizes)
    whole = all(size == canvas for size in sizes)
    whole = whole and not any(bool(view.distortion) or has_left_out(view, masks) for view in views)
    store = _room(views, canvas, 4 if background is None else 1, scratch, whole)

    def put(i: int) -> None:
        height, width = sizes[i]
        if there is not None and i in there.places:
            batch = there.store.batch([there.places[i]])
            rgba, seen = batch.pixels[0, :height, :width], batch.known[0, :height, :width]
        else:
            rgba, seen = read(views[i], sizes[i], masks)
        values = rgba if background is None else _ink(rgba, background)[..., None]
        store.pixels[i, :height, :width] = as_bytes(values)
        if not whole:
            store.known[i, :height, :width] = seen

    _put_all(put, views, sizes, masks, told)
    return store


def _put_all(
    put: Callable[[int], None], views: list[View], sizes: list[tuple[int, int]], masks: Masks, told: Told
) -> None:
    """Reads the views, several at a time."""
    files = [
        (view.picture, view.size, decoded_size(view, size, masks)) for view, size in zip(views, sizes, strict=True)
    ]
    told(0, len(views))
    side_by_side(put, len(views), at_a_time(files), lambda done: told(done, len(views)))


def _room(views: list[View], canvas: tuple[int, int], channels: int, scratch: Path | None, whole: bool) -> Store:
    """An empty store, in memory or, if that is much, in a file."""
    count = len(views) * canvas[0] * canvas[1] * (channels + (not whole))
    folder = None if count * PYRAMID <= MEMORY else _existing(scratch)
    known = all_known(len(views), canvas) if whole else byte_array((len(views), *canvas), folder).view(torch.bool)
    return Store(byte_array((len(views), *canvas, channels), folder), known, folder)


def _existing(folder: Path | None) -> Path:
    """The folder, or the nearest one above it that is there."""
    folder = Path(tempfile.gettempdir()) if folder is None else folder.absolute()
    return next(f for f in (folder, *folder.parents) if f.is_dir())


def _ink(rgba: Float[Tensor, "h w 4"], background: float) -> Float[Tensor, "h w"]:
    """Distance from the background's value, which transparent and unknown pixels have."""
    gray = rgba[..., :3].mean(-1) + (1 - rgba[..., 3]) * background
    return (gray - background).abs()
