"""What a step of distillation costs beside the prior: rendering, its gradient, cameras, the optimiser, the loss.

    python benchmarks/step_cost.py [--json FILE]
    python benchmarks/step_cost.py --random-weights full --device cuda [--json FILE]

First: the prior is stood in for by one that costs nothing: latents are pixels averaged over 8 x 8, as an autoencoder's
are an eighth of the size, and the prediction is zero. Published times of a whole step, on an A10 GPU: .9 s with MVDream
(4 views of 256 x 256), 1.8 s with Zero-1-to-3 (Diff3DS, appendix).

Second: a run of `diff3ds text` with MVDream of full size ("tiny" is for tests) and random weights in bfloat16, on this
device. Beside the time of a step that with the free prior, which is all that is not the prior, and that of `render`
alone, forward and backward. Each of them is timed until the device is done, for which a run does not wait: its host
prepares the next step meanwhile, so 4,000 steps take at most what is printed. The aims on an H200: the renderer under
2 % of a step, the paper's 4,000 steps under 6 minutes.
"""

import argparse
import resource
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import torch
from random_mvdream import Scale, random_mvdream
from report import environment, say, show, write_json

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.guidance.denoiser import Denoiser
from diff3ds.guidance.device_choice import pick_device
from diff3ds.guidance.orbits import Orbits
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.sketch import DEFAULT_WIDTH
from diff3ds.tasks.progress import Progress
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior, Network
from diff3ds.tasks.text_image.distillation import distill
from diff3ds.tasks.text_image.run_spec import PRESETS, RunSpec
from diff3ds.tasks.text_image.subject import Phrase

FACTOR, VIEWS = 8, 4
# Views of a step, their size, and the published seconds of a step.
SETTINGS = {
    "MVDream, 4 x 256²": (256, 4, 0.9),
    "Zero-1-to-3, 4 x 256²": (256, 1, 1.8),
    "Stable Diffusion, 4 x 512²": (512, 1, None),
    "Stable Diffusion, 4 x 768²": (768, 1, None),
}
# Steps that are measured, and those before, which load and compile.
STEPS, WARM_UP = 60, 5
# In the visible part of the paper's ball, where all strokes cost.
RADIUS = 1.0


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


def step_seconds(prior: Denoiser, device: torch.device, steps: int = STEPS) -> list[float]:
    """Seconds of every step of a run of the paper's recipe, until the device is done with it."""
    spec = with_options(
        RunSpec(Phrase("anything")), batch=VIEWS, steps=steps + WARM_UP + 1, radius=RADIUS, sheet_every=0
    )
    known = ConditionedPrior("timed", prior, network=Network({}, device, "float32"))
    ends: list[float] = []

    def report(progress: Progress) -> None:
        _wait(device)
        ends.append(time.perf_counter())

    with tempfile.TemporaryDirectory() as folder:
        distill(known, spec, Path(folder), report)
    return [b - a for a, b in pairwise(ends)][WARM_UP:]


def render_seconds(size: int, group: int, device: torch.device, steps: int = STEPS) -> list[float]:
    """Seconds of `render` forward and backward alone, of strokes and views as in the first steps."""
    generator = torch.Generator().manual_seed(0)
    start = ds.Sketch.random(PRESETS["paper"].strokes, radius=RADIUS, width=DEFAULT_WIDTH, generator=generator)
    points = start.points.to(device).requires_grad_()
    sketch = ds.Sketch(points, width=DEFAULT_WIDTH)
    upstream = torch.randn(VIEWS, size, size, 3, generator=generator).to(device)
    times = []
    for step in range(steps + WARM_UP):
        cameras = Orbits(VIEWS, group, size)(step, generator).to(device)
        _wait(device)
        begun = time.perf_counter()
        torch.autograd.grad(ds.render(sketch, cameras).color, points, upstream)
        _wait(device)
        times.append(time.perf_counter() - begun)
    return times[WARM_UP:]


def _wait(device: torch.device) -> None:
    if device.type == "cuda":
        torch.cuda.synchronize(device)


def quartiles(seconds: list[float]) -> tuple[float, float, float]:
    """Median, lower and upper quartile."""
    times = torch.tensor(seconds, dtype=torch.float64)
    low, median, high = times.quantile(torch.tensor([0.25, 0.5, 0.75], dtype=torch.float64)).tolist()
    return median, low, high


def free_steps() -> dict[str, dict]:
    """Milliseconds of steps with the free prior on the CPU."""
    figures, rows = {}, []
    for name, (size, group, published) in SETTINGS.items():
        found = [1e3 * x for x in quartiles(step_seconds(FreePrior(size, group), torch.device("cpu")))]
        share = found[0] / 10 / published if published else None
        figures[name] = {"ms": found, "percent_of_published_step": share}
        rows.append((name, _spread(found), None if share is None else f"{share:.2f} %"))
    show("A step without the prior, 56 strokes", ("setting", "ms [quartiles]", "of the published step"), rows)
    return figures


def random_steps(scale: Scale, device: torch.device, dtype: torch.dtype, steps: int = STEPS) -> dict[str, float | list]:
    """Times of steps with random weights, the renderer's share, memory, and the time of the paper's 4,000 steps."""
    prior = random_mvdream(scale, device, dtype)
    ways = {"step": quartiles(step_seconds(prior, device, steps))}
    # Before the others run: theirs is not asked for.
    memory = _most_memory(device)
    ways["without the prior"] = quartiles(step_seconds(FreePrior(prior.size, prior.group), device, steps))
    ways["renderer"] = quartiles(render_seconds(prior.size, prior.group, device, steps))
    whole = ways["step"][0]
    show(
        f"MVDream ({scale}, {dtype}) on {device}, {VIEWS} x {prior.size}², {PRESETS['paper'].strokes} strokes",
        ("", "ms [quartiles]", "of a step"),
        [(name, _spread([1e3 * x for x in times]), f"{100 * times[0] / whole:.2f} %") for name, times in ways.items()],
    )
    total = PRESETS["paper"].steps * whole
    say(f"memory at most: {memory / 1e9:.2f} GB; {PRESETS['paper'].steps:,} steps: {total / 60:.1f} min")
    figures: dict[str, float | list] = {f"{name}, ms": [1e3 * x for x in times] for name, times in ways.items()}
    figures |= {f"percent {name}": 100 * ways[name][0] / whole for name in ("without the prior", "renderer")}
    return figures | {"memory, GB": memory / 1e9, "4,000 steps, min": total / 60}


def _most_memory(device: torch.device) -> int:
    """Bytes that this process had at most: of the GPU's memory, or of the machine's."""
    if device.type == "cuda":
        return torch.cuda.max_memory_allocated(device)
    # In units of 1024 bytes on Linux.
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _spread(values: Sequence[float]) -> str:
    median, low, high = values
    return f"{median:.2f} [{low:.2f}, {high:.2f}]"


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--random-weights", choices=("full", "tiny"))
    parser.add_argument("--device", default="cpu", help="of the random weights: cpu, cuda, cuda:1")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    about = environment()
    if chosen.random_weights:
        device = pick_device(chosen.device)
        about |= {"gpu": torch.cuda.get_device_name(device)} if device.type == "cuda" else {}
        figures: dict = random_steps(chosen.random_weights, device, torch.bfloat16)
    else:
        figures = free_steps()
    if chosen.json:
        write_json(chosen.json, about, figures)


if __name__ == "__main__":
    main()
