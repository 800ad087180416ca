"""Projected rational strokes as polynomial cubics or chords on the screen, to a guaranteed tolerance.

Strokes are homogeneous cubics whose coordinates, divided by the last one, are x, y and the half width in pixels: the
perspective width of a tube is as rational as its position, and is approximated along with it.
"""

import math
from typing import NamedTuple

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier.curves import bernstein, subcurve_matrix
from diff3ds.bezier.pieces import standard_form
from diff3ds.project import Strokes2D
from diff3ds.render.visible import visible_spans
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
        points: polynomial Bézier control points (x, y, half width) in pixels: cubics, or chords in the same form.
        depth: camera depth in the middle, world units.
    """

    stroke: Int[Tensor, " P"]
    start: Float[Tensor, " P"]
    stop: Float[Tensor, " P"]
    points: Float[Tensor, "P 4 3"]
    depth: Float[Tensor, " P"]


@torch.no_grad()
def screen_pieces(strokes: Strokes2D, view: int, size: tuple[int, int], tolerance: float) -> Pieces:
    """What one view shows of the strokes: cubics for widths in image units, chords for those in world units.

    Guaranteed up to rounding: at every parameter (after a projective change that leaves the curve as it is), piece and
    stroke differ by at most the tolerance in position and half width together. Parts that the image cannot show, and
    parts behind the near plane, are left out; what is kept reaches at most an image size beyond the image, or as far as
    it is wide where that is more.

    Args:
        size: (height, width) in pixels.
        tolerance: pixels.
    """
    cubics = strokes.cubics[view].double()
    spans = visible_spans(strokes.margin[view, None])
    segment, start, stop = spans.segment, spans.start, spans.stop
    half_width = strokes.half_width[min(view, len(strokes.half_width) - 1)].double()
    along = half_width.ndim == 2
    # A width along the stroke is no rational cubic: it is read off at the ends of chords instead.
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
        points, error = _approximation(part, chords=along or strokes.width_space == "world")
        if along:
            radii, change = _widths(cut, half_width[segment], cubics[segment], strokes.width_space)
            points, error = torch.cat([points[..., :2], radii[..., None]], -1), error + change
        hidden = ahead & _beyond(part[..., :3] / part[..., 3:], size)
        fits = ahead & ~hidden & (error <= tolerance) & _within(points, size)
        middle = (start + stop) / 2
        place = (bernstein(middle, 3)[:, None] @ cubics[segment])[:, 0]
        columns = Pieces(segment, start, stop, points, strokes.depth(place))
        done.append(Pieces(*(column[fits] for column in columns)))
        rest = ~fits & ~hidden
        segment = segment[rest].repeat(2)
        start, stop = torch.cat([start[rest], middle[rest]]), torch.cat([middle[rest], stop[rest]])
        if len(segment) == 0:
            break
    pieces = Pieces(*(torch.cat(column) for column in zip(*done, strict=True)))
    order = pieces.start.argsort(stable=True)
    order = order[pieces.stroke[order].argsort(stable=True)]
    segment, start, stop, points, depth = (column[order] for column in pieces)
    return Pieces(strokes.stroke_of(segment), segment + start, segment + stop, points, depth)


def _widths(
    cut: Float[Tensor, "P 4 4"], half_width: Float[Tensor, "P 4"], cubics: Float[Tensor, "P 4 4"], space: WidthSpace
) -> tuple[Float[Tensor, "P 4"], Float[Tensor, " P"]]:
    """Half widths in pixels along chords, from end to end, and a bound of how far those in between may be off."""
    polynomial = (cut @ half_width[..., None])[..., 0]
    low, high, ends = polynomial.amin(-1), polynomial.amax(-1), polynomial[:, [0, 3]]
    if space == "world":
        part = cut @ cubics
        depth = part[..., 2] / part[..., 3]
        low, high, ends = low / depth.amax(-1), high / depth.amin(-1), ends / depth[:, [0, 3]]
    thirds = torch.arange(4, dtype=ends.dtype, device=ends.device) / 3
    return ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * thirds, high - low


def _approximation(part: Float[Tensor, "P 4 4"], chords: bool) -> tuple[Float[Tensor, "P 4 3"], Float[Tensor, " P"]]:
    """Polynomial cubics through the ends, with the tangents (or, as chords, without), and bounds of their distance.

    With end weights made 1 (a projective change of the parameter), the velocity of a rational cubic at its ends is
    3 w1 (P1 - P0) and 3 w2 (P3 - P2). The difference N / W - Q has the numerator N - Q W, whose Bernstein coefficients
    (degree 6) over those of W, raised to degree 6 too, bound it, for W > 0.
    """
    part, _ = standard_form(part)
    origin = part[:, :1, :3]
    weights = part[..., 3:]
    moved = part[..., :3] - origin * weights
    end = moved[:, 3:]
    zero = torch.zeros_like(end)
    if chords:
        q = torch.cat([zero, end / 3, 2 * end / 3, end], 1)
    else:
        q = torch.cat([zero, moved[:, 1:2], end + moved[:, 2:3] - end * weights[:, 2:3], end], 1)
    table = _product_table().to(part)
    numerator = torch.einsum("kij,pijd->pkd", table, moved[:, None] - q[:, :, None] * weights[:, None])
    denominator = torch.einsum("kij,pjd->pkd", table, weights)
    error = torch.linalg.vector_norm(numerator / denominator, dim=-1).amax(-1)
    # A weight that is not positive gives no bound: NaN compares as too far.
    return q + origin, error


def _product_table() -> Float[Tensor, "7 4 4"]:
    """Coefficients k of the product of two cubics in Bernstein form: sum over i + j = k of table[k, i, j] a_i b_j."""
    table = torch.zeros(7, 4, 4, dtype=torch.float64)
    for i in range(4):
        for j in range(4):
            table[i + j, i, j] = math.comb(3, i) * math.comb(3, j) / math.comb(6, i + j)
    return table


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
