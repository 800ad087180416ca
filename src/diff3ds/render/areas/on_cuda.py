"""Layers by the CUDA kernels.

How much memory lists take only the device knows: each call asks it, and draws again with more where there was too
little. What a drawing of the same size took is where the next one begins.
"""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.render.areas.area_job import (
    LISTS,
    TABLES,
    VALUES,
    AreaJob,
    backward_sizes,
    forward_sizes,
    job_tables,
    scratch_sizes,
)
from diff3ds.render.cuda.device import Device, device_for
from diff3ds.render.cuda.job import Arrays
from diff3ds.render.cuda.sources import AREAS

# Indices fill 31 bits.
MOST = 2**31 - 1
# Room for so many times the last need, and the first guess (empirical): they only decide how often a call draws twice.
MARGIN, LEAST = 1.25, 1 << 14

_needs: dict[tuple[object, ...], list[int]] = {}


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What a forward pass leaves: the job, what it points to, how long lists are, and what ran it."""

    job: AreaJob
    tensors: list[Tensor | None]
    arrays: Arrays
    needs: list[int]
    sums: int
    device: Device


def draw(
    values: tuple[Tensor, ...],
    tables: tuple[Tensor, ...],
    background: Float[Tensor, "H W 4"] | None,
    size: tuple[int, int],
    save: bool,
) -> tuple[Float[Tensor, "H W 4"], _Drawn]:
    """The picture, and what `backward` needs.

    Raises:
        RuntimeError: a graph is captured.
        MemoryError: more than 2^31 of something.
    """
    points = values[0]
    device = device_for(points.device, points.dtype, AREAS)
    if device.capturing():
        raise RuntimeError("layers ask the device how much memory they need: draw them outside of a captured graph")
    made = job_tables(tables, len(points))
    packed = torch.cat([made[name].flatten() for name in TABLES]).int().to(points.device)
    given = [value.detach().contiguous() for value in values]
    below = None if background is None else background.detach().contiguous()
    width, height = size
    image = points.new_empty(height, width, 4)
    job = AreaJob(width=width, height=height, save=save, part_count=len(made["parts"]))
    for name, value in zip(
        ("point", "transform", "paint", "stop"), (given[0], given[2], given[3], given[5]), strict=True
    ):
        setattr(job, f"{name}_count", len(value))
    job.layer_count = len(made["layers"])
    parts = torch.split(packed, [made[name].numel() for name in TABLES])
    job.point(dict(zip((*VALUES, *TABLES), (*given, *parts), strict=True)) | {"background": below, "image": image})
    arrays, needs = _run(job, device, points)
    return image, _Drawn(job, [*given, below, packed], arrays, needs, int(made["layer_sums"][-1]), device)


def _run(job: AreaJob, device: Device, like: Tensor) -> tuple[Arrays, list[int]]:
    """Draws until lists fit: each try counts at least one list further."""
    key = (like.device, like.dtype, job.width, job.height)
    needs = _needs.get(key, [0] * len(LISTS))
    strides = device.strides
    names = ("begin_layers", "place_vertices", "write_vertices", "span_edges", "cover_rows", "paint_layers")
    launches = [(name, 1 if name == "place_vertices" else strides) for name in names]
    while True:
        lengths = [min(MOST, int(MARGIN * need) + LEAST) for need in needs]
        arrays, scratch = (
            Arrays(sizes, like.device) for sizes in (forward_sizes(job, lengths), scratch_sizes(lengths))
        )
        job.point(arrays)
        job.point(scratch)
        job.limit[:] = lengths
        device.launch(launches, job)
        needs = arrays["counters"].view(torch.int64).tolist()
        if max(*needs, job.layer_count * job.height) > MOST:
            raise MemoryError(f"layers need {max(needs):,} parts of edges, at most {MOST:,} are possible: draw fewer")
        if all(need <= length for need, length in zip(needs, lengths, strict=True)):
            _needs[key] = needs
            return arrays, needs


def backward(drawn: _Drawn, upstream: Float[Tensor, "H W 4"], want_background: bool) -> tuple[Tensor | None, ...]:
    """Gradients of the values, and of the background."""
    given = drawn.tensors[: len(VALUES)]
    gradients = [torch.empty_like(value) for value in given if value is not None]
    of_background = torch.empty_like(upstream) if want_background else None
    job = AreaJob.from_buffer_copy(drawn.job)
    upstream = upstream.contiguous()
    real = upstream.element_size()
    work = Arrays(backward_sizes(job, drawn.needs, drawn.sums, real), upstream.device)
    job.point({f"g_{name}": gradient for name, gradient in zip(VALUES, gradients, strict=True)})
    job.point({"g_image": upstream, "g_background": of_background})
    job.point(work)
    names = ("differentiate_pixels", "sum_rows", "sum_parts", "sum_layers", "finish_layers")
    drawn.device.launch([(name, drawn.device.strides) for name in names], job)
    return *gradients, of_background
