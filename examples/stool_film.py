"""The fit of the embedded scene as a film: random strokes become a stool, then it turns.

python examples/stool_film.py [OUTPUT_FOLDER]
"""

import sys
from pathlib import Path

import numpy as np
import torch
from PIL import Image

import diff3ds as ds

STEPS, STROKES, BATCH = 800, 96, 6
FRAMES, TURN = 45, 45
stool, views = ds.library.demo_sketch(), ds.library.demo_cameras()


def blur(step: int) -> ds.Analytic:
    """Coarse to fine: a stroke feels what is within 3.5 times the blur."""
    return ds.Analytic(10.0 * max(0.0, 1 - step / (0.8 * STEPS)) ** 2)


def some_views(step: int, generator: torch.Generator) -> ds.Cameras:
    """The views that a step looks at."""
    return views[torch.randperm(len(views), generator=generator)[:BATCH]]


def objective(rendering: ds.Rendering, cameras: ds.Cameras, step: int) -> torch.Tensor:
    """How far the ink of the strokes is from that of the stool."""
    wanted = ds.render(stool, cameras, antialiasing=blur(step)).alpha
    return ds.losses.ink_loss(rendering.alpha, wanted, extra=1.0)


folder = Path(*sys.argv[1:2])
folder.mkdir(parents=True, exist_ok=True)
start = ds.Sketch.random(STROKES, generator=torch.Generator().manual_seed(0), radius=0.9, extent=0.3)
config = ds.FitConfig(
    steps=STEPS,
    rates=ds.Rates(points=0.012, opacity=0.01),
    final_rate=0.06,
    antialiasing=blur,
    refinements=[ds.NoiseDeletion(length=0.06, start=0.5, every=0.1)],
)
sketches: list[ds.Sketch] = []
for step in ds.fit(start, objective, some_views, config):
    # More frames of the beginning, where more happens.
    if step.index + 1 >= STEPS * (len(sketches) / FRAMES) ** 2:
        sketches.append(step.sketch)
sketches += [sketches[-1]] * TURN
azimuth = [30 + 180 * max(0, i - FRAMES) / TURN + 4 * min(i, FRAMES) for i in range(len(sketches))]
frames = []
for angle, sketch in zip(azimuth, sketches, strict=True):
    image = ds.render(sketch, ds.orbit(angle, 18, 2.9, fov=45, size=320)).color[0]
    # Levels of gray, so that the film stays small.
    gray = (image.mean(-1).clamp(0, 1) * 15).round() * 17
    frames.append(Image.fromarray(gray.to(torch.uint8).numpy().astype(np.uint8)))
frames[0].save(
    folder / "stool.webp", save_all=True, append_images=frames[1:], duration=60, loop=0, quality=60, method=4
)
