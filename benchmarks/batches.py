"""Time of 64 sketches of 16 strokes at 64x64 in one call of `render_batch`, beside that of a loop over `render`.

    python benchmarks/batches.py [--sketches 64] [--strokes 16] [--size 64] [--rounds 15] [--threads 2]
        [--device cuda]

Both in turns in one run; backward is of given gradients of the colours to everything in the sketches.
"""

import argparse
from collections.abc import Callable

import torch
from timing import interleaved

import diff3ds as ds


def sketch(strokes: int, seed: int, device: str) -> ds.Sketch:
    """Random coloured strokes, everything with a gradient."""
    generator = torch.Generator().manual_seed(seed)

    def numbers(*shape: int) -> torch.Tensor:
        return torch.rand(*shape, generator=generator)

    points, width, opacity = 1.6 * numbers(strokes, 4, 3) - 0.8, 0.01 + 0.05 * numbers(strokes), numbers(strokes)
    given = {"points": points, "width": width, "color": numbers(strokes, 3), "opacity": opacity}
    return ds.Sketch(**{name: value.to(device).requires_grad_() for name, value in given.items()})


def waiting(way: Callable[[], object]) -> Callable[[], object]:
    """The same, until the GPU is done with it."""

    def call() -> None:
        way()
        torch.cuda.synchronize()

    return call


def main() -> None:
    """Measures what the command line asks for, and prints it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in (("sketches", 64), ("strokes", 16), ("size", 64), ("rounds", 15), ("threads", 2)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--device", default="cpu", choices=("cpu", "cuda"))
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    sketches = [sketch(options.strokes, k, options.device) for k in range(options.sketches)]
    views = [ds.orbit([360.0 * k / options.sketches], size=options.size) for k in range(options.sketches)]
    cameras = [view.to(options.device) for view in views]
    leaves = [getattr(s, name) for s in sketches for name in ("points", "width", "color", "opacity")]
    upstream = [torch.rand(1, options.size, options.size, 3).to(options.device)] * options.sketches

    def loop() -> list[torch.Tensor]:
        return [ds.render(s, c).color for s, c in zip(sketches, cameras, strict=True)]

    def batch() -> list[torch.Tensor]:
        return [drawn.color for drawn in ds.render_batch(sketches, cameras)]

    def both(draw: Callable[[], list[torch.Tensor]]) -> Callable[[], object]:
        return lambda: torch.autograd.grad(draw(), leaves, upstream)

    def drawing(draw: Callable[[], list[torch.Tensor]]) -> Callable[[], object]:
        return torch.no_grad()(draw)

    ways = {"loop": drawing(loop), "batch": drawing(batch), "loop, backward too": both(loop), "batch, too": both(batch)}
    if options.device == "cuda":
        ways = {name: waiting(way) for name, way in ways.items()}
    for name, times in interleaved(ways, options.rounds).items():
        print(f"{name:20} {times} ms")


if __name__ == "__main__":
    main()
