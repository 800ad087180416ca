"""Pictures by 32 x 32 samples a pixel of strokes at fixed depths, from the tests' oracle of distances.

A sample that an edge crosses counts by the share inside, the edge taken as straight in it: without that, pictures would
have steps in place of derivatives. Strokes have depths of their own, so they are painted one over the other, and a
picture is linear in each stroke's mask.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import torch

import diff3ds as ds

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "render"))
from oracles import CELLS, cell_centers, distances, inside


class Layers(NamedTuple):
    """Strokes from near to far: shares of their samples (N, H, W, 32 * 32), colours and opacities."""

    masks: torch.Tensor
    color: torch.Tensor
    opacity: torch.Tensor


def samples(size: tuple[int, int]) -> torch.Tensor:
    """Positions of all samples, (H, W, 32 * 32, 2)."""
    return torch.from_numpy(cell_centers(size)).view(*size, CELLS**2, 2)


def depth_inside(strokes: ds.Strokes2D, position: torch.Tensor) -> torch.Tensor:
    """How far inside the one stroke of the one view positions (P, 2) lie, pixels; negative outside."""
    distance, depth = distances(strokes.cubics[0, 0].numpy(), position.numpy())
    r = float(strokes.half_width[0, 0])
    return torch.from_numpy((r / depth if strokes.width_space == "world" else r) - distance)


def share(inside: torch.Tensor) -> torch.Tensor:
    """Share of samples that lie this deep inside."""
    return (inside * CELLS + 0.5).clamp(0, 1)


def layers(strokes: ds.Strokes2D, size: tuple[int, int]) -> tuple[Layers, torch.Tensor]:
    """The strokes of one view, which are given from near to far, and how deep inside each the samples lie."""
    world = strokes.width_space == "world"
    pairs = zip(strokes.cubics[0].numpy(), strokes.half_width[0].tolist(), strict=True)
    depths = torch.stack([torch.from_numpy(inside(c, r, size, world)).view(*size, -1) for c, r in pairs])
    return Layers(share(depths), strokes.color, strokes.opacity), depths


def picture(scene: Layers, background: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Colour (H, W, 3) and alpha (H, W)."""
    columns = [scene.color.mv(torch.eye(3, dtype=scene.color.dtype)[c]) for c in range(3)]
    color = [mean_value(scene, column, background) for column in columns]
    return torch.stack(color, -1), mean_value(scene, torch.ones_like(scene.opacity), 0.0)


def mean_value(scene: Layers, values: torch.Tensor, behind: float | torch.Tensor) -> torch.Tensor:
    """Mean over the samples of each pixel, (H, W), of values composited over `behind`.

    Args:
        values: of each stroke, (N,), or of each stroke and pixel, (N, H, W).
        behind: a number, or one a pixel (H, W).
    """
    clear = torch.ones(scene.masks.shape[1:], dtype=torch.float64)
    total = torch.zeros(scene.masks.shape[1:3], dtype=torch.float64)
    for mask, value, opacity in zip(scene.masks, values, scene.opacity, strict=True):
        shown = (mask * clear).mean(-1) * opacity
        total += shown * value
        clear = clear * (1 - opacity * mask)
    return total + clear.mean(-1) * behind


def gain(scene: Layers, index: int, values: torch.Tensor, behind: torch.Tensor) -> torch.Tensor:
    """What each sample (H, W, 32 * 32) gains when stroke `index` covers it: values as in `mean_value`, (N, H, W)."""
    clear = torch.ones(scene.masks.shape[1:], dtype=torch.float64)
    for mask, opacity in zip(scene.masks[:index], scene.opacity[:index], strict=True):
        clear = clear * (1 - opacity * mask)
    below = behind[..., None].expand(scene.masks.shape[1:])
    for mask, value, opacity in reversed(list(zip(scene.masks, values, scene.opacity, strict=True))[index + 1 :]):
        below = below + opacity * mask * (value[..., None] - below)
    return clear * scene.opacity[index] * (values[index][..., None] - below)
