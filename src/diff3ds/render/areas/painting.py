"""The reference of painting: colours of layers, one over the other."""

from dataclasses import fields

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.render.areas.flat_contours import layer_edges
from diff3ds.render.areas.painted_layers import LINEAR, PLAIN, Layers
from diff3ds.render.areas.pixel_areas import covered


def painted(
    layers: Layers, width: int, height: int, background: Float[Tensor, "H W 4"] | None
) -> Float[Tensor, "H W 4"]:
    """The picture as `draw_layers` says, in operations of torch: the specification, slow.

    A pixel's straight colour is the mean of its points' straight colours, those that nothing covers counting as black.
    What lies below counts as one colour: exact where at most one layer covers a pixel partly, and for opaque layers as
    far as coverages are independent of each other. In float64 whatever the layers are in, as the kernels: a level edge
    is sheared by less than float32 resolves.
    """
    if layers.points.dtype != torch.float64:
        background = None if background is None else background.double()
        values = {f.name: getattr(layers, f.name) for f in fields(Layers)}
        doubled = Layers(**{name: v.double() if v.is_floating_point() else v for name, v in values.items()})
        return painted(doubled, width, height, background).to(layers.points.dtype)
    below = layers.points.new_zeros((height, width, 4)) if background is None else background
    straight, alpha = below[..., :3], below[..., 3:]
    # Colours times alpha, and the share of a pixel that anything covers.
    color, union = straight, torch.full_like(alpha, 0 if background is None else 1)
    for row, (_, _, rule, _, paint) in enumerate(layers.layers.tolist()):
        share = covered(layer_edges(layers, row), rule, width, height)[..., None]
        paint_color = _paint(layers, paint, width, height)
        own, opacity = paint_color[..., :3], paint_color[..., 3:]
        over = opacity * union + (1 - opacity) * alpha
        seen = over > 0
        mixed = torch.where(seen, opacity * union * own + (1 - opacity) * color, 0) / torch.where(seen, over, 1)
        mixed = union * mixed + (1 - union) * torch.where(opacity > 0, own, 0)
        straight = straight + share * (mixed - straight)
        color = color + share * opacity * (own - color)
        alpha = alpha + share * opacity * (1 - alpha)
        union = union + share * (1 - union)
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
