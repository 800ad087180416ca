"""What a step of distillation costs beside the prior: rendering, its gradient, cameras, the optimiser, the loss.

    python benchmarks/step_cost.py [--json FILE]

The prior is stood in for by one that costs nothing: latents are pixels averaged over 8 x 8, as an autoencoder's are
an eighth of the size, and the prediction is zero. Published times of a whole step, on an A10 GPU: .9 s with MVDream
(4 views of 256 x 256), 1.8 s with Zero-1-to-3 (Diff3DS, appendix).
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import torch
from report import environment, show, write_json
from timing import milliseconds

import diff3ds as ds
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.orbits import Orbits
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.sketch import DEFAULT_WIDTH
from diff3ds.tasks.distill_options import DistillOptions

FACTOR = 8
# Views of a step, their size, and the published seconds of a step.
SETTINGS = {
    "MVDream, 4 x 256²": (256, 4, 0.9),
    "Zero-1-to-3, 4 x 256²": (256, 1, 1.8),
    "Stable Diffusion, 4 x 512²": (512, 1, None),
    "Stable Diffusion, 4 x 768²": (768, 1, None),
}
STEPS = 60


class FreePrior:
    """A `Denoiser` that costs next to nothing."""

    def __init__(self, size: int, group: int) -> None:
        self.schedule = NoiseSchedule.scaled_linear()
        self.size, self.group = size, group

    def encode(self, images: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """Pixels averaged over blocks."""
        return torch.nn.functional.avg_pool2d(images.movedim(-1, 1), FACTOR)

    def predict(
        self, noisy: torch.Tensor, timesteps: torch.Tensor, cameras: ds.Cameras, branches: Sequence
    ) -> torch.Tensor:
        """No noise at all."""
        return noisy.new_zeros(len(branches), *noisy.shape)

    def decode(self, latents: torch.Tensor) -> torch.Tensor:
        """The latents."""
        return latents.movedim(1, -1)


def measure(size: int, group: int) -> list[float]:
    """Milliseconds of every step."""
    options = DistillOptions("paper")
    values = options.values()
    judge = ScoreDistillation(FreePrior(size, group), options.recipe(50.0, group), STEPS)
    generator = torch.Generator().manual_seed(0)
    # In the visible part of the paper's ball, where all strokes cost.
    start = ds.Sketch.random(values.strokes, radius=1.0, width=DEFAULT_WIDTH, generator=generator)
    config = ds.FitConfig(steps=STEPS, rates=ds.Rates(points=values.rate))
    steps = ds.fit(start, judge, Orbits(options.batch, group, size), config)
    return [milliseconds(lambda: next(steps)) for _ in range(STEPS)][5:]


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    about, figures, rows = environment(), {}, []
    for name, (size, group, published) in SETTINGS.items():
        times = torch.tensor(measure(size, group), dtype=torch.float64)
        low, median, high = times.quantile(torch.tensor([0.25, 0.5, 0.75], dtype=torch.float64)).tolist()
        share = median / 10 / published if published else None
        figures[name] = {"ms": [median, low, high], "percent_of_published_step": share}
        rows.append((name, f"{median:.2f} [{low:.2f}, {high:.2f}]", None if share is None else f"{share:.2f} %"))
    show("A step without the prior, 56 strokes", ("setting", "ms [quartiles]", "of the published step"), rows)
    if chosen.json:
        write_json(chosen.json, about, figures)


if __name__ == "__main__":
    main()
