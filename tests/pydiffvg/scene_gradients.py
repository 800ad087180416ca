"""Gradients of what DiffVG's scenes show, by DiffVG itself (benchmarks/diffvg_truth.py) and by diff3ds.pydiffvg."""

from types import ModuleType

import torch
from diffvg_scenes import Scene, draw, scene
from torch import Tensor

# Scenes whose gradients are compared with DiffVG's own.
GRADIENT_SCENES = (
    "cubics",
    "crossing circles",
    "rectangle",
    "ellipse",
    "translucent fills",
    "linear, three stops",
    "radial, three stops",
    "opaque background",
)
# Scenes whose gradients by points and widths are compared with central differences of DiffVG's pictures.
DIFFERENCE_SCENES = (
    "lines",
    "mixed",
    "closed cubics",
    "widths of a cubic",
    "turned stroke",
    "united strokes",
    "hole, nonzero",
    "cubics",
)


def leaves(made: Scene) -> dict[str, Tensor]:
    """The tensors of a scene that have gradients, by name."""
    named: dict[str, Tensor] = {}
    for i, shape in enumerate(made.shapes):
        for key in ("points", "center", "radius", "p_min", "p_max", "stroke_width"):
            if hasattr(shape, key):
                named[f"shape {i} {key}"] = getattr(shape, key)
    for i, group in enumerate(made.groups):
        named[f"group {i} shape_to_canvas"] = group.shape_to_canvas
        for kind in ("fill_color", "stroke_color"):
            color = getattr(group, kind)
            if isinstance(color, Tensor):
                named[f"group {i} {kind}"] = color
            elif color is not None:
                keys = ("begin", "end", "center", "radius", "offsets", "stop_colors")
                named |= {f"group {i} {kind} {key}": getattr(color, key) for key in keys if hasattr(color, key)}
    if made.background is not None:
        named["background"] = made.background
    return named


def upstream(height: int, width: int) -> Tensor:
    """A smooth gradient (height, width, 4) of the picture."""
    y, x = torch.meshgrid(torch.arange(height) / height, torch.arange(width) / width, indexing="ij")
    waves = [torch.cos(a * x + b * y + c) for a, b, c in ((5, 2, 0), (-3, 4, 1), (4, -6, 2), (2, 5, 3))]
    return torch.stack(waves, -1)


def measured(module: ModuleType, made: Scene, samples: int = 16, seed: int = 0) -> Tensor:
    """The number whose gradients are compared."""
    return (draw(module, made, samples, seed).double() * upstream(*made.pixels[::-1])).sum()


def gradients(module: ModuleType, name: str, samples: int = 16, seed: int = 0) -> dict[str, Tensor]:
    """Gradients of what is measured of a scene, by the names of the leaves."""
    made = scene(module, name)
    named = leaves(made)
    for leaf in named.values():
        leaf.requires_grad_(True)
    measured(module, made, samples, seed).backward()
    return {key: leaf.grad for key, leaf in named.items() if leaf.grad is not None}
