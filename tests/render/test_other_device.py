"""Devices without float64: strokes are drawn on the CPU, images and gradients come back."""

from importlib import import_module

import pytest
import torch
from other_device import NAME, OtherDevice
from scenes import seeded

from diff3ds import Cameras, Sketch, orbit, render

backends = import_module("diff3ds.render.backends")


@pytest.fixture
def device(monkeypatch):
    """A device that lacks float64; nothing has been drawn there."""
    backends._warn_about_drawing_elsewhere.cache_clear()
    monkeypatch.setattr(backends, "lacks_float64", lambda device: device.type == NAME)
    with OtherDevice():
        yield torch.device(NAME)
    backends._warn_about_drawing_elsewhere.cache_clear()


def drawn(device: torch.device, antialiasing: str, backend: str | None) -> dict[str, torch.Tensor]:
    """Images, and gradients of all that has them, on a device."""
    g = torch.Generator().manual_seed(0)
    sketch, cameras = Sketch.random(4, generator=g, radius=0.7, width=0.08), orbit([10.0, 100.0], 15.0, 2.0, size=16)
    tensors = {**sketch.tensors(), "world_to_camera": cameras.world_to_camera, "intrinsics": cameras.intrinsics}
    tensors["background"] = torch.full((3,), 0.6)
    leaves = {name: t.detach().clone().to(device).requires_grad_() for name, t in tensors.items()}
    sketch = Sketch(**{name: leaves[name] for name in sketch.tensors()})
    cameras = Cameras(leaves["world_to_camera"], leaves["intrinsics"], cameras.size)
    how = seeded(antialiasing, seed=1)
    image = render(sketch, cameras, background=leaves["background"], antialiasing=how, backend=backend)
    loss = image.color.square().sum() + image.alpha.sum() + image.depth.sum()
    gradients = torch.autograd.grad(loss, list(leaves.values()))
    return {"color": image.color, "alpha": image.alpha, "depth": image.depth, **dict(zip(leaves, gradients))}


@pytest.mark.filterwarnings("ignore:diff3ds was installed without")
@pytest.mark.parametrize(
    ("antialiasing", "backend"),
    [("analytic", None), ("montecarlo", None), pytest.param("analytic", "reference", marks=pytest.mark.slow)],
)
def test_drawn_on_the_cpu_and_moved_back(device, antialiasing, backend):
    """To the bit what the CPU draws, on the device of the strokes, in their dtype; told once."""
    expected = drawn(torch.device("cpu"), antialiasing, backend)
    with pytest.warns(RuntimeWarning, match="meta devices lack float64.* drawn on the CPU") as told:
        got = [drawn(device, antialiasing, backend) for _ in range(2)]
    assert len(told) == 1
    for found in got:
        for name, tensor in found.items():
            assert tensor.device == device, name
            assert tensor.dtype == torch.float32, name
            assert torch.equal(tensor.to("cpu"), expected[name]), name
    assert all(expected[name].abs().sum() > 0 for name in expected)


@pytest.mark.filterwarnings("ignore:meta devices lack float64")
def test_errors_are_those_of_the_cpu(device):
    sketch, cameras = Sketch(torch.rand(3, 4, 3)).to(device), orbit(0.0, size=16).to(device)
    with pytest.raises(TypeError, match=r"background must be torch\.float32 on meta as the colours are"):
        render(sketch, cameras, background=torch.ones(3))
    sketch.opacity[1] = 2.0
    with pytest.raises(ValueError, match=r"opacity of stroke 1 must be in \[0, 1\], got 2.0"):
        render(sketch, cameras)


def test_apple_gpus_lack_float64():
    assert backends.lacks_float64(torch.device("mps"))
    assert not any(backends.lacks_float64(torch.device(kind)) for kind in ("cpu", "cuda", "meta"))
