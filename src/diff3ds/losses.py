"""Losses: those that compare renderings with target images, and regularisers that look at the sketch."""

import math
from collections.abc import Sequence

import numpy as np
import torch

from diff3ds._checks import as_numbers
from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier import derivatives, evaluate
from diff3ds.sketch import Sketch

# Of the quadrature along a segment: lengths of cubics without cusps to 1e-6 (empirical).
NODES = 16
# Speeds below it (world units) are rounding: no bending is measured there.
TINY = 1e-12
# Distances by differences: by products they would lose half the digits.
EXACT = "donot_use_mm_for_euclid_dist"

# Weight of ink that no target shows, against ink that is missing. Edge maps leave hidden edges out, so extra ink is
# cheap; measured on two CAD models, .2 finds more of the edges than 1 (F-score .92 against .77).
EXTRA_INK = 0.2


def ink_loss(
    alpha: Float[Tensor, "V H W"],
    target: Float[Tensor, "V H W"],
    extra: float = EXTRA_INK,
    known: Bool[Tensor, "V H W"] | None = None,
) -> Float[Tensor, ""]:
    """Mean squared difference of ink, asymmetric: ink beyond the target counts `extra` times.

    Args:
        alpha: ink drawn, in [0, 1], as `Rendering.alpha`.
        target: ink wanted, in [0, 1].
        extra: weight of pixels where alpha > target; 1 is symmetric.
        known: pixels that count; default all.
    """
    missing = (target - alpha).clamp(min=0)
    surplus = (alpha - target).clamp(min=0)
    return _mean(missing.square() + extra * surplus.square(), known)


def composite_loss(
    color: Float[Tensor, "V H W 3"],
    alpha: Float[Tensor, "V H W"],
    target: Float[Tensor, "V H W 4"],
    background: Float[Tensor, " 3"] | Float[Tensor, "V H W 3"] | None = None,
    known: Bool[Tensor, "V H W"] | None = None,
) -> Float[Tensor, ""]:
    """Mean squared difference of drawings and pictures with alpha, both put over a background.

    With c the difference of colours times alpha, and a that of alpha, it is (c - a b)^2 over the background b.

    Args:
        color: drawn over black: colour times alpha.
        alpha: drawn.
        target: RGB times alpha, and alpha.
        background: colour, of all pixels or of each; None for the expectation over all colours, which fits alpha as
            well: values that are uniform in [0, 1] have the mean 1/2 and the variance 1/12.
        known: pixels that count; default all.
    """
    c, a = color - target[..., :3], (alpha - target[..., 3])[..., None]
    error = (c - a / 2).square() + a.square() / 12 if background is None else (c - a * background).square()
    return _mean(error.mean(-1), known)


def psnr(
    color: Float[Tensor, "V H W 3"], target: Float[Tensor, "V H W 3"], known: Bool[Tensor, "V H W"] | None = None
) -> float:
    """Peak signal-to-noise ratio in dB of images in [0, 1], the mean over views; infinite for equal images.

    Only pixels that are known count; default all.
    """
    error = (color.clamp(0, 1) - target).square().mean(-1)
    masks = [None] * len(error) if known is None else list(known)
    values = [_mean(e, mask) for e, mask in zip(error, masks, strict=True)]
    return sum(float(-10 * value.log10()) for value in values) / len(values)


def lengths(sketch: Sketch) -> Float[Tensor, " N"]:
    """Length of every stroke, world units; for a penalty that keeps strokes short, or all alike."""
    speed = torch.linalg.vector_norm(_velocity(sketch)[0], dim=-1)
    return _per_stroke(sketch, speed @ _weights(sketch))


def bending_energy(sketch: Sketch) -> Float[Tensor, " N"]:
    """Integral of the squared curvature along every stroke, 1 / world units: 2 pi / r of a circle of radius r.

    Corners at joints count nothing: give strokes smooth joints, or penalise their turns.
    """
    velocity, acceleration = _velocity(sketch)
    speed = torch.linalg.vector_norm(velocity, dim=-1).clamp_min(TINY)
    across = torch.linalg.vector_norm(torch.linalg.cross(velocity, acceleration), dim=-1)
    return _per_stroke(sketch, (across.square() / speed**5) @ _weights(sketch))


def uneven_speed(sketch: Sketch) -> Float[Tensor, " M"]:
    """Variance of the speed along each segment over its mean squared: 0 where the parameter runs evenly."""
    weights = _weights(sketch)
    speed: Tensor = torch.linalg.vector_norm(_velocity(sketch)[0], dim=-1)
    mean = (speed @ weights)[:, None]
    variance: Tensor = (speed - mean).square() @ weights
    return variance / mean[:, 0].square().clamp_min(TINY)


def crowding(sketch: Sketch, distance: float, samples: int = 16) -> Float[Tensor, ""]:
    """How much strokes come nearer to others than a distance: the mean of (1 - gap / distance)^2 where it is positive.

    Args:
        distance: world units, positive.
        samples: points along each segment; memory grows with the square of all of them.

    Raises:
        ValueError: a distance that is not positive, or no samples.
    """
    _check_distance(distance)
    points, stroke = _samples(sketch, samples)
    gap = torch.cdist(points, points, compute_mode=EXACT)
    near = (1 - gap / distance).clamp_min(0).square()
    return torch.where(stroke[:, None] == stroke, 0.0, near).sum() / max(1, len(points))


