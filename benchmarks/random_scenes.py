"""Small random scenes of every kind that the renderer knows, to compare implementations on."""

import math
from typing import NamedTuple

import torch

import diff3ds as ds
from diff3ds.render import Backend


class RandomScene(NamedTuple):
    """What `diff3ds.render` is given."""

    sketch: ds.Sketch
    cameras: ds.Cameras
    background: torch.Tensor
    blur: float

    def inputs(self) -> dict[str, torch.Tensor]:
        """Every tensor that has a gradient, by name."""
        cameras = {"world_to_camera": self.cameras.world_to_camera, "intrinsics": self.cameras.intrinsics}
        return {**self.sketch.tensors(), "background": self.background, **cameras}

    def replace(self, inputs: dict[str, torch.Tensor]) -> "RandomScene":
        """The scene with other tensors, all of them given."""
        sketch = {name: inputs[name] for name in self.sketch.tensors()}
        cameras = ds.Cameras(inputs["world_to_camera"], inputs["intrinsics"], self.cameras.size, self.cameras.near)
        sketch_ = ds.Sketch(**sketch, width_space=self.sketch.width_space)
        return RandomScene(sketch_, cameras, inputs["background"], self.blur)

    def to(self, dtype: torch.dtype) -> "RandomScene":
        """The same values in another dtype."""
        return self.replace({name: value.to(dtype) for name, value in self.inputs().items()})

    def render(self, backend: Backend) -> ds.Rendering:
        """Draws it."""
        how = ds.Analytic(self.blur)
        return ds.render(self.sketch, self.cameras, background=self.background, antialiasing=how, backend=backend)


def random_scene(seed: int, sides: tuple[int, int] = (64, 96), strokes: int = 24) -> RandomScene:
    """1 to `strokes` lines, quadratics or cubics .03 to 13 px wide, with weights up to 10**±2, in 1 to 3 views.

    Half of the scenes have widths in world units, a third is blurred; the background is a random image.
    """
    g = torch.Generator().manual_seed(seed)

    def uniform(low: float, high: float, *shape: int) -> torch.Tensor:
        return low + (high - low) * torch.rand(shape, generator=g)

    def integer(low: int, high: int) -> int:
        return int(torch.randint(low, high + 1, (), generator=g))

    count, controls, views = integer(1, strokes), integer(2, 4), integer(1, 3)
    size = (integer(*sides), integer(*sides))
    extent = 10 ** uniform(-1.5, 0, count, 1, 1)
    points = 0.4 * torch.randn(count, 1, 3, generator=g) + extent * torch.randn(count, controls, 3, generator=g)
    spread = (0.0, 0.5, 2.0)[seed % 3]
    world = seed % 2 == 1
    # At distance 2.7 and 60 degrees the image is 3.1 units high.
    width = 10 ** uniform(-3.3, -0.7, count) * (3.1 if world else 1.0)
    sketch = ds.Sketch(
        points,
        10 ** uniform(-spread, spread, count, controls),
        width,
        uniform(0, 1, count, 3),
        uniform(0.3, 1, count),
        "world" if world else "image",
    )
    azimuth, elevation = uniform(0, 360, views), float(uniform(-60, 60))
    cameras = ds.orbit(azimuth, elevation, 2.7, size=size)
    blur = float(uniform(0.3, 3)) if math.floor(seed / 6) % 3 == 2 else 0.0
    return RandomScene(sketch, cameras, uniform(0, 1, views, *size, 3), blur)
