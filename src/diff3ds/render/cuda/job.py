"""What a kernel is given, `Job` of csrc/cuda/job.cuh, and the memory that its arrays take."""

import ctypes
import functools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import torch

from diff3ds._shapes import Tensor
from diff3ds.render.cuda.sources import source_folder

_SOURCE = re.sub(r"//.*", "", (source_folder() / "cuda" / "job.cuh").read_text(encoding="utf-8"))
_COUNTED = [name.split()[0].lower() for name in _SOURCE.partition("enum {")[2].partition("}")[0].split(",")]

# Lists that grow with the drawing, in the order of their counters; then the other counters.
LISTS = tuple(_COUNTED[: _COUNTED.index("bounded")])
BAD, COUNTERS = (_COUNTED.index(name) - 1 for name in ("bad", "counters"))
# Other numbers that the source asserts: of tiles, and of sums of gradients, without and with those of the map of oblong
# pixels. Of the latter, those that are no control points: half width, opacity, colour, map.
_NUMBERS = {name: int(number) for name, number in re.findall(r"(\w+) == (\d+)", _SOURCE)}
TILE, WARPS, SUMS, ALL_SUMS = (_NUMBERS[name] for name in ("TILE", "WARPS", "NGRAD", "NSUMS"))
PIXELS = TILE**2
OF_APPEARANCE = ALL_SUMS - 16

_C_TYPES: dict[str, Any] = {
    "u64": ctypes.c_uint64,
    "long long": ctypes.c_int64,
    "double": ctypes.c_double,
    "int": ctypes.c_int32,
}


@functools.cache
def record_size(name: str, real: int) -> int:
    """Bytes of a structure of job.cuh, where a pixel's number has `real` bytes."""
    found = re.search(rf"sizeof\({name}(?:<\w+>)?\) == (\d+)( \* sizeof\(real\))?", _SOURCE)
    assert found is not None
    return int(found[1]) * (real if found[2] else 1)


def _fields() -> Iterator[tuple[str, Any]]:
    """Of `Job`, as job.cuh declares them: what follows a type are names, `*` before those of arrays."""
    for declaration in _SOURCE.partition("struct Job {")[2].partition("};")[0].split(";")[:-1]:
        first, *names = (part.strip() for part in declaration.split(","))
        kind, star, name = re.fullmatch(r"([\w <>]*?)\s*(\*?)(\w+(?:\[\w+\])?)", first).groups()  # type: ignore[union-attr]
        for field in (star + name, *names):
            if field.startswith("*"):
                yield field[1:], ctypes.c_void_p
            elif field.endswith("[BOUNDED]"):
                yield field.removesuffix("[BOUNDED]"), _C_TYPES[kind] * len(LISTS)
            else:
                yield field, _C_TYPES[kind]


class Addressed(ctypes.Structure):
    """A structure whose pointers are set by their names."""

    def point(self, arrays: "Arrays | Mapping[str, Tensor | None]") -> None:
        """Sets addresses."""
        if isinstance(arrays, Arrays):
            for name, address in arrays.addresses():
                setattr(self, name, address)
            return
        for name, array in arrays.items():
            setattr(self, name, None if array is None else array.data_ptr())


class Job(Addressed):
    """Addresses of arrays, bounds of lists, and the options of a drawing."""

    _fields_ = tuple(_fields())

    def copy(self) -> "Job":
        """One that can be changed apart from this."""
        return Job.from_buffer_copy(self)


