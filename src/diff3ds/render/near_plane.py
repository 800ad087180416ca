"""The parts of projected segments that lie in front of the near plane (docs/explanation/mathematics.md, eq. 2)."""

from typing import NamedTuple

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier.pieces import power_coefficients
from diff3ds.bezier.polynomial import real_roots


class Spans(NamedTuple):
    """Visible parameter intervals, at most two a segment and view, in the order of (view, segment, start)."""

    view: Int[Tensor, " S"]
    segment: Int[Tensor, " S"]
    start: Float[Tensor, " S"]
    stop: Float[Tensor, " S"]


@torch.no_grad()
def visible_spans(margin: Float[Tensor, "V M 4"]) -> Spans:
    """The maximal intervals of [0, 1] on which a cubic is positive: `Strokes2D.margin`."""
    views, segments = margin.shape[:2]
    view, segment = torch.meshgrid(torch.arange(views), torch.arange(segments), indexing="ij")
    view, segment = view.to(margin.device), segment.to(margin.device)
    # Cubic in t: positive coefficients mean positive all along, negative ones negative.
    clear = (margin > 0).all(-1)
    cut = ~clear & (margin > 0).any(-1)
    parts = [_whole(view[clear], segment[clear])]
    if len(some := margin[cut]):
        parts.append(_cut(view[cut], segment[cut], some))
    spans = Spans(*(torch.cat(column) for column in zip(*parts, strict=True)))
    order = (spans.view * segments + spans.segment).argsort(stable=True)
    return Spans(*(column[order] for column in spans))


def _whole(view: Tensor, segment: Tensor) -> Spans:
    zero = torch.zeros(len(view), dtype=torch.float64, device=view.device)
    return Spans(view, segment, zero, zero + 1)


def _cut(view: Tensor, segment: Tensor, margin: Float[Tensor, "M 4"]) -> Spans:
    """Spans of segments whose margin changes sign, or may."""
    coefficients = power_coefficients(margin[..., None])[..., 0, :]
    roots = (real_roots(coefficients) + 1) / 2
    ends = torch.tensor([0.0, 1.0], dtype=torch.float64, device=margin.device).expand(len(margin), 2)
    bounds = torch.cat([torch.where(roots.isnan(), 1.0, roots), ends], -1).sort(-1).values
    middle = (bounds[:, 1:] + bounds[:, :-1]) / 2
    basis = torch.stack(
        [(1 - middle) ** 3, 3 * middle * (1 - middle) ** 2, 3 * middle**2 * (1 - middle), middle**3], -1
    )
    visible = ((basis @ margin[..., None])[..., 0] > 0) & (bounds[:, 1:] > bounds[:, :-1])
    # A double root splits a visible part in two that touch: keep it one.
    joined = visible[:, 1:] & visible[:, :-1]
    row, first = (visible & ~torch.nn.functional.pad(joined, (1, 0))).nonzero(as_tuple=True)
    last_row, last = (visible & ~torch.nn.functional.pad(joined, (0, 1))).nonzero(as_tuple=True)
    return Spans(view[row], segment[row], bounds[row, first], bounds[last_row, last + 1])
