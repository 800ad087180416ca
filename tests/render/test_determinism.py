"""Bitwise equal pictures and gradients for any number of threads, from run to run, and in child processes."""

import hashlib
import multiprocessing

import pytest
import torch
from scenes import draw, seeded, strokes_at, tracked

from diff3ds.render import Analytic, available_backends, rasterize, set_num_threads

pytestmark = pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")


def result(antialiasing: str, width_space: str, dtype: torch.dtype) -> list[torch.Tensor]:
    """Images and gradients of 60 strokes over each other on 70 x 90 pixels."""
    g = torch.Generator().manual_seed(0)
    points = 40 + 25 * torch.randn(60, 4, 2, generator=g)
    strokes = strokes_at(
        points,
        depth=1 + torch.rand(60, 4, generator=g),
        half_width=4 * torch.rand(60, generator=g),
        color=torch.rand(60, 3, generator=g),
        opacity=torch.rand(60, generator=g),
        width_space=width_space,
        dtype=dtype,
    )
    tensors = tracked(strokes)
    background = torch.rand(3, generator=g).to(dtype).requires_grad_()
    how = Analytic(0.4) if antialiasing == "analytic" else seeded(antialiasing)
    image = rasterize(strokes, (70, 90), antialiasing=how, backend="cpu", background=background)
    loss = image.color.square().sum() + image.alpha.sum() + image.depth.sum()
    return [image.color, image.alpha, image.depth, *torch.autograd.grad(loss, [*tensors, background])]


def assert_same(got: list[torch.Tensor], expected: list[torch.Tensor]) -> None:
    for a, b in zip(got, expected, strict=True):
        assert torch.equal(a, b)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("width_space", ["image", "world"])
def test_any_number_of_threads(antialiasing, width_space, dtype, threads):
    threads(1)
    expected = result(antialiasing, width_space, dtype)
    for count in (1, 2, 3, 5):
        threads(count)
        assert_same(result(antialiasing, width_space, dtype), expected)


def _digest() -> str:
    arrays = [t.detach().numpy().tobytes() for t in result("analytic", "image", torch.float32)]
    return hashlib.sha256(b"".join(arrays)).hexdigest()


def _child(pipe) -> None:
    # Torch's own threads do not live on either.
    torch.set_num_threads(1)
    set_num_threads(2)
    pipe.send(_digest())


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_after_a_fork(threads):
    """The kernels' threads do not live on in a forked child; it starts its own."""
    threads(2)
    expected = _digest()
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(sender,), daemon=True)
    child.start()
    try:
        assert receiver.poll(60), "the child hangs"
        assert receiver.recv() == expected
    finally:
        child.kill()
        child.join()


def test_exceptions_in_threads_arrive(threads):
    """A bad stroke found by one of several threads is an error with its name, and the next call works."""
    threads(3)
    expected = result("analytic", "image", torch.float32)
    for bad in (0, 1500, 2999):
        half_width = torch.ones(3000)
        half_width[bad] = float("nan")
        with pytest.raises(ValueError, match=f"half_width of stroke {bad} .* got nan"):
            draw(strokes_at(torch.zeros(3000, 2, 2), half_width=half_width), 64, "cpu")
        assert_same(result("analytic", "image", torch.float32), expected)
