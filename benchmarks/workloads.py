"""The scenes that the benchmarks draw: workloads A to D, and scenes like them of any size."""

from typing import NamedTuple

import torch

import diff3ds as ds


class Workload(NamedTuple):
    """How much there is to draw; `size` is (height, width)."""

    strokes: int
    views: int
    size: tuple[int, int]

    def __str__(self) -> str:
        return f"{self.strokes:,} strokes, {self.views} x {self.size[1]}x{self.size[0]}"


WORKLOADS = {
    "A": Workload(56, 4, (512, 512)),
    "B": Workload(1024, 1, (1024, 1024)),
    "C": Workload(56, 4, (64, 64)),
    "D": Workload(2048, 1, (1344, 2040)),
}


def scene(workload: Workload, seed: int = 0) -> tuple[ds.Sketch, ds.Cameras]:
    """Long bent cubics 1.5 to 4.5 px wide around a ball of radius .9, seen from an orbit at distance 2.7."""
    count, views, size = workload
    g = torch.Generator().manual_seed(seed)
    center = torch.nn.functional.normalize(torch.randn(count, 1, 3, generator=g), dim=-1)
    center *= 0.9 * torch.rand(count, 1, 1, generator=g) ** (1 / 3)
    sketch = ds.Sketch(
        center + 0.35 * torch.randn(count, 4, 3, generator=g),
        width=(0.5 + torch.rand(count, generator=g)) * 3 / size[0],
        color=torch.rand(count, 3, generator=g),
        opacity=0.6 + 0.4 * torch.rand(count, generator=g),
    )
    return sketch, ds.orbit([17 + 360 * v / views for v in range(views)], 15, 2.7, size=size)


def leaves(sketch: ds.Sketch) -> tuple[ds.Sketch, list[torch.Tensor]]:
    """A copy of a sketch whose five tensors want gradients, and these tensors."""
    tensors = {name: value.detach().clone().requires_grad_() for name, value in sketch.tensors().items()}
    return ds.Sketch(**tensors, width_space=sketch.width_space), list(tensors.values())