def asymmetry(
    sketch: Sketch, normal: Sequence[float] | Float[Tensor, " 3"], offset: float = 0.0, samples: int = 16
) -> Float[Tensor, ""]:
    """Mean squared distance from the sketch, reflected at a plane, to the nearest point of the sketch; world units^2.

    Args:
        normal: of the plane normal . x = offset |normal|.
        offset: of the plane, world units.
        samples: points along each segment.

    Raises:
        ValueError: a normal without a length, or not of three numbers.
    """
    n = as_numbers("normal", normal, torch.float64).to(sketch.points)
    if n.shape != (3,) or not float(torch.linalg.vector_norm(n.detach())) > 0:
        raise ValueError(f"normal must be three numbers with a length, got {normal}")
    n = n / torch.linalg.vector_norm(n)
    points, _ = _samples(sketch, samples)
    if not len(points):
        return points.sum()
    image = points - 2 * ((points @ n) - offset)[:, None] * n
    # The squares of differences, not the root's square: a point on the plane is its own image.
    nearest = torch.cdist(image.detach(), points.detach(), compute_mode=EXACT).argmin(1)
    gap: Tensor = (image - points[nearest]).square().sum(-1)
    return gap.mean()


def end_gaps(sketch: Sketch, distance: float) -> Float[Tensor, ""]:
    """Sum of the squared gaps between ends of strokes that are nearer than a distance to an end of another one.

    Drives ends together that nearly meet; ends that are farther apart, and closed strokes, have no part in it.

    Raises:
        ValueError: a distance that is not positive.
    """
    _check_distance(distance)
    first, last, stroke = _open_ends(sketch)
    ends, owner = torch.cat([first, last]), torch.cat([stroke, stroke])
    squares = (ends[:, None] - ends).square().sum(-1)
    apart = squares.detach().masked_fill(owner[:, None] == owner, math.inf)
    nearest, which = apart.min(1) if len(ends) else (squares.new_zeros(0), owner)
    chosen = squares[torch.arange(len(ends), device=owner.device), which]
    return torch.where(nearest < distance**2, chosen, 0.0).sum() / 2


def _check_distance(distance: float) -> None:
    if not isinstance(distance, int | float) or not 0 < distance < math.inf:
        raise ValueError(f"distance must be a positive number, got {distance!r}")


def _open_ends(sketch: Sketch) -> tuple[Tensor, Tensor, Tensor]:
    """Starts and ends of the open strokes, and which these are."""
    if sketch.chains is None:
        return sketch.points[:, 0], sketch.points[:, -1], torch.arange(len(sketch), device=sketch.points.device)
    stroke = (~sketch.chains.closed).nonzero()[:, 0]
    first, last = sketch.chains.first[:-1][stroke], sketch.chains.first[1:][stroke] - 1
    return sketch.points[first, 0], sketch.points[last, -1], stroke


def _nodes(sketch: Sketch) -> tuple[Tensor, Tensor]:
    """Gauss-Legendre nodes in [0, 1] and their weights."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return torch.as_tensor((nodes + 1) / 2).to(sketch.points), torch.as_tensor(weights / 2).to(sketch.points)


def _weights(sketch: Sketch) -> Tensor:
    return _nodes(sketch)[1]


def _velocity(sketch: Sketch) -> tuple[Float[Tensor, "M Q 3"], Float[Tensor, "M Q 3"]]:
    """First and second derivative of the segments at the nodes."""
    return derivatives(sketch.points, sketch.weights, _nodes(sketch)[0])


def _samples(sketch: Sketch, count: int) -> tuple[Float[Tensor, "S 3"], Int[Tensor, " S"]]:
    """Points along all segments, at the middles of even steps, and their strokes."""
    if not isinstance(count, int) or count < 1:
        raise ValueError(f"samples must be a whole number, at least 1, got {count!r}")
    t = (torch.arange(count, device=sketch.points.device).to(sketch.points) + 0.5) / count
    points = evaluate(sketch.points, sketch.weights, t).flatten(0, 1)
    segment = torch.arange(len(sketch.points), device=points.device).repeat_interleave(count)
    return points, segment if sketch.chains is None else sketch.chains.stroke[segment]


def _per_stroke(sketch: Sketch, values: Float[Tensor, " M"]) -> Float[Tensor, " N"]:
    if sketch.chains is None:
        return values
    return values.new_zeros(len(sketch)).index_add(0, sketch.chains.stroke, values)


def _mean(values: Float[Tensor, "*S"], known: Bool[Tensor, "*S"] | None) -> Float[Tensor, ""]:
    """Mean over the known pixels; 0 if there are none."""
    if known is None:
        return values.mean()
    return (values * known).sum() / known.sum().clamp(min=1)
