"""Projected rational strokes as polynomial cubics on the screen, to a tolerance.

Strokes are homogeneous cubics whose coordinates, divided by the last one, are x, y and the half width in pixels: the
perspective width of a tube is as rational as its position, and is approximated along with it.
"""

from typing import NamedTuple

import numpy as np
import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier.curves import bernstein, subcurve_matrix
from diff3ds.bezier.pieces import CUBIC_THROUGH_THIRDS, from_standard, polynomial_cubics, standard_form
from diff3ds.project import Strokes2D
from diff3ds.render.near_plane import visible_spans
from diff3ds.sketch import WidthSpace

# 2^-48 of a stroke is below the resolution of its parameter.
MAX_HALVINGS = 48


class Pieces(NamedTuple):
    """P pieces of strokes, in the order of the strokes and along them.

    Attributes:
        stroke: index of the stroke.
        start: index of the segment plus the parameter in it; where it is the stop of the piece before on the same
            stroke, the two are joined.
        stop: the same.
        points: polynomial Bézier control points (x, y, half width) in pixels.
        hurry: c of `bezier.pieces.standard_form`: the cubic's parameter u and the stroke's t, from 0 at the start to 1
            at the stop, have the odds t / (1 - t) = c u / (1 - u).
    """

    stroke: Int[Tensor, " P"]
    start: Float[Tensor, " P"]
    stop: Float[Tensor, " P"]
    points: Float[Tensor, "P 4 3"]
    hurry: Float[Tensor, " P"]

    def rows(self, index: Tensor | slice) -> "Pieces":
        """Some of the pieces."""
        return Pieces(*(column[index] for column in self))

    def parameter(self, u: Float[Tensor, " P"]) -> Float[Tensor, " P"]:
        """The index of the segment plus the parameter in it, where the parameter of each cubic is u."""
        return self.start + (self.stop - self.start) * from_standard(u, self.hurry)

    def depth(self, strokes: Strokes2D, view: int, u: Float[Tensor, " P"]) -> Float[Tensor, " P"]:
        """Camera depth there, world units."""
        segment = ((self.start + self.stop) / 2).long()
        t = self.parameter(u) - segment
        return strokes.depth((bernstein(t, 3)[:, None] @ strokes.cubics[view, segment].double())[:, 0])

    def parts(self, start: Float[Tensor, " P"], stop: Float[Tensor, " P"]) -> "Pieces":
        """Of each piece the part between two parameters of its cubic."""
        ends = [1 - u + self.hurry * u for u in (start, stop)]
        first = torch.where(start == 0, self.start, self.parameter(start))
        last = torch.where(stop == 1, self.stop, self.parameter(stop))
        points = subcurve_matrix(start, stop, 3) @ self.points
        return Pieces(self.stroke, first, last, points, ends[1] / ends[0])


@torch.no_grad()
def screen_pieces(strokes: Strokes2D, view: int, size: tuple[int, int], tolerance: float) -> Pieces:
    """What one view shows of the strokes.

    At every parameter (after a projective change that leaves the curve as it is), piece and stroke differ by at most
    the tolerance in position and half width together: guaranteed up to rounding, but for widths along strokes, which
    are compared at three places of each piece. Parts that the image cannot show, and parts behind the near plane, are
    left out; what is kept reaches at most an image size beyond the image, or as far as it is wide where that is more.

    Args:
        size: (height, width) in pixels.
        tolerance: pixels.
    """
    cubics = strokes.cubics[view].double()
    spans = visible_spans(strokes.margin[view, None])
    segment, start, stop = spans.segment, spans.start, spans.stop
    half_width = strokes.half_width[min(view, len(strokes.half_width) - 1)].double()
    along = half_width.ndim == 2
    # A width along the stroke is no rational cubic of the same weights.
    rows = strokes.stroke_of(torch.arange(len(cubics), device=cubics.device))
    even = torch.zeros_like(cubics[:, 0, 0]) if along else half_width[rows]
    scale = cubics[..., 2] if strokes.width_space == "image" else cubics[..., 3]
    control = torch.stack([cubics[..., 0], cubics[..., 1], even[:, None] * scale, cubics[..., 2]], -1)
    done: list[Pieces] = []
    for _ in range(MAX_HALVINGS):
        cut = subcurve_matrix(start, stop, 3)
        part = cut @ control[segment]
        # Hulls need positive weights; in front of the near plane they become so by halving.
        ahead = (part[..., 3] > 0).all(-1)
        part, hurry = standard_form(part)
        points, error = polynomial_cubics(part)
        if along:
            radii, off = _widths(cut, hurry, half_width[segment], cubics[segment], strokes.width_space)
            points, error = torch.cat([points[..., :2], radii[..., None]], -1), error + off
        hidden = ahead & _beyond(part[..., :3] / part[..., 3:], size)
        fits = ahead & ~hidden & (error <= tolerance) & _within(points, size)
        middle = (start + stop) / 2
        columns = Pieces(segment, start, stop, points, hurry)
        done.append(Pieces(*(column[fits] for column in columns)))
        rest = ~fits & ~hidden
        segment = segment[rest].repeat(2)
        start, stop = torch.cat([start[rest], middle[rest]]), torch.cat([middle[rest], stop[rest]])
        if len(segment) == 0:
            break
    pieces = Pieces(*(torch.cat(column) for column in zip(*done, strict=True)))
    order = pieces.start.argsort(stable=True)
    order = order[pieces.stroke[order].argsort(stable=True)]
    segment, start, stop, points, hurry = pieces.rows(order)
    return Pieces(strokes.stroke_of(segment), segment + start, segment + stop, points, hurry)


def _widths(
    cut: Float[Tensor, "P 4 4"],
    hurry: Float[Tensor, " P"],
    half_width: Float[Tensor, "P 4"],
    cubics: Float[Tensor, "P 4 4"],
    space: WidthSpace,
) -> tuple[Float[Tensor, "P 4"], Float[Tensor, " P"]]:
    """Half widths in pixels as cubics through four places of each piece, and how far they are off between these."""
    t = from_standard(torch.arange(7, dtype=cut.dtype, device=cut.device) / 6, hurry[:, None])
    basis = bernstein(t, 3) @ cut
    radius = (basis @ half_width[..., None])[..., 0]
    if space == "world":
        place = basis @ cubics
        radius = radius * place[..., 3] / place[..., 2]
    through = radius[:, ::2] @ CUBIC_THROUGH_THIRDS.to(radius).T
    sixths = bernstein(torch.tensor([1.0, 3.0, 5.0], dtype=t.dtype, device=t.device) / 6, 3)
    return through, (through @ sixths.T - radius[:, 1::2]).abs().amax(-1)


def _beyond(points: Float[Tensor, "P K 3"], size: tuple[int, int]) -> Bool[Tensor, " P"]:
    """Whether all discs of the hulls lie beyond one side of the image."""
    reach = points[..., 2].amax(-1, keepdim=True)
    limit = points.new_tensor([size[1], size[0]])
    low = (points[..., :2] < -reach[..., None]).all(1)
    high = (points[..., :2] > limit + reach[..., None]).all(1)
    return (low | high).any(-1)


def _within(points: Float[Tensor, "P K 3"], size: tuple[int, int]) -> Bool[Tensor, " P"]:
    """Whether the hulls reach at most one image size beyond the image, or their half width where that is more."""
    limit = points.new_tensor([size[1], size[0]])
    # Near the camera a disc may cover the image from farther away.
    room = torch.maximum(limit, points[..., 2:].amax(1, keepdim=True))
    return ((points[..., :2] >= -room) & (points[..., :2] <= limit + room)).all(-1).all(-1)


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
