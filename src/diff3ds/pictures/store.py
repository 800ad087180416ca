"""Pictures kept with 8 bits a channel, in memory or, when they are many, in a file that the system pages."""

import hashlib
import math
import mmap
import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor, UInt8

# Bytes of pictures, all levels of a pyramid included, that are kept in memory; more go into a file.
MEMORY = 1 << 30
# Bytes of floating point numbers that a pass over all pictures makes at a time.
CHUNK = 1 << 23


@dataclass(frozen=True, eq=False)
class Batch:
    """Some of the pictures as floating point numbers in [0, 1].

    Attributes:
        pixels: C = 1: ink; C = 4: RGB times alpha, and alpha. 0 where nothing is known.
        known: where the pictures have content. What a rendering shows elsewhere is neither right nor wrong.
    """

    pixels: Float[Tensor, "B H W C"]
    known: Bool[Tensor, "B H W"]

    @property
    def alpha(self) -> Float[Tensor, "B H W"]:
        """Share of a pixel that is not background: ink, or alpha."""
        return self.pixels[..., -1]

    @property
    def images(self) -> Float[Tensor, "B H W 3"]:
        """RGB over white; ink is black."""
        clear = 1 - self.pixels[..., -1:]
        return clear.expand(*clear.shape[:3], 3) if self.pixels.shape[-1] == 1 else self.pixels[..., :3] + clear


@dataclass(frozen=True, eq=False)
class Store:
    """V pictures on one canvas, with 8 bits a channel.

    Attributes:
        pixels: as `Batch.pixels`, times 255.
        known: as `Batch.known`.
        scratch: folder for the files of large arrays; None keeps all in memory.
    """

    pixels: UInt8[Tensor, "V H W C"]
    known: Bool[Tensor, "V H W"]
    scratch: Path | None = None

    def __len__(self) -> int:
        return len(self.pixels)

    def batch(self, views: Sequence[int] | Int[Tensor, " B"]) -> Batch:
        """These views."""
        rows = torch.as_tensor(views, dtype=torch.long)
        return Batch(self.pixels[rows].float().div_(255), self.known[rows])

    def chosen(self, views: Sequence[int]) -> "Store":
        """These pictures alone."""
        if list(views) == list(range(len(self))):
            return self
        pixels = byte_array((len(views), *self.pixels.shape[1:]), self.scratch)
        known = self.known[: len(views)]
        if not is_all_known(self.known):
            known = byte_array((len(views), *self.known.shape[1:]), self.scratch).view(torch.bool)
        for row, view in enumerate(views):
            pixels[row] = self.pixels[view]
            if not is_all_known(self.known):
                known[row] = self.known[view]
        return Store(pixels, known, self.scratch)

    def digest(self) -> str:
        """The digest of all that the pictures show: equal for equal pictures."""
        digest = hashlib.sha256(str(tuple(self.pixels.shape)).encode())
        for views in self.chunks():
            digest.update(self.pixels[views].numpy().data)
            if not is_all_known(self.known):
                digest.update(self.known[views].numpy().data)
        return digest.hexdigest()

    def chunks(self) -> Iterator[Int[Tensor, " B"]]:
        """Indices of all views, few at a time, so that a pass over them needs little memory."""
        count = max(1, CHUNK // (4 * math.prod(self.pixels.shape[1:])))
        for first in range(0, len(self), count):
            yield torch.arange(first, min(first + count, len(self)))


def store_of(pixels: Float[Tensor, "V H W C"]) -> Store:
    """Pictures that are known everywhere, from floating point numbers as in `Batch`."""
    return Store(as_bytes(pixels), all_known(pixels.shape[0], (pixels.shape[1], pixels.shape[2])))


def as_bytes(values: Float[Tensor, "*S"]) -> UInt8[Tensor, "*S"]:
    """Numbers in [0, 1] times 255, rounded."""
    return (values * 255).round_().clamp_(0, 255).to(torch.uint8)


def all_known(views: int, size: tuple[int, int]) -> Bool[Tensor, "V H W"]:
    """A mask that is true everywhere and takes no memory."""
    return torch.ones((1, 1, 1), dtype=torch.bool).expand(views, *size)


def is_all_known(known: Bool[Tensor, "V H W"]) -> bool:
    """Whether a mask comes from `all_known`."""
    return known.stride() == (0, 0, 0)


def opaque_views(store: Store) -> Bool[Tensor, " V"]:
    """Which of coloured pictures have alpha 1 wherever they are known."""
    opaque = [
        ((store.pixels[views][..., 3] == 255) | ~store.known[views]).flatten(1).all(1) for views in store.chunks()
    ]
    return torch.cat(opaque)


def byte_array(shape: tuple[int, ...], scratch: Path | None) -> UInt8[Tensor, "*S"]:
    """Zeros, in memory or in a file without a name in this folder, which goes when the tensor goes.

    Raises:
        OSError: there is no room in the folder.
    """
    if scratch is None:
        return torch.zeros(shape, dtype=torch.uint8)
    count = math.prod(shape)
    with tempfile.TemporaryFile(dir=scratch) as file:
        try:
            # A file with holes would end the process when the disk is full.
            os.posix_fallocate(file.fileno(), 0, count) if hasattr(os, "posix_fallocate") else file.truncate(count)
        except OSError as error:
            raise OSError(
                f"{scratch}: no room for {count} bytes of pictures ({error}); ask for smaller ones"
            ) from error
        # The mapping keeps the file after it is closed.
        mapped = mmap.mmap(file.fileno(), count)
    return torch.frombuffer(mapped, dtype=torch.uint8).reshape(shape)
