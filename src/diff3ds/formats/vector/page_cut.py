"""Projected strokes cut at the border of the page: what no ink of theirs reaches is left out."""

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.formats.vector.screen_pieces import Pieces


def on_page(pieces: Pieces, size: tuple[int, int]) -> Pieces:
    """The pieces, cut where their discs leave the page; what lies beyond is left out."""
    limit = pieces.points.new_tensor([size[1], size[0]])
    reach = pieces.points[..., 2].amax(1)
    inside = (pieces.points[..., :2] >= -reach[:, None, None]) & (
        pieces.points[..., :2] <= limit + reach[:, None, None]
    )
    out = (~inside.flatten(1).all(1)).nonzero()[:, 0]
    if not len(out):
        return pieces
    low, high = -reach[out, None], limit + reach[out, None]
    # Where the coordinates of a piece, cubics of its parameter, are those of a border.
    control = pieces.points[out, :, :2]
    borders = [control[..., axis] - border[:, axis, None] for axis in (0, 1) for border in (low.expand(-1, 2), high)]
    crossings = [
        torch.tensor([0.0, *sorted(_roots(torch.stack([b[i] for b in borders]))), 1.0], dtype=control.dtype)
        for i in range(len(out))
    ]
    rows = torch.repeat_interleave(out, torch.tensor([len(c) - 1 for c in crossings]))
    start, stop = torch.cat([c[:-1] for c in crossings]), torch.cat([c[1:] for c in crossings])
    cut = pieces.rows(rows).parts(start, stop)
    parts = cut.points
    middle = (parts[:, :, :2] * parts.new_tensor([1.0, 3.0, 3.0, 1.0])[:, None]).sum(1) / 8
    shown = ((middle >= -reach[rows, None]) & (middle <= limit + reach[rows, None])).all(1)
    whole = torch.ones(len(pieces.stroke), dtype=torch.bool)
    whole[out] = False
    kept = Pieces(*(torch.cat([a[whole], b[shown]]) for a, b in zip(pieces, cut, strict=True)))
    order = kept.start.argsort(stable=True)
    return kept.rows(order[kept.stroke[order].argsort(stable=True)])


def _roots(cubics: Float[Tensor, "B 4"]) -> set[float]:
    """Where cubics in Bernstein form are zero, in (0, 1)."""
    b0, b1, b2, b3 = cubics.unbind(-1)
    power = torch.stack([b3 - 3 * b2 + 3 * b1 - b0, 3 * (b2 - 2 * b1 + b0), 3 * (b1 - b0), b0], -1).numpy()
    found: set[float] = set()
    for row in power:
        scale = abs(row).max()
        # Of a line the first coefficients are rounding, and would make roots far away.
        row = np.where(abs(row) > 1e-12 * scale, row, 0) if scale > 0 else row
        roots = np.roots(row)
        found |= {float(r.real) for r in roots if abs(r.imag) < 1e-9 and 0 < r.real < 1}
    return found
