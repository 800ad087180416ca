"""What the CUDA kernels of areas are given, `Job` of csrc/cuda/areas/job.cuh field by field, and its tables."""

import ctypes
from collections.abc import Mapping, Sequence

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.render.areas.painted_layers import PLAIN
from diff3ds.render.cuda.job import Addressed

# Lists whose length only the device knows, in the order of their counters, and the bytes of what is as long.
LISTS: dict[str, dict[str, int]] = {
    "vertices": {"vertices": 48, "links": 8, "heads": 8},
    "pieces": {"pieces": 40, "chains": 48, "keys": 8, "active": 4, "by_left": 4},
    "heights": {"heights": 8},
    "shares": {"shares": 8},
    "borders": {"borders": 40},
    "row_sums": {},
}
# Sums of a segment: of four control points and half widths, and of a transform.
PART_SUMS, MOVE_SUMS = 18, 6
VALUES = ("points", "half_widths", "transforms", "axes", "offsets", "colors")
TABLES = ("layers", "paints", "parts", "layer_parts", "layer_sums", "point_first", "uses")

_POINTERS = (
    *VALUES, "background", *TABLES, "image", "counters", "vertex_first", "vertices", "links", "heads", "bounds", "runs",
    "pieces", "chains", "keys", "active", "by_left", "heights", "shares", "borders", "g_image", "states", "g_shares",
    "row_sums", "g_edges", "part_sums", "layer_totals", *(f"g_{name}" for name in VALUES), "g_background",
)  # fmt: skip


class AreaJob(Addressed):
    """Addresses of arrays, bounds of lists, and numbers of what there is."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in _POINTERS),
        ("limit", ctypes.c_uint64 * len(LISTS)),
        *((name, ctypes.c_int32) for name in ("width", "height", "point_count", "part_count", "layer_count")),
        *((name, ctypes.c_int32) for name in ("transform_count", "paint_count", "stop_count", "save")),
    )


# Of lists that only the forward pass reads.
SCRATCH = ("pieces", "heights")


def scratch_sizes(lengths: Sequence[int]) -> dict[str, int]:
    """Bytes of the arrays that a forward pass alone needs."""
    return _list_sizes(lengths, True)


def forward_sizes(job: AreaJob, lengths: Sequence[int]) -> dict[str, int]:
    """Bytes of the other arrays of a forward pass; they are kept for the backward pass."""
    fixed = {
        "counters": 8 * len(LISTS),
        "vertex_first": 4 * (job.part_count + 1),
        "bounds": 8 * job.layer_count,
        "runs": 24 * job.layer_count * job.height,
    }
    return fixed | _list_sizes(lengths, False)


def _list_sizes(lengths: Sequence[int], scratch: bool) -> dict[str, int]:
    lists = zip(LISTS.items(), lengths, strict=True)
    chosen = ((sizes, length) for (name, sizes), length in lists if (name in SCRATCH) == scratch)
    return {name: size * length for sizes, length in chosen for name, size in sizes.items()}


def backward_sizes(job: AreaJob, needs: Sequence[int], sums: int, real: int) -> dict[str, int]:
    """Bytes of the arrays that a backward pass needs beside; sums: of all layers; real: bytes of a value."""
    need = dict(zip(LISTS, needs, strict=True))
    return {
        "states": 8 * real * need["shares"],
        "g_shares": real * need["shares"],
        "row_sums": 8 * need["row_sums"],
        "g_edges": 32 * need["vertices"],
        "part_sums": 8 * PART_SUMS * job.part_count,
        "layer_totals": 8 * sums,
    }


def job_tables(tables: tuple[Tensor, ...], points: int) -> Mapping[str, Int[Tensor, "*N"]]:
    """The segments of all layers and who adds to which sum, from the tables of `Layers`, on the CPU."""
    inner, contours, layers, paints = (table.cpu().long() for table in tables)
    layer, contour = _ranges(layers[:, 0], layers[:, 1])
    there = contours[contour, 1] > 0
    layer, contour = layer[there], contour[there]
    first, length, segment, segments, closed = contours[contour].T
    # One without segments is a single point.
    counts = segments.clamp(min=1)
    owner, row = _ranges(segment, counts)
    degree = torch.where(segments[owner] > 0, torch.cat([inner, inner.new_zeros(1)])[row] + 1, 0)[:, None]
    ends = torch.cat([inner.new_zeros(1), (inner + 1).cumsum(0)])
    place = (ends[row] - ends[segment[owner]])[:, None] + torch.arange(4)
    index = torch.where(torch.arange(4) <= degree, first[owner, None] + place % length[owner, None], -1)
    begin = counts.cumsum(0) - counts
    of_contour = torch.stack([begin, counts, closed], 1)[owner]
    of_paint = torch.where(paints[:, 0] == PLAIN, 4, 5 * paints[:, 2] + 10)
    used = (index.flatten() >= 0).nonzero().flatten()
    point, order = index.flatten()[used].sort(stable=True)
    return {
        "layers": layers,
        "paints": paints,
        "parts": torch.cat([layer[owner, None], degree, index, of_contour], 1),
        "layer_parts": torch.searchsorted(layer[owner].contiguous(), torch.arange(len(layers) + 1)),
        "layer_sums": torch.cat([inner.new_zeros(1), (MOVE_SUMS + of_paint[layers[:, 4]]).cumsum(0)]),
        "point_first": torch.searchsorted(point, torch.arange(points + 1)),
        "uses": used[order],
    }


def _ranges(first: Int[Tensor, " N"], count: Int[Tensor, " N"]) -> tuple[Int[Tensor, " M"], Int[Tensor, " M"]]:
    """Of `count` whole numbers from `first` on, for each row: the row, and the number."""
    row = torch.arange(len(count)).repeat_interleave(count)
    return row, (first - (count.cumsum(0) - count))[row] + torch.arange(len(row))
