"""A view that is known, beside those that a prior judges."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.orbits import Orbits
from diff3ds.optimize.fit import CameraSampler, Objective
from diff3ds.render import Rendering


@dataclass(frozen=True, eq=False)
class Reference:
    """A view that is known: the picture of `diff3ds image`.

    Attributes:
        picture: on white.
        cameras: one view, of its size.
        weight: of its mean squared difference against the prior's loss; 0 leaves it out.
    """

    picture: Float[Tensor, "H W 3"]
    cameras: Cameras
    weight: float


def followed(
    score: ScoreDistillation, orbits: Orbits, reference: Reference | None, place: torch.device | str = "cpu"
) -> tuple[Objective, CameraSampler]:
    """Joins a known view to what the prior looks at: it is drawn behind the views of the prior, and adds its loss.

    Args:
        place: where strokes are drawn: the picture waits there, instead of being copied in every step.
    """
    if reference is None:
        return score, orbits
    count, size = orbits.batch, (orbits.size, orbits.size)
    channels = reference.picture.movedim(-1, 0)[None]
    resized = torch.nn.functional.interpolate(channels, size, mode="bilinear", antialias=True)[0]
    picture = resized.movedim(0, -1).to(place)

    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        prior = Rendering(rendering.color[:count], rendering.alpha[:count], rendering.depth[:count])
        color = rendering.color[count]
        difference = (color - picture).square().mean()
        return score(prior, cameras[:count], step) + reference.weight * difference

    return objective, _OneMoreView(orbits, reference.cameras.resize(orbits.size))


@dataclass(frozen=True, eq=False)
class _OneMoreView:
    """The cameras of a step and, behind them, the reference's."""

    orbits: Orbits
    last: Cameras

    def __call__(self, step: int, generator: torch.Generator) -> Cameras:
        return Cameras.concatenate([self.orbits(step, generator), self.last])