@dataclass(frozen=True)
class Shape:
    """The numbers that decide how long arrays are.

    Attributes:
        real: the size of a pixel's number in bytes.
        save: whether a backward pass may follow.
        controls: control points of segments in space, 0 for those that are projected already.
        batch: how many rows of strokes and of segments a batch of sketches has (csrc/common/layout.h); None for one.
    """

    views: int
    strokes: int
    segments: int
    height: int
    width: int
    strata: int
    real: int
    save: bool
    controls: int = 0
    batch: tuple[int, int] | None = None

    @property
    def rows(self) -> int:
        """Strokes, each as often as views see it."""
        return self.batch[0] if self.batch else self.views * self.strokes

    @property
    def seen(self) -> int:
        """Segments, each as often as views see it."""
        return self.batch[1] if self.batch else self.views * self.segments

    @property
    def tiles_x(self) -> int:
        """Tiles in a row."""
        return -(-self.width // TILE)

    @property
    def tiles_y(self) -> int:
        """Tiles in a column."""
        return -(-self.height // TILE)

    @property
    def tiles(self) -> int:
        """Of all views."""
        return self.views * self.tiles_x * self.tiles_y

    @property
    def samples(self) -> int:
        """Of a pixel."""
        return max(1, self.strata**2)

    def _room(self, name: str, count: int) -> int:
        return count * record_size(name, self.real)

    def forward(self, limits: Mapping[str, int]) -> dict[str, int]:
        """Bytes of the arrays of a forward pass; they are kept for the backward pass."""
        pieces, chords, intersections, tile_pieces, fragments = (limits[name] for name in LISTS[:5])
        kept = self.samples if self.save else 1
        points = PIXELS * self.tiles * self.samples if self.save else 0
        return {
            "cubics": 128 * self.seen if self.controls else 0,
            "reach": self.real * self.rows,
            "scale": 8 * self.seen,
            "piece_first": 4 * (self.seen + 1),
            "pieces": self._room("Piece", pieces),
            "piece_info": self._room("PieceInfo", pieces),
            "arcs": self._room("Arc", pieces),
            "chord_first": 4 * (pieces + 1),
            "outline_first": 4 * (pieces + 1),
            "chords": self._room("Chord", chords),
            "chord_info": self._room("ChordInfo", chords),
            "tangents": self._room("Tangents", chords),
            "intersection_first": 4 * (chords + 1),
            **dict.fromkeys(("intersection_chord", "intersection_tile_piece", "tile_list"), 4 * intersections),
            **dict.fromkeys(("tile_piece_first", "tile_piece_count"), 4 * self.tiles),
            "tile_pieces": self._room("TilePiece", tile_pieces),
            "warp_fragments": self._room("WarpFragments", WARPS * kept * tile_pieces),
            "fragments": self._room("Cover", fragments),
            "order": 4 * fragments,
            "point_first": 4 * points,
            "point_count": 4 * points,
            "counters": 8 * COUNTERS,
            "tile_first": 4 * (self.tiles + 1),
            "tile_cursor": 4 * self.tiles,
        }

    def backward(self, limits: Mapping[str, int], squares: bool = False) -> dict[str, int]:
        """Bytes of the arrays that a backward pass needs beside; squares: with the gradient of `Strokes2D.square`."""
        sizes = dict.fromkeys(("front", "g_fragment"), self.real * limits["fragments"])
        sizes |= {
            "g_tile_piece": SUMS * self.real * limits["tile_pieces"],
            "g_square": 4 * self.real * limits["tile_pieces"] if squares else 0,
            "g_appearance": 8 * OF_APPEARANCE * self.seen,
        }
        sizes["g_cubics"] = 128 * self.seen if self.controls else 0
        if not self.strata:
            return sizes
        points, fragments = limits["outline"], limits["outline_fragments"]
        return sizes | {
            "outline_list": 4 * points,
            "g_outline": self.real * points,
            "outline_sums": ALL_SUMS * self.real * limits["pieces"],
            "outline_warp_fragments": self._room("WarpFragments", WARPS * limits["tile_pieces"]),
            "outline_fragments": self._room("Cover", fragments),
            "outline_order": 4 * fragments,
        }


class Arrays:
    """Arrays of given sizes in bytes, parts of one allocation; those of no size are not there.

    Attributes:
        memory: the allocation, not initialised.
    """

    def __init__(self, sizes: Mapping[str, int], device: torch.device) -> None:
        # Addresses that any vector load may start at, and lines of the memory do.
        self._places: dict[str, tuple[int, int]] = {}
        total = 0
        for name, size in sizes.items():
            if size:
                self._places[name] = (total, size)
            total += -(-size // 256) * 256
        self.memory: Tensor = torch.empty(total, dtype=torch.uint8, device=device)

    def addresses(self) -> Iterator[tuple[str, int]]:
        """Names and where the arrays begin."""
        base = self.memory.data_ptr()
        return ((name, base + start) for name, (start, _) in self._places.items())

    def __getitem__(self, name: str) -> Tensor:
        start, size = self._places[name]
        return self.memory[start : start + size]
