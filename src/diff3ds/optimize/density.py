"""How many strokes a fit of coloured pictures has, and where: those that show nothing go, those that err are halved."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier import subcurve
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.optimize.strokes import Edit
from diff3ds.project import Strokes2D, project
from diff3ds.render import Analytic, rasterize
from diff3ds.sketch import Sketch

# Views that are drawn at a time, so that a pass over many needs little memory.
CHUNK = 8


@dataclass(frozen=True, eq=False)
class Observation:
    """Views in which errors are measured; small images of some of all views do.

    Attributes:
        cameras: of the views.
        targets: RGB times alpha, and alpha, that they should show.
        known: pixels that count.
        blur: that the targets carry, pixels.
    """

    cameras: Cameras
    targets: Float[Tensor, "V H W 4"]
    known: Bool[Tensor, "V H W"]
    blur: float = 0.0


@dataclass(frozen=True, eq=False)
class Density:
    """A refinement: strokes that hardly show are dropped; those with the greatest errors are halved, up to a limit.

    It has no state: a resumed run goes on as one that never stopped. The schedule and the thresholds are empirical.

    Attributes:
        details: what the sketch should show in the end; the strokes that err most in it are halved first.
        observed: what a step should show, as coarse as what the fit follows then, where nothing else is an error yet.
        least: halving goes on up to this many strokes, however small their errors.
        most: strokes never get more than this.
        project: what is drawn; see `FitConfig.project`.
        tolerance: root mean square error in what a step observes of a stroke, from which on it may be halved.
        unseen: a stroke goes that shows less than this fraction of what the mean one shows; after the last step as
            well.
        start, end: fractions of the steps before the first change and up to the last one.
        every: fraction of the steps between changes.
        growth: the number of strokes grows at most by this factor in a change.
    """

    details: Observation
    observed: Callable[[int], Observation]
    least: int
    most: int
    project: Callable[[Sketch, Cameras], Strokes2D] = project
    tolerance: float = 0.05
    unseen: float = 0.02
    start: float = 0.15
    end: float = 0.75
    every: float = 0.05
    growth: float = 1.5

    def __call__(self, step: int, steps: int, sketch: Sketch, generator: torch.Generator) -> Edit | None:
        """The strokes to keep and the halves to add after this step, or None. After the last one none is halved."""
        last = step + 1 == steps
        if not (last or self.due(step, steps)):
            return None
        shown, detail = footprints(sketch, self.details, self.project)
        # The one that shows most stays in any case: a sketch never becomes empty.
        alive = (shown > self.unseen * shown.mean()) | (shown == shown.max())
        count = int(alive.sum())
        seen, error = footprints(sketch, self.observed(step), self.project)
        wrong = alive & (error > self.tolerance**2 * seen)
        room = 0 if last else min(self.most, int(self.growth * len(sketch)) + 1) - count
        # Those that are wrong come first, and then, if there must be more strokes, the others.
        worst = (detail + wrong * detail.sum()).masked_fill(~alive, -1).argsort(descending=True, stable=True)
        halved = worst[: max(0, min(room, max(int(wrong.sum()), self.least - count), count))]
        alive[halved] = False
        if bool(alive.all()):
            return None
        return Edit(alive.nonzero()[:, 0], halves(sketch, halved) if len(halved) else None)

    def due(self, step: int, steps: int) -> bool:
        """Whether strokes are changed after this step (counted from 0) of so many."""
        done, period = step + 1, max(1, round(self.every * steps))
        return round(self.start * steps) <= done <= round(self.end * steps) and done % period == 0


def footprints(
    sketch: Sketch, observed: Observation, project: Callable[[Sketch, Cameras], Strokes2D] = project
) -> tuple[Float[Tensor, " N"], Float[Tensor, " N"]]:
    """Measures what each stroke shows, in pixels, and the squared error in it; sums over all views.

    The derivative of a rendering with respect to a stroke's colour is the stroke's blend weight in each pixel, behind
    all that is before it. Weighted by one in one channel, and by the error in another, both sums come from one pass.
    """
    total = sketch.color.new_zeros(len(sketch), 3)
    cameras = observed.cameras
    for views in _chunks(len(cameras)):
        color = sketch.color.detach().clone().requires_grad_()
        strokes = project(replace(sketch, color=color), cameras[views])
        drawn = rasterize(strokes, cameras.size, background=0.0, antialiasing=Analytic(observed.blur))
        wrong = torch.cat([drawn.color, drawn.alpha[..., None]], -1).detach() - observed.targets[views]
        seen = observed.known[views].to(color.dtype)
        error = wrong.square().mean(-1) * seen
        total += torch.autograd.grad(drawn.color, color, torch.stack([seen, error, torch.zeros_like(seen)], -1))[0]
    return total[:, 0], total[:, 1]


def halves(sketch: Sketch, chosen: Int[Tensor, " M"]) -> Sketch:
    """First the first halves of these strokes, then the second ones: the same drawing, but for the new ends.

    Strokes of several segments are halved at the joint in their middle; closed ones there and where they close.
    """
    old = sketch[chosen].detach()
    return Sketch.concatenate([_part(old, first=True), _part(old, first=False)])


def _part(sketch: Sketch, first: bool) -> Sketch:
    """The first or second halves of all strokes, open."""
    chains = sketch.chains or Chains.plain(len(sketch), sketch.points.device)
    start, stop = (0.0, 0.5) if first else (0.5, 1.0)
    points, weights = subcurve(sketch.points, sketch.weights, start, stop)
    # Half widths are polynomials: curves of one dimension without weights.
    width = sketch.width if sketch.width.ndim == 1 else subcurve(sketch.width[..., None], None, start, stop)[0][..., 0]
    half = (chains.counts // 2).clamp_min(1)[chains.stroke]
    place = torch.arange(len(chains.stroke), device=half.device) - chains.first[chains.stroke]
    whole = (chains.counts > 1)[chains.stroke]
    kept = ~whole | ((place < half) if first else (place >= half))
    rows = {"points": points, "weights": weights} | ({"width": width} if width.ndim == 2 else {})
    given = {name: getattr(sketch, name) for name in rows}
    cut = {
        name: torch.where(whole.reshape(-1, *[1] * (value.ndim - 1)), given[name], value)[kept]
        for name, value in rows.items()
    }
    open_ = Chains(chains.stroke[kept], torch.zeros_like(chains.closed))
    return sketch.replace(**cut, chains=open_)


def _chunks(count: int) -> Iterator[Int[Tensor, " B"]]:
    for first in range(0, count, CHUNK):
        yield torch.arange(first, min(first + CHUNK, count))
