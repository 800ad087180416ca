"""Which strokes a running fit should keep, and which to add."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras
from diff3ds.sketch import Sketch

# The paper measures the length of a stroke by 20 chords.
CHORDS = 20


@dataclass(frozen=True, eq=False)
class Edit:
    """A change of the strokes of a running fit.

    Attributes:
        kept: indices of the strokes that stay.
        added: new strokes, put behind them.
    """

    kept: Int[Tensor, " M"]
    added: Sketch | None = None


# Called after a step with its index, the number of steps, the sketch and the run's generator; None changes nothing.
Refinement = Callable[[int, int, Sketch, torch.Generator], Edit | None]


@dataclass(frozen=True)
class NoiseDeletion:
    """The paper's dynamic noise deletion, a refinement: strokes shorter than a threshold are dropped now and then.

    Attributes:
        length: strokes shorter than this go, world units. The paper: 0.1 in a ball of radius 1.5.
        start: fraction of the steps before the first deletion; the paper: 2,000 of 4,000.
        every: fraction of the steps between deletions; the paper: 100 of 4,000.
    """

    length: float = 0.1
    start: float = 0.5
    every: float = 0.025

    def __post_init__(self) -> None:
        for name in ("length", "start", "every"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0 <= value < math.inf):
                raise ValueError(f"{name} must be a number, finite and not negative, got {value!r}")

    def __call__(self, step: int, steps: int, sketch: Sketch, generator: torch.Generator) -> Edit | None:
        """The strokes to keep after this step, or None."""
        if not self.due(step, steps):
            return None
        keep = long_enough(sketch, self.length)
        return None if bool(keep.all()) else Edit(keep.nonzero()[:, 0])

    def due(self, step: int, steps: int) -> bool:
        """Whether strokes are deleted after this step (counted from 0) of so many."""
        first, period = round(self.start * steps), max(1, round(self.every * steps))
        done = step + 1
        return done >= first and (done - first) % period == 0


@dataclass(frozen=True, eq=False)
class SupportPruning:
    """A refinement for edge maps: strokes that too few views confirm are dropped, at first in exchange for new ones.

    Hidden edges are missing in most views, so few need to agree.

    Attributes:
        cameras: of all views.
        ink: their targets, thickened by the distance that counts as agreement.
        least: mean `support` of a stroke to stay.
        length: shortest stroke to stay, world units.
        replace: fractions of the steps at which the count is restored by new strokes.
        drop: fractions of the steps at which strokes are only dropped.
        fresh: makes so many new strokes.
        count: strokes after a replacement.
    """

    cameras: Cameras
    ink: Float[Tensor, "V H W"]
    least: float
    length: float
    replace: tuple[float, ...]
    drop: tuple[float, ...]
    fresh: Callable[[int, torch.Generator], Sketch]
    count: int

    def __call__(self, step: int, steps: int, sketch: Sketch, generator: torch.Generator) -> Edit | None:
        """The strokes to keep and add after this step, or None."""
        replacing, dropping = (
            step + 1 in [round(x * steps) for x in fractions] for fractions in (self.replace, self.drop)
        )
        if not (replacing or dropping):
            return None
        supported = _mean_of_strokes(sketch, support(sketch, self.cameras, self.ink).mean(1))
        # The best stroke stays in any case: a sketch never becomes empty.
        keep = (supported > self.least) & long_enough(sketch, self.length) | (supported == supported.max())
        kept = keep.nonzero()[:, 0]
        missing = self.count - len(kept) if replacing else 0
        return Edit(kept, self.fresh(missing, generator) if missing > 0 else None)


def chord_lengths(sketch: Sketch) -> Float[Tensor, " N"]:
    """Lengths of the strokes, segments measured along `CHORDS` chords between evenly spaced parameters, world units."""
    points = _along(sketch, CHORDS + 1)
    steps: Tensor = torch.linalg.vector_norm(points[:, 1:] - points[:, :-1], dim=-1)
    return _sum_of_strokes(sketch, steps.sum(1))


def _sum_of_strokes(sketch: Sketch, values: Float[Tensor, " M"]) -> Float[Tensor, " N"]:
    """Over the segments of each stroke."""
    if sketch.chains is None:
        return values
    return values.new_zeros(len(sketch)).index_add(0, sketch.chains.stroke, values)


def _mean_of_strokes(sketch: Sketch, values: Float[Tensor, " M"]) -> Float[Tensor, " N"]:
    return values if sketch.chains is None else _sum_of_strokes(sketch, values) / sketch.chains.counts


def long_enough(sketch: Sketch, length: float) -> Bool[Tensor, " N"]:
    """Strokes to keep in noise deletion. The longest stays in any case: a sketch never becomes empty."""
    lengths = chord_lengths(sketch)
    return lengths.ge(min(length, float(lengths.max()))) if len(sketch) else lengths > 0


def support(
    sketch: Sketch, cameras: Cameras, ink: Float[Tensor, "V H W"], samples: int = CHORDS
) -> Float[Tensor, "M S"]:
    """Share of the views that show ink where the samples of each segment appear.

    A view that does not contain a sample (outside the image, or behind the camera) does not count for it; a sample that
    no view contains has support 0. Bilinear between pixels.

    Args:
        ink: target images in [0, 1].
        samples: points along each segment, at the middles of even parameter steps.
    """
    points = _along(sketch, 2 * samples + 1)[:, 1::2].double()
    homogeneous = torch.cat([points, torch.ones_like(points[..., :1])], -1)
    projected = torch.einsum("vij,nsj->vnsi", cameras.projection, homogeneous)
    pixels, depth = cameras.seen(projected)
    height, width = cameras.size
    scale = pixels.new_tensor([2 / width, 2 / height])
    # View by view: in double precision all of them would take much room.
    seen = torch.zeros_like(depth)
    for view, image in enumerate(ink):
        seen[view] = _read(image, pixels[view] * scale - 1)
    inside = ((pixels > 0) & (pixels < 2 / scale)).all(-1) & (depth > cameras.near)
    return ((seen * inside).sum(0) / inside.sum(0).clamp(min=1)).to(sketch.points.dtype)


def _read(image: Float[Tensor, "H W"], places: Float[Tensor, "N S 2"]) -> Float[Tensor, "N S"]:
    """Between the pixels of one image; places in [-1, 1]."""
    image = image[None, None].double()
    return torch.nn.functional.grid_sample(image, places[None], mode="bilinear", align_corners=False)[0, 0]


def _along(sketch: Sketch, count: int) -> Float[Tensor, "M S 3"]:
    points, weights = sketch.points.detach(), sketch.weights.detach()
    return evaluate(points, weights, torch.linspace(0, 1, count, dtype=points.dtype, device=points.device))
