"""Random strokes become three Borromean rings, by plain torch through the renderer.

python examples/optimise.py [OUTPUT_FOLDER]

The picture: two of the eight views; from left to right the target, the start and the result.
"""

import sys
from pathlib import Path

import torch

import diff3ds as ds
from diff3ds.formats import save_png, tile_images

STEPS = 200
STROKES = 24


def borromean_rings() -> ds.Sketch:
    """Three ellipses at right angles, each through the next, no two of them linked."""
    axes = 0.85 * torch.eye(3, dtype=torch.float64)
    rings = [ds.bezier.ellipse((0.0, 0.0, 0.0), axes[k], 0.5 * axes[(k + 1) % 3]) for k in range(3)]
    points, weights = (torch.cat(parts).float() for parts in zip(*rings, strict=True))
    colors = torch.tensor([[0.80, 0.25, 0.20], [0.15, 0.50, 0.75], [0.90, 0.65, 0.15]])
    return ds.Sketch(points, weights, width=0.03, color=colors.repeat_interleave(4, 0))


def main(folder: Path) -> None:
    """Fits the strokes and writes the picture."""
    cameras = ds.orbit(azimuth=list(range(0, 360, 45)), elevation=[30, -10] * 4, distance=2.4, fov=50, size=128)
    target = borromean_rings()
    start = ds.Sketch.random(STROKES, generator=torch.Generator().manual_seed(0), radius=0.9, extent=0.4, width=0.03)
    points = start.points.clone().requires_grad_()
    color = torch.full((STROKES, 3), 0.5).requires_grad_()
    optimizer = torch.optim.Adam([{"params": [points], "lr": 0.012}, {"params": [color], "lr": 0.02}])
    for step in range(STEPS):
        # Coarse to fine: a stroke feels what is within 3.5 times the blur.
        blur = ds.Analytic(10.0 * (1 - step / STEPS) ** 2)
        wanted = ds.render(target, cameras, antialiasing=blur).color
        image = ds.render(ds.Sketch(points, width=0.03, color=color), cameras, antialiasing=blur).color
        loss = (image - wanted).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if step % 40 == 0 or step == STEPS - 1:
            print(f"step {step:3d}  blur {blur.blur:5.2f} px  loss {loss.item():.5f}")
    result = ds.Sketch(points.detach(), width=0.03, color=color.detach().clamp(0, 1))
    shown = cameras[[1, 4]].resize(256)
    pictures = [ds.render(sketch, shown).color for sketch in (target, start, result)]
    save_png(folder / "optimise.png", tile_images(torch.stack(pictures, 1).flatten(0, 1), columns=3))


if __name__ == "__main__":
    main(Path(*sys.argv[1:2]))
