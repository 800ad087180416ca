"""The reference of painting: colours of layers, one over the other."""

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.render.areas.flat_contours import layer_edges
from diff3ds.render.areas.painted_layers import LINEAR, PLAIN, Layers
from diff3ds.render.areas.pixel_areas import covered


def painted(
    layers: Layers, width: int, height: int, background: Float[Tensor, "H W 4"] | None
) -> Float[Tensor, "H W 4"]:
    """The picture as `draw_layers` says, in operations of torch: the specification, slow."""
    zeros = layers.points.new_zeros((height, width, 4))
    # Colours times alpha, alpha, and alpha if all paints were opaque.
    below = zeros if background is None else background
    color, alpha = below[..., :3], below[..., 3:]
    union = alpha
    for row, (_, _, rule, _, paint) in enumerate(layers.layers.tolist()):
        share = covered(layer_edges(layers, row), rule, width, height)[..., None]
        paint_color = _paint(layers, paint, width, height)
        opaque = share * paint_color[..., 3:]
        color = color + opaque * (paint_color[..., :3] - color)
        alpha = alpha + opaque * (1 - alpha)
        union = union + share * (1 - union)
    seen = alpha > 0
    straight = torch.where(seen, union * color / torch.where(seen, alpha, 1), 0)
    return torch.cat([straight, alpha], 2)


def _paint(layers: Layers, row: int, width: int, height: int) -> Tensor:
    """The paint's straight colour and alpha (4,), or (H, W, 4) at the middle of each pixel."""
    kind, first, count, transform = layers.paints[row].tolist()
    colors, offsets = layers.colors[first : first + count], layers.offsets[first : first + count]
    if kind == PLAIN:
        return colors[0]
    matrix, a, b = layers.transforms[transform], layers.axes[row, :2], layers.axes[row, 2:]
    y, x = torch.meshgrid(*(torch.arange(n, dtype=a.dtype) + 0.5 for n in (height, width)), indexing="ij")
    there = torch.linalg.solve(matrix[:, :2], (torch.stack([x, y], -1) - matrix[:, 2]).reshape(-1, 2).T).T
    linear = kind == LINEAR
    along = ((there - a) * (b - a)).sum(1) / (b - a).square().sum() if linear else ((there - a) / b).norm(dim=1)
    stop = (along.detach()[:, None] >= offsets.detach()).sum(1) - 1
    before, behind = stop.clamp(min=0), (stop + 1).clamp(max=count - 1)
    gap = offsets[behind] - offsets[before]
    between = (before != behind) & (stop >= 0) & (gap.detach() > 0)
    share = torch.where(between, (along - offsets[before]) / torch.where(between, gap, 1), 0)[:, None]
    return torch.lerp(colors[before], colors[behind], share).reshape(height, width, 4)
