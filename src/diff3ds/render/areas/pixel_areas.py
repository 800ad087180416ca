"""The reference of exact areas: how much of each pixel polygons cover, by slabs between their vertices."""

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.render.areas.painted_layers import EVEN_ODD

# Pictures are sheared by so little that a thousand pixels move by a millionth of one.
SHEAR = 2.0**-30
# Edges that are no further apart, in pixels, lie on each other.
TOUCH = 1e-9
# Slabs thinner than this, in pixels, are left out; their area is less still.
THIN = 1e-12


def covered(edges: Float[Tensor, "E 2 2"], rule: int, width: int, height: int) -> Float[Tensor, "H W"]:
    """The share of each pixel in which the winding number is odd, or not zero.

    Between two neighbouring heights at which an edge ends or two cross, edges have an order from left to right, and
    what lies between two of them is a trapezoid: the areas are exact, and autograd differentiates them.
    """
    # A level edge is where its two ends are at once: sheared, no edge is level, and each end moves its half of it.
    sheared = torch.stack([edges[..., 0], edges[..., 1] + SHEAR * edges[..., 0]], -1)
    kept = sheared[sheared[:, 0, 1] != sheared[:, 1, 1]]
    low, high = kept.detach()[:, :, 1].aminmax(dim=1)
    rows = []
    for row in range(height):
        inside = kept[(low < row + 1) & (high > row)]
        rows.append(_row(inside, rule, width, row) if len(inside) else edges.new_zeros(width))
    return torch.stack(rows)


def _row(edges: Float[Tensor, "E 2 2"], rule: int, width: int, row: int) -> Float[Tensor, " W"]:
    """Coverage of one row of pixels."""
    down = edges[:, 1, 1] > edges[:, 0, 1]
    top, bottom = (torch.where(down[:, None], edges[:, k], edges[:, 1 - k]) for k in (0, 1))
    slope = (bottom[:, 0] - top[:, 0]) / (bottom[:, 1] - top[:, 1])
    ends = torch.cat([top[:, 1], bottom[:, 1], _crossings(top, bottom, slope)])
    ends = ends[(ends > row) & (ends < row + 1)]
    heights = torch.cat([edges.new_tensor([row, row + 1]), ends]).sort().values
    thick = (heights.diff() > THIN).nonzero().flatten()
    # Where several edges end at one height, it is one of them that moves where a slab ends and the next begins.
    end = heights[thick + 1]
    start = torch.cat([heights[:1], end[:-1]])
    middle = (start + end)[:, None].detach() / 2
    active = (top[:, 1] <= middle) & (bottom[:, 1] >= middle)
    place = torch.where(active, top[:, 0] + (middle - top[:, 1]) * slope, torch.inf).detach()
    order = place.argsort(dim=1, stable=True)
    winding = torch.where(active, torch.where(down, 1, -1), 0).gather(1, order).cumsum(1)
    filled = (winding % 2 if rule == EVEN_ODD else winding != 0).to(torch.int8)
    # Edges that lie on each other are one border, or none.
    x = place.gather(1, order)
    last = torch.cat([~(x[:, 1:] - x[:, :-1] <= TOUCH), torch.ones_like(active[:, :1])], 1)
    filled = torch.where(last, filled, -1)
    rank = torch.arange(filled.shape[1]).expand_as(filled)
    before = torch.where(last, rank, -1).cummax(1).values.roll(1, 1)
    before[:, 0] = -1
    sign = torch.where(last, filled - torch.where(before >= 0, filled.gather(1, before.clamp(min=0)), 0), 0)
    slab, rank = sign.nonzero(as_tuple=True)
    edge, sign = order[slab, rank], sign[slab, rank]
    a, b = start[slab], end[slab]
    x = top[edge, 0] + (torch.stack([a, b]) - top[edge, 1]) * slope[edge]
    right = torch.arange(1, width + 1, dtype=edges.dtype)[:, None, None] - x
    share = _mean_clamped(right[:, 0], right[:, 1])
    return (share * ((b - a) * sign)).sum(1)


def _crossings(
    top: Float[Tensor, "E 2"], bottom: Float[Tensor, "E 2"], slope: Float[Tensor, " E"]
) -> Float[Tensor, " C"]:
    """The heights at which two edges cross."""
    i, j = torch.triu_indices(len(top), len(top), 1)
    start = torch.maximum(top[i, 1], top[j, 1]).detach()
    end = torch.minimum(bottom[i, 1], bottom[j, 1]).detach()

    def gap(y: Tensor, pair: tuple[Tensor, Tensor]) -> Tensor:
        p, q = pair
        return (top[p, 0] + (y - top[p, 1]) * slope[p]) - (top[q, 0] + (y - top[q, 1]) * slope[q])

    # Edges that lie on each other differ by rounding: they do not cross.
    before, behind = gap(start, (i, j)).detach(), gap(end, (i, j)).detach()
    crossing = (end > start) & (before * behind < 0) & (before.abs() > THIN) & (behind.abs() > THIN)
    i, j, start = i[crossing], j[crossing], start[crossing]
    return start - gap(start, (i, j)) / (slope[i] - slope[j])


def _mean_clamped(a: Float[Tensor, "*N"], b: Float[Tensor, "*N"]) -> Float[Tensor, "*N"]:
    """The mean, over what lies between a and b, of a number clamped to [0, 1]."""

    def integral(u: Tensor) -> Tensor:
        return torch.where(u < 0, 0, torch.where(u > 1, u - 0.5, u * u / 2))

    apart = (b - a).abs() > 1e-6  # below, the mean is the middle's to the last digits that a difference leaves
    step = torch.where(apart, b - a, 1)
    # Exactly between two pixels an edge has the derivative of one of them: torch's clamp would give it to both.
    middle = (a + b) / 2
    middle = torch.where(middle <= 0, 0, torch.where(middle > 1, 1, middle))
    return torch.where(apart, (integral(b) - integral(a)) / step, middle)
