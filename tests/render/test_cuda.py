"""What is the CUDA kernels' own, emulated: order of work, long lists, captures, strokes that cannot be drawn."""

import pytest
import torch
from cuda_backends import NO_COMPILER
from cuda_scenes import assert_same, crowd, of_a_sketch, results
from emulated import compiler
from gpu_promise import lack
from scenes import TENSORS, draw, strokes_at, tracked

import diff3ds as ds
from diff3ds.render import available_backends, rasterize
from diff3ds.render.cuda.job import BAD

if compiler() is None:
    lack(NO_COMPILER)


@pytest.mark.parametrize("width_space", ["image", "world"])
def test_order_of_threads_and_blocks_does_not_matter(device, antialiasing, width_space):
    """To the bit, whichever thread or block comes first: sums have an order, and no thread reads too early."""
    strokes = crowd(width_space=width_space)
    expected = results(strokes, (40, 50), antialiasing)
    device.backwards = True
    assert_same(results(strokes, (40, 50), antialiasing), expected)
    assert any(x.abs().sum() > 0 for x in expected[3:])


@pytest.mark.parametrize(
    ("antialiasing", "width_space"),
    [
        ("analytic", "image"),
        pytest.param("montecarlo", "world", marks=pytest.mark.slow),
        pytest.param("analytic", "world", marks=pytest.mark.slow),
        pytest.param("montecarlo", "image", marks=pytest.mark.slow),
    ],
)
def test_sums_over_views_and_strokes_have_an_order(device, antialiasing, width_space):
    """Also those of the strokes in space and of the cameras; and they are the CPU kernels'."""
    expected = of_a_sketch(antialiasing, width_space)
    device.backwards = True
    assert_same(of_a_sketch(antialiasing, width_space), expected)
    if "cpu" in available_backends():
        for got, known in zip(expected[3:], of_a_sketch(antialiasing, width_space, "cpu")[3:], strict=True):
            assert (got - known).norm() < 1e-2 * known.norm()


@pytest.mark.slow
@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")
def test_more_strokes_than_a_block_adds_up_at_a_time(device):
    g = torch.Generator().manual_seed(0)
    points = 48 * torch.rand(9000, 1, 2, generator=g) + 2 * torch.randn(9000, 4, 2, generator=g)
    appearance = {"half_width": 0.1, "opacity": 0.2, "color": torch.rand(9000, 3, generator=g), "dtype": torch.float32}
    strokes = strokes_at(points, depth=1 + torch.rand(9000, 4, generator=g), **appearance)
    expected, got = (draw(strokes, 48, backend) for backend in ("cpu", "cuda"))
    assert ((got.color - expected.color).abs() < 1e-4).double().mean() > 0.999


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")
@pytest.mark.parametrize("lens", [{"fov": 40.0}, {"height": 2.0}])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_kernels_make_the_matrices_of_cameras(device, monkeypatch, dtype, lens):
    """Of those that want no gradients; torch has no part in it."""
    sketch = ds.Sketch.random(12, generator=torch.Generator().manual_seed(0), width=0.1)
    points = sketch.points.clone().requires_grad_()
    sketch = ds.Sketch(points, width=sketch.width)
    cameras = ds.orbit([20.0, 130.0], 35.0, 3.0, size=(20, 28), **lens).to(dtype)

    def drawn(backend: str) -> list[torch.Tensor]:
        image = ds.render(sketch, cameras, backend=backend)
        return [image.color, image.depth, *torch.autograd.grad(image.color.square().sum(), [points])]

    expected = drawn("cpu")
    monkeypatch.setattr(ds.Cameras, "projection", property(lambda _: pytest.fail("torch made the matrices")))
    # So that the first threads find no matrix of another.
    device.backwards = True
    for got, known in zip(drawn("cuda"), expected, strict=True):
        assert (got - known).norm() < 1e-3 * known.norm()


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")
def test_a_stroke_over_many_tiles(device):
    """More than a warp adds up at once."""
    strokes = strokes_at([[[5.0, 3.0], [200.0, 14.0], [395.0, 6.0]]], half_width=2.0, dtype=torch.float32)
    got, expected = (results(strokes, (16, 400), backend=b)[3:] for b in ("cuda", "cpu"))
    for name, a, b in zip(TENSORS, got, expected, strict=False):
        assert (a - b).norm() < 1e-4 * b.norm(), name


