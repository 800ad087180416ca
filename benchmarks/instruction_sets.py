"""Time of the renderer by each instruction set that this machine has, all in turns in one run, one thread.

    python benchmarks/instruction_sets.py [--only ABC] [--rounds 20] [--json FILE]

What one machine's AVX2 takes beside its AVX-512 tells the instruction set from the machine.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import torch
from render import upstream_of
from report import environment, show, write_json
from timing import interleaved
from workloads import WORKLOADS, leaves, scene

import diff3ds as ds
from diff3ds.render.backends import kernels


def ways_of(name: str) -> dict[str, Callable[[], object]]:
    """A forward pass, and one with its gradients, by each instruction set; and a copy of the images."""
    module = kernels()
    assert module is not None
    sketch, cameras = scene(WORKLOADS[name])
    leaf, tensors = leaves(sketch)
    upstream = upstream_of(ds.render(sketch, cameras).color)
    images = torch.zeros(*upstream.shape[:3], 5)

    def by(instructions: str, draw: Callable[[], object]) -> Callable[[], object]:
        def call() -> None:
            module.set_instruction_set(instructions)
            draw()

        return call

    def forward() -> object:
        return ds.render(sketch, cameras)

    def both() -> object:
        return torch.autograd.grad(ds.render(leaf, cameras).color, tensors, upstream)

    ways: dict[str, Callable[[], object]] = {"copy": images.clone}
    for instructions in module.instruction_sets():
        ways |= {f"{instructions} forward": by(instructions, forward), f"{instructions} both": by(instructions, both)}
    return ways


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="ABC", help="workloads to run")
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--json", type=Path, help="file for the figures")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    figures = {name: interleaved(ways_of(name), chosen.rounds) for name in chosen.only}
    rows = [
        [name if way == "copy" else "", way, time, f"{time.median / times['copy'].median:.1f}"]
        for name, times in figures.items()
        for way, time in times.items()
    ]
    show("Medians [quartiles]", ["", "", "ms", "copies of the images"], rows)
    if chosen.json:
        write_json(chosen.json, environment(), figures)


if __name__ == "__main__":
    main()
