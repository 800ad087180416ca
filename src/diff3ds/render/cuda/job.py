"""What a kernel is given, `Job` of csrc/cuda/job.cuh field by field, and the memory that its arrays take."""

import ctypes
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import torch

from diff3ds._shapes import Tensor

# Lists that grow with the drawing, in the order of their counters; then the other counters.
LISTS = ("pieces", "chords", "intersections", "tile_pieces", "fragments", "outline", "outline_fragments")
BAD = len(LISTS) + 2
COUNTERS = BAD + 1
TILE, PIXELS, WARPS = 16, 256, 8
SUMS = 24
# With those of the map of oblong pixels. Of these, those that are no control points: half width, opacity, colour, map.
ALL_SUMS = 28
OF_APPEARANCE = 12

_POINTERS = (
    "points", "weights", "matrices", "poses", "intrinsics", "cubics", "half_width", "color", "opacity", "background",
    "stroke_first", "segment_stroke", "closed", "batch", "square", "out_color", "out_alpha", "out_depth", "reach",
    "scale", "piece_first", "pieces", "piece_info", "arcs", "chord_first", "outline_first", "chords", "chord_info",
    "tangents", "intersection_first", "intersection_chord", "intersection_tile_piece", "tile_first", "tile_cursor",
    "tile_piece_first", "tile_piece_count", "tile_list", "tile_pieces", "warp_fragments", "fragments", "order",
    "point_first", "point_count", "counters", "report", "g_color", "g_alpha", "g_depth", "front", "g_fragment",
    "g_tile_piece", "g_square", "g_background", "g_cubics", "g_appearance", "g_widths", "g_colors", "g_opacities",
    "g_points", "g_weights", "g_matrices", "g_squares", "outline", "outline_list", "outline_tile_first",
    "outline_tile_cursor", "g_outline", "outline_sums", "outline_warp_fragments", "outline_fragments", "outline_order",
)  # fmt: skip


class Job(ctypes.Structure):
    """Addresses of arrays, bounds of lists, and the options of a drawing."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in _POINTERS),
        ("limit", ctypes.c_uint64 * len(LISTS)),
        ("seed", ctypes.c_uint64),
        *((f"background_{axis}", ctypes.c_int64) for axis in ("view", "row", "pixel")),
        *((name, ctypes.c_double) for name in ("near", "inv_sigma", "filter_reach", "width_scale")),
        *((name, ctypes.c_int32) for name in ("views", "strokes", "segments", "height", "width", "tiles_x", "tiles_y")),
        *((name, ctypes.c_int32) for name in ("world", "along", "orthographic", "strata")),
        *((name, ctypes.c_int32) for name in ("half_width_per_view", "save", "sketches", "controls")),
        *((name, ctypes.c_int32) for name in ("cameras_double", "differ_squares")),
    )

    def point(self, arrays: "Arrays | Mapping[str, Tensor | None]") -> None:
        """Sets addresses."""
        if isinstance(arrays, Arrays):
            for name, address in arrays.addresses():
                setattr(self, name, address)
            return
        for name, array in arrays.items():
            setattr(self, name, None if array is None else array.data_ptr())

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
            "pieces": 33 * self.real * pieces,
            "piece_info": 176 * pieces,
            "arcs": 80 * pieces,
            "chord_first": 4 * (pieces + 1),
            "outline_first": 4 * (pieces + 1),
            "chords": 9 * self.real * chords,
            "chord_info": 12 * chords,
            "tangents": 16 * chords,
            "intersection_first": 4 * (chords + 1),
            **dict.fromkeys(("intersection_chord", "intersection_tile_piece", "tile_list"), 4 * intersections),
            **dict.fromkeys(("tile_piece_first", "tile_piece_count"), 4 * self.tiles),
            "tile_pieces": 16 * tile_pieces,
            "warp_fragments": 8 * WARPS * kept * tile_pieces,
            "fragments": 4 * self.real * fragments,
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
            "outline_warp_fragments": 8 * WARPS * limits["tile_pieces"],
            "outline_fragments": 4 * self.real * fragments,
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
