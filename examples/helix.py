"""A helix of 30 joined cubics as one stroke, its points and widths fitted to four pictures by a loss of one's own.

python examples/helix.py [OUTPUT_FOLDER]

The picture: four views of the target, of the start and of the result, one above the other.
"""

import math
import sys
from pathlib import Path

import torch

import diff3ds as ds
from diff3ds.formats import save_png, tile_images


def helix(radius: float, width: torch.Tensor) -> ds.Sketch:
    """Three turns through 31 places, as one stroke with one width a place, between which it swells and tapers."""
    angle = torch.linspace(0, 6 * math.pi, 31)
    places = torch.stack([radius * angle.cos(), radius * angle.sin(), angle / 9 - 1], -1)
    steps = torch.arange(30)[:, None] + torch.linspace(0, 1, 4)
    widths = torch.lerp(width[steps.floor().long()], width[steps.ceil().long()], steps.frac())
    return ds.Sketch(ds.bezier.catmull_rom(places), width=widths, chains=ds.Chains.of([30]), width_space="world")


views = ds.orbit([0, 90, 180, 270], [20, 35, 20, 35], 3.5, size=160)
true = helix(0.8, 0.05 + 0.1 * torch.linspace(0, 3 * math.pi, 31).sin().square())
with torch.no_grad():
    target = ds.render(true, views).alpha


def loss(image: ds.Rendering, cameras: ds.Cameras, step: int, sketch: ds.Sketch) -> torch.Tensor:
    """Pictures that agree, and a stroke that does not bend more than it must."""
    return (image.alpha - target).square().mean() + 1e-6 * ds.losses.bending_energy(sketch).sum()


start = helix(0.65, torch.full((31,), 0.06))
rates = ds.Rates(points=0.005, width=0.03)
config = ds.FitConfig(steps=300, rates=rates, antialiasing=lambda step: ds.Analytic(4 * 0.99**step))
for step in ds.fit(start, loss, views, config):
    if step.index % 100 == 99:
        print(f"step {step.index + 1}: loss {step.loss:.5f}")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
folder.mkdir(parents=True, exist_ok=True)
ds.save(folder / "helix.json", step.sketch)
pictures = [ds.render(sketch, views).color for sketch in (true, start, step.sketch)]
save_png(folder / "helix.png", tile_images(torch.cat(pictures), columns=4))
