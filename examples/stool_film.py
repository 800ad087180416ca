"""The fit of the embedded scene as a film: random strokes become a stool, then it turns.

python examples/stool_film.py [OUTPUT_FOLDER]
"""

import sys
from pathlib import Path

import numpy as np
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.tasks.views.options import ViewsOptions
from diff3ds.tasks.views.random_start import plan_random_edges
from diff3ds.tasks.views.run import demo_pictures

FRAMES, TURN = 45, 45
folder = Path(*sys.argv[1:2])
sketches: list[ds.Sketch] = []
folder.mkdir(parents=True, exist_ok=True)
plan = plan_random_edges(demo_pictures(), ViewsOptions(), folder / "checkpoint.safetensors")
for step in ds.fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config):
    # More frames of the beginning, where more happens.
    if step.index + 1 >= plan.config.steps * (len(sketches) / FRAMES) ** 2:
        sketches.append(plan.frame.to_world(step.sketch))
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
