"""From where a prior looks: cameras drawn around the object in every step."""

from dataclasses import dataclass

import torch

from diff3ds.camera import Cameras, orbit
from diff3ds.guidance.recipe import check_orbits


@dataclass(frozen=True)
class Orbits:
    """A camera sampler for `fit`: all around the object, evenly spaced within a group of views. Defaults: the paper's.

    Attributes:
        batch: views a step.
        group: views of one object that the prior sees together: they share elevation and distance, and their azimuths
            are evenly spaced from a random one.
        size: of the images, pixels.
        distance: least and greatest, world units.
        elevation: lowest and highest, degrees.
        fov: field of view, degrees.
    """

    batch: int = 4
    group: int = 1
    size: int = 512
    distance: tuple[float, float] = (1.8, 2.0)
    elevation: tuple[float, float] = (0.0, 30.0)
    fov: float = 60.0

    def __post_init__(self) -> None:
        check_orbits(self.batch, self.group, self.distance, self.elevation)

    def __call__(self, step: int, generator: torch.Generator) -> Cameras:
        """The cameras of a step."""
        count = self.batch // self.group
        turn, up, away = (torch.rand(count, generator=generator).repeat_interleave(self.group) for _ in range(3))
        place = torch.arange(self.batch) % self.group
        azimuth = (turn + place) / self.group * 360 - 180
        elevation = self.elevation[0] + (self.elevation[1] - self.elevation[0]) * up
        distance = self.distance[0] + (self.distance[1] - self.distance[0]) * away
        return orbit(azimuth.tolist(), elevation.tolist(), distance.tolist(), fov=self.fov, size=self.size)
