"""Analytic and Monte Carlo antialiasing side by side.

python examples/monte_carlo.py [OUTPUT_FOLDER]

The picture: analytic, Monte Carlo with 4 samples a pixel, with 256; and under them how far each is from 1,024 samples
(white: not at all; black: by 0.1 or more). The numbers: gradients of both modes for one loss.
"""

import sys
from pathlib import Path

import torch

import diff3ds as ds
from diff3ds.formats import save_png, tile_images

RUNS = 64


def loops() -> ds.Sketch:
    """A cusp, a loop, a thick bend and a hairline."""
    points = torch.tensor(
        [
            [[0.0, -0.80, -0.1], [0.0, 0.20, 1.1], [0.0, -0.80, 1.1], [0.0, 0.20, -0.1]],
            [[0.1, 0.10, -0.3], [0.1, 1.50, 0.9], [0.1, -0.60, 0.9], [0.1, 0.75, -0.3]],
            [[0.2, -0.70, -0.25], [0.2, -0.30, -0.80], [0.2, 0.30, -0.80], [0.2, 0.70, -0.45]],
            [[0.3, -0.85, 0.60], [0.3, -0.30, 0.10], [0.3, 0.30, -0.10], [0.3, 0.85, -0.70]],
        ]
    )
    color = torch.tensor([[0.15, 0.45, 0.7], [0.85, 0.4, 0.15], [0.2, 0.55, 0.35], [0.1, 0.1, 0.1]])
    return ds.Sketch(points, width=torch.tensor([0.03, 0.03, 0.12, 0.004]), color=color)


def gradient(cameras: ds.Cameras, wanted: torch.Tensor, mode: ds.Analytic | ds.MonteCarlo) -> torch.Tensor:
    """Of the squared difference to a picture, with respect to the control points."""
    sketch = loops()
    points = sketch.points.requires_grad_()
    moved = ds.Sketch(points, width=sketch.width, color=sketch.color)
    (ds.render(moved, cameras, antialiasing=mode).color - wanted).square().sum().backward()
    return points.grad.flatten()


def main(folder: Path) -> None:
    """Writes the picture and prints the comparison."""
    cameras = ds.orbit(azimuth=0, distance=2.4, fov=45, size=200)
    generator = torch.Generator().manual_seed(0)
    truth = ds.render(loops(), cameras, antialiasing=ds.MonteCarlo(1024, generator)).color
    modes = [ds.Analytic(), ds.MonteCarlo(4, generator), ds.MonteCarlo(256, generator)]
    pictures = torch.cat([ds.render(loops(), cameras, antialiasing=mode).color for mode in modes])
    errors = 1 - ((pictures - truth).abs().amax(-1, keepdim=True) / 0.1).clamp(0, 1).expand_as(pictures)
    save_png(folder / "monte_carlo.png", tile_images(torch.cat([pictures, errors]), columns=3))

    # A picture to compare with that no stroke is at: the same, with all control points moved.
    sketch = loops()
    wanted = ds.render(ds.Sketch(sketch.points + 0.02, width=sketch.width, color=sketch.color), cameras).color
    analytic = gradient(cameras, wanted, ds.Analytic())
    runs = torch.stack([gradient(cameras, wanted, ds.MonteCarlo(4, generator)) for _ in range(RUNS)])
    for name, value in (("one run", runs[0]), (f"mean of {RUNS}", runs.mean(0))):
        cosine = torch.cosine_similarity(value, analytic, dim=0).item()
        print(f"Monte Carlo gradient, {name:>10}: cosine with the analytic one {cosine:.4f}")


if __name__ == "__main__":
    main(Path(*sys.argv[1:2]))
