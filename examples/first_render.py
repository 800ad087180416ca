"""A torus of 32 exact circles (Villarceau's), drawn with depth.

python examples/first_render.py [OUTPUT_FOLDER]
"""

import sys
from pathlib import Path

import torch

import diff3ds as ds

turn = torch.arange(32) * (2 * torch.pi / 32)
# Circles of radius 0.65 around a ring of radius 0.25, in planes that tilt by asin(0.25 / 0.65) = asin(5 / 13).
circles = [
    ds.bezier.circle((0.25 * x, 0.25 * y, 0.0), 0.65, normal=(5 * y, -5 * x, 12.0), dtype=torch.float32)
    for x, y in zip(turn.cos().tolist(), turn.sin().tolist(), strict=True)
]
points, weights = (torch.cat(parts) for parts in zip(*circles, strict=True))
hue = turn.repeat_interleave(4)[:, None] - torch.tensor([5.9, 4.2, 2.7])
sketch = ds.Sketch(points, weights, width=0.02, color=0.42 + 0.38 * hue.cos(), width_space="world")
cameras = ds.orbit(azimuth=30, elevation=38, distance=2.3, fov=42, size=(400, 512), target=(0.0, 0.0, -0.09))
ds.save(Path(*sys.argv[1:2]) / "first_render.png", sketch, cameras)
