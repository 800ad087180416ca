"""Digests of pictures and gradients of fixed scenes: what a change that should change no number must leave as it is.

python benchmarks/fingerprint.py [--backend emulated] > before.txt, then the same after the change, and diff. A digest
holds for one machine's instruction sets; each is listed by itself.
"""

import argparse
import hashlib
import itertools
import sys
from pathlib import Path

import torch

import diff3ds as ds
from diff3ds.render.backends import kernels

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "render"))


def scene(seed: int, controls: int, width_space: str, dtype: torch.dtype) -> tuple[ds.Sketch, ds.Cameras]:
    """Forty coloured strokes with gradients, some behind a camera, some with extreme weights; and two cameras."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int, low: float = 0.0, high: float = 1.0) -> torch.Tensor:
        return (low + (high - low) * torch.rand(*shape, generator=generator, dtype=torch.float64)).to(dtype)

    count = 40
    points = 0.6 * torch.randn(count, controls, 3, generator=generator, dtype=torch.float64).to(dtype)
    weights = uniform(count, controls, low=-2, high=2).exp()
    tensors = (points, weights, uniform(count, low=0.004, high=0.08), uniform(count, 3), uniform(count, low=0.2))
    points, weights, width, color, opacity = (tensor.requires_grad_() for tensor in tensors)
    sketch = ds.Sketch(points, weights, width=width, color=color, opacity=opacity, width_space=width_space)
    return sketch, ds.orbit([10.0 * seed, 130.0], 20, distance=1.3, fov=70, size=(61, 83))


def digest(tensors: list[torch.Tensor | None]) -> str:
    """Of all bytes, in order."""
    whole = hashlib.sha256()
    for tensor in tensors:
        whole.update(b"none" if tensor is None else tensor.detach().contiguous().numpy().tobytes())
    return whole.hexdigest()[:16]


def drawn(seed: int, controls: int, space: str, dtype: torch.dtype, mode: str, backend: str) -> str:
    """Digests of the images, and of all gradients of a loss that looks at all three."""
    sketch, cameras = scene(seed, controls, space, dtype)
    generator = torch.Generator().manual_seed(seed)
    background = torch.rand(1, 61, 83, 3, generator=generator, dtype=torch.float64).to(dtype).requires_grad_()
    how = {"box": ds.Analytic(), "blur": ds.Analytic(1.5), "montecarlo": ds.MonteCarlo(4, generator)}[mode]
    image = ds.render(sketch, cameras, background=background, antialiasing=how, backend=backend)
    images = [image.color, image.alpha, image.depth]
    losses = [(x * torch.rand(x.shape, generator=generator, dtype=torch.float64).to(dtype)).sum() for x in images]
    inputs = [sketch.points, sketch.weights, sketch.width, sketch.color, sketch.opacity, background]
    return f"{digest(images)} {digest(list(torch.autograd.grad(sum(losses), inputs)))}"


def main() -> None:
    """Prints a line for every scene and way to draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--backend", choices=["cpu", "emulated"], default="cpu", help="emulated: the CUDA kernels")
    backend = parser.parse_args().backend
    sets = kernels().instruction_sets()
    if backend == "emulated":
        import pytest
        from cuda_backends import use_emulation

        use_emulation(pytest.MonkeyPatch())
        backend, sets = "cuda", ["emulated"]
    dtypes, spaces, modes = (torch.float32, torch.float64), ("image", "world"), ("box", "blur", "montecarlo")
    for seed, (controls, space, dtype, mode) in enumerate(itertools.product((2, 3, 4), spaces, dtypes, modes)):
        for name in sets if dtype == torch.float32 else sets[-1:]:
            if name != "emulated":
                kernels().set_instruction_set(name)
            line = f"{controls} {space} {str(dtype)[6:]} {mode} {name if dtype == torch.float32 else 'float64'}"
            print(line, drawn(seed, controls, space, dtype, mode, backend), flush=True)


if __name__ == "__main__":
    main()
