"""The end of a run with the built-in prior: finer pictures than those in which the shape was found.

Where lines lie closer than the thick strokes of small pictures, any scribble looks right. Larger pictures with thinner
strokes of the members that the sketch has come to be like put each stroke on a line.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, orbit
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.orbits import Orbits
from diff3ds.guidance.recipe import Recipe, TimeAnnealing
from diff3ds.optimize.fit import FitConfig, Rates, Step, fit
from diff3ds.optimize.strokes import NoiseDeletion
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.tasks.text_image.reference_view import Reference, followed
from diff3ds.tasks.text_image.run_spec import AnyRun

# Pixels, width of the strokes (2.6 pixels), views a step. Empirical, as all that follows.
SIZE, WIDTH, GROUP = 128, 0.02, 4
STEPS, RATE, FINAL_RATE = 300, 0.012, 0.2
# What the sketch is like is settled: there is no guidance, and little noise.
RECIPE = Recipe("reconstruction", 1.0, 0.0, annealing=TimeAnnealing(0.3, 0.3, 0.05, 0.05))
# Strokes that came to nothing go, from a third of the steps on, every thirtieth step.
DELETE_FROM, DELETE_EVERY = 0.3, 0.1
# So many of the members are looked at: those whose views, seen all around, are most like the sketch's.
LIKELY, VIEWS, ELEVATION, DISTANCE = 3, 8, 15.0, 1.9


@dataclass(frozen=True, eq=False)
class Sharpening:
    """What the last steps follow.

    Attributes:
        members: that the phrase or picture means, any strokes.
        reference: the picture of `diff3ds image`, with strokes of `WIDTH`.
    """

    members: Sequence[Sketch]
    reference: Reference | None = None

    def steps(self, sketch: Sketch, spec: AnyRun) -> Generator[Step]:
        """Goes on with a sketch, step by step; the same sketch and description of the run give the same steps."""
        seed, views, deleted = spec.descent.seed, spec.cameras, spec.strokes.delete_length
        members = [_thin(member) for member in likely(sketch, self.members)]

        def draw(cameras: Cameras) -> Float[Tensor, "M V H W 3"]:
            return torch.stack([render(member, cameras).color for member in members])

        prior = ExemplarDenoiser(draw, torch.ones(len(members), dtype=torch.bool), SIZE, GROUP)
        score = ScoreDistillation(prior, RECIPE, STEPS, seed)
        orbits = Orbits(views.batch, GROUP, SIZE, views.distance, views.elevation, views.fov)
        deletion = NoiseDeletion(deleted, DELETE_FROM, DELETE_EVERY)
        config = FitConfig(
            steps=STEPS,
            rates=Rates(points=RATE),
            final_rate=FINAL_RATE,
            refinements=[deletion] if deleted else [],
            seed=seed,
        )
        objective, cameras = followed(score, orbits, self.reference)
        return fit(_thin(sketch), objective, cameras, config)


def likely(sketch: Sketch, members: Sequence[Sketch], count: int = LIKELY) -> list[Sketch]:
    """The members that look most like a sketch, from all around."""
    cameras = orbit([360 * i / VIEWS for i in range(VIEWS)], ELEVATION, DISTANCE, size=SIZE // 2)
    with torch.no_grad():
        # With its own, thicker strokes: near lines overlap.
        seen = render(sketch, cameras).color
        width = float(sketch.width.median())
        drawn = (render(replace(m, width=torch.full_like(m.width, width)), cameras).color for m in members)
        away = torch.stack([(other - seen).square().mean() for other in drawn])
    return [members[int(i)] for i in away.argsort()[:count]]


def _thin(sketch: Sketch) -> Sketch:
    return replace(sketch, width=torch.full_like(sketch.width, WIDTH))