def test_backward_twice(device, antialiasing):
    """The backward leaves what the forward kept as it is."""
    strokes = crowd(12)
    tensors = tracked(strokes)
    image = draw(strokes, 30, "cuda", antialiasing, samples=4)
    first, second = (torch.autograd.grad(image.color.square().sum(), tensors, retain_graph=True) for _ in range(2))
    assert_same(first, second)


def test_bad_strokes_are_named(device):
    bad = crowd(5)
    bad.opacity[3] = 2.0
    with pytest.raises(ValueError, match=r"opacity of stroke 3 \(view 0\) must be in \[0, 1\], got 2.0"):
        rasterize(bad, 20, backend="cuda")


def test_bad_strokes_of_earlier_calls_are_reported_once(device, memories):
    """A call that does not wait may end before its kernels begin: the next one hears of them."""
    good = crowd(5)
    expected = rasterize(good, 20, backend="cuda").color
    (only,) = memories.values()
    only.report[BAD] = 3
    with pytest.raises(ValueError, match="a stroke of this drawing, or of one before it, cannot be drawn"):
        rasterize(good, 20, backend="cuda")
    assert torch.equal(rasterize(good, 20, backend="cuda").color, expected)


def test_capture_needs_a_call_before(device):
    device.recording = True
    with pytest.raises(RuntimeError, match="draw a picture of this kind with 5 strokes or more"):
        rasterize(crowd(5), 20, backend="cuda")
    device.recording = False
    expected = rasterize(crowd(5), 20, backend="cuda").color
    before = device.waits
    device.recording = True
    assert torch.equal(rasterize(crowd(5), 20, backend="cuda").color, expected)
    assert device.waits == before
    with pytest.raises(RuntimeError, match="draw a picture of this kind with 6 strokes or more"):
        rasterize(crowd(6), 20, backend="cuda")


def test_capture_of_gradients_needs_one_of_gradients_before(device, memories):
    """Of Monte Carlo, whose outlines only the backward pass counts; the forward pass says so, before it is recorded."""
    strokes = crowd(5)
    tracked(strokes)

    def drawn():
        return draw(strokes, 20, "cuda", "montecarlo", samples=4)

    image = drawn()
    device.recording = True
    for fails in (image.color.sum().backward, drawn):
        with pytest.raises(RuntimeError, match="and its backward if one is wanted, once before the capture"):
            fails()
    device.recording = False
    expected = results(strokes, 20, "montecarlo")
    device.recording = True
    assert_same(results(strokes, 20, "montecarlo"), expected)


def test_strokes_that_cannot_be_drawn_are_left_out_of_a_captured_drawing(device):
    without, bad = crowd(5), crowd(5)
    without.opacity[3], bad.opacity[3] = 0.0, 2.0
    expected = rasterize(without, 20, backend="cuda").color
    device.recording = True
    assert torch.equal(rasterize(bad, 20, backend="cuda").color, expected)


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")
def test_crowded_tiles(device):
    """More chords in a tile than shared memory holds, and more strokes over a pixel than a short list."""
    g = torch.Generator().manual_seed(0)
    points = 8 + 6 * torch.randn(1100, 1, 2, generator=g) + torch.randn(1100, 4, 2, generator=g)
    appearance = {
        "opacity": 0.02,
        "color": torch.rand(1100, 3, generator=g),
        "depth": 1 + torch.rand(1100, 1, generator=g),
    }
    got, expected = (
        results(strokes_at(points, half_width=1.0, dtype=torch.float32, **appearance), 17, backend=b)
        for b in ("cuda", "cpu")
    )
    for name, a, b in zip(("color", "alpha", "depth"), got[:3], expected[:3], strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-4, msg=name)
    for name, a, b in zip(TENSORS, got[3:], expected[3:], strict=False):
        assert (a - b).norm() < 1e-3 * b.norm(), name
