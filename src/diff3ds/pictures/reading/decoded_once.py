"""Picture files that several parts of a run read, each decoded once while what it holds fits in memory."""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.formats.png import load_reduced, size_of
from diff3ds.pictures.reading.resample import area_means
from diff3ds.pictures.store import MEMORY

# Files that may come smaller, and how many times.
JPEG, REDUCED = (".jpg", ".jpeg"), (8, 4, 2)
# Bytes that pictures take while they are read, and what each pixel of one takes then: its floating point numbers and
# as many again.
READING, PER_PIXEL = 1 << 29, 40


class _Kept:
    """Decoded pictures: pixels, with 8 bits a channel where that is all there is, size of the file, times smaller."""

    def __init__(self, longest: int) -> None:
        self.longest, self.room, self.lock = longest, MEMORY, Lock()
        self.pictures: dict[Path, tuple[Tensor, tuple[int, int], int]] = {}

    def put(self, path: Path, image: Tensor, full: tuple[int, int], times: int, reduced: bool) -> None:
        """Keeps a picture that came reduced by so many times; `reduced`: or might have."""
        coarser = next((n for n in REDUCED if max(full) >= n * self.longest), 1) // times
        if reduced and coarser > 1 and path.suffix.lower() in JPEG:
            size = -(-image.shape[0] // coarser), -(-image.shape[1] // coarser)
            extent = (float(size[0] * coarser), float(size[1] * coarser))
            image, times = area_means(image[None], size, extent)[0], times * coarser
        held = (image * 255).round().to(torch.uint8)
        held = held if torch.equal(held / 255, image) else image
        with self.lock:
            if path not in self.pictures and held.nbytes <= self.room:
                self.room -= held.nbytes
                self.pictures[path] = held, full, times


_kept: _Kept | None = None


@contextmanager
def decoded_once(longest: int) -> Iterator[None]:
    """Inside, pictures that `load_once` reads are kept, reduced to no less than so many pixels along the longer side.

    They take 1 GiB together at most; files beyond that are decoded as often as they are read.
    """
    global _kept
    before, _kept = _kept, _Kept(longest)
    try:
        yield
    finally:
        _kept = before


def load_once(path: Path, least: tuple[int, int] | None) -> tuple[Float[Tensor, "H W C"], tuple[int, int], int]:
    """As `load_reduced`, and of files that are kept without decoding them again."""
    key = path.resolve()
    kept = None if _kept is None else _kept.pictures.get(key)
    if kept is not None:
        held, full, times = kept
        if times == 1 or (least is not None and all(n >= times * m for n, m in zip(full, least, strict=True))):
            return held / 255 if held.dtype == torch.uint8 else held, full, times
    image, full, times = load_reduced(path, _enough(least))
    if _kept is not None:
        _kept.put(key, image, full, times, reduced=least is not None)
    return image, full, times


def at_a_time(pictures: Iterable[tuple[Path, tuple[int, int], tuple[int, int] | None]]) -> int:
    """How many of these pictures may be read at the same time: each has a file, a size, and what is kept of that."""
    return READING // (PER_PIXEL * max(_pixels(*picture) for picture in pictures))


def _pixels(path: Path, full: tuple[int, int], least: tuple[int, int] | None) -> int:
    """How many pixels of a file are decoded: all, where it has not this size (`read_view.decode`)."""
    times, least = 1, _enough(least)
    if least is not None and path.suffix.lower() in JPEG and size_of(path) == full:
        times = next((n for n in REDUCED if full[0] >= n * least[0] and full[1] >= n * least[1]), 1)
    return (full[0] // times) * (full[1] // times)


def _enough(least: tuple[int, int] | None) -> tuple[int, int] | None:
    """What is decoded at least, for those too who will ask for more of a picture that is kept."""
    if least is None or _kept is None:
        return least
    scale = max(1.0, _kept.longest / max(least))
    return math.ceil(scale * least[0]), math.ceil(scale * least[1])
