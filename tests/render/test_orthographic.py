"""Orthographic views: what perspective ones from far away show, with the widths and depths that are known."""

import functools
from dataclasses import replace

import pytest
import torch
from scenes import noise

from diff3ds import Analytic, Cameras, Sketch, look_at, render

SIZE = (40, 56)
# World units that the images show from the lower edge to the upper one, and how far away perspective is hardly any:
# there x / (D + z) differs from x / D by z / D, that is 1e-6 of 56 px.
HEIGHT, NEAR, FAR = 2.4, 5.0, 1e6
AXIS = torch.tensor([0.6, -0.3, 0.4], dtype=torch.float64)
WIDTHS = ["image", "world"]


def sketch_of(width_space: str, dtype: torch.dtype = torch.float64) -> Sketch:
    """Three bent strokes, two units behind each other: float32 tells them apart from 1e6 away, where steps are .06."""
    g = torch.Generator().manual_seed(2)
    across = torch.randn(3, 4, 3, generator=g, dtype=torch.float64)
    axis = AXIS / AXIS.norm()
    points = 0.5 * (across - (across @ axis)[..., None] * axis) + 0.1 * across
    points = points - 2.0 * torch.arange(3)[:, None, None] * axis
    weights = 0.5 + torch.rand(3, 4, generator=g, dtype=torch.float64)
    color, opacity = torch.rand(3, 3, generator=g, dtype=torch.float64), torch.tensor([0.6, 0.8, 0.9]).double()
    tensors = (points, weights, torch.tensor([0.05, 0.12, 0.2]).double(), color, opacity)
    return Sketch(*(t.to(dtype).requires_grad_() for t in tensors), width_space=width_space)


def cameras_at(distance: float, orthographic: bool) -> Cameras:
    """Looking at the origin, upright; the plane there is seen in the same size whatever the distance."""
    eye = (distance * AXIS / AXIS.norm())[None]
    cameras = look_at(eye, height=HEIGHT, size=SIZE)
    if not orthographic:
        focal = cameras.intrinsics * torch.tensor([distance, distance, 1.0])[:, None].double()
        focal[:, :, 2] = cameras.intrinsics[:, :, 2]
        cameras = Cameras(cameras.world_to_camera, focal, SIZE)
    pose, lens = (t.clone().requires_grad_() for t in (cameras.world_to_camera, cameras.intrinsics))
    return replace(cameras, world_to_camera=pose, intrinsics=lens)


def loss_of(
    sketch: Sketch, cameras: Cameras, distance: float, backend: str, how: Analytic
) -> tuple[torch.Tensor, dict]:
    """Linear in all three images, and these; the depth of pixels with hardly any ink is left out."""
    image = render(sketch, cameras, background=0.4, antialiasing=how, backend=backend)
    y, x = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) for n in SIZE), indexing="ij")
    wave = torch.sin(0.3 * x + 0.2 * y).to(image.color)
    nearer = (image.depth - distance) * (image.alpha.detach() > 0.05)
    loss = (image.color * wave[..., None]).sum() + (image.alpha * wave.flip(0)).sum() + (nearer * wave).sum()
    return loss, {"color": image.color.detach(), "alpha": image.alpha.detach(), "depth": nearer.detach()}


def inputs_of(sketch: Sketch, cameras: Cameras) -> dict[str, torch.Tensor]:
    """All that a drawing is differentiable by."""
    return {**sketch.tensors(), "pose": cameras.world_to_camera, "lens": cameras.intrinsics}


def drawn(sketch: Sketch, cameras: Cameras, distance: float, backend: str, how: Analytic) -> tuple[dict, dict]:
    """Images, and gradients of the loss."""
    loss, images = loss_of(sketch, cameras, distance, backend, how)
    inputs = inputs_of(sketch, cameras)
    return images, dict(zip(inputs, torch.autograd.grad(loss, list(inputs.values())), strict=True))


@pytest.mark.slow
def test_gradients_are_those_of_differences():
    """Of the reference by every input, those of cameras included, along a random direction of each."""
    sketch, cameras = sketch_of("world"), cameras_at(NEAR, orthographic=True)
    inputs, gradients = (
        inputs_of(sketch, cameras),
        drawn(sketch, cameras, NEAR, "reference", Analytic(0.5))[1],
    )
    g, step = torch.Generator().manual_seed(0), 1e-6

    def loss(values: dict[str, torch.Tensor]) -> float:
        stroke = Sketch(*(values[name] for name in sketch.tensors()), width_space="world")
        views = replace(cameras, world_to_camera=values["pose"], intrinsics=values["lens"])
        return float(loss_of(stroke, views, NEAR, "reference", Analytic(0.5))[0])

    with torch.no_grad():
        for name, value in inputs.items():
            direction = torch.randn(value.shape, generator=g, dtype=torch.float64)
            if name in ("pose", "lens"):
                direction[:, -1] = 0
            more, less = (loss({**inputs, name: value + s * step * direction}) for s in (1, -1))
            slope = (more - less) / (2 * step)
            assert float((gradients[name] * direction).sum()) == pytest.approx(slope, rel=1e-5, abs=1e-5), name


@functools.cache
def from_far(width_space: str) -> tuple[dict, dict]:
    """By the reference in float64. Without corners of the filter, where a gradient jumps."""
    return drawn(sketch_of(width_space), cameras_at(FAR, orthographic=False), FAR, "reference", Analytic(0.7))


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("width_space", WIDTHS)
def test_perspective_from_far_away(backend, dtype, width_space):
    """Pictures to 1e-4 and gradients to 1e-4 of their norm: perspective of 1e-6 times 56 px, and float32."""
    if backend == "reference" and dtype == torch.float32:
        pytest.skip("the reference computes geometry in float64 whatever the dtype")
    expected, truth = from_far(width_space)
    got, gradients = drawn(
        sketch_of(width_space, dtype), cameras_at(NEAR, orthographic=True), NEAR, backend, Analytic(0.7)
    )
    assert (expected["alpha"] > 0.5).sum() > 100
    for name, image in got.items():
        assert (image.double() - expected[name]).abs().max() < 1e-4, name
    for name, gradient in gradients.items():
        if name in ("pose", "lens"):
            continue
        wanted = truth[name]
        assert (gradient.double() - wanted).norm() < 1e-4 * wanted.norm(), name
        assert torch.cosine_similarity(gradient.double().flatten(), wanted.flatten(), dim=0) > 0.99999, name
    # Of the pose: moves across the view, and towards it, where the depth alone changes. Of the lens: the same focal
    # length is as many pixels a unit as the distance has units, and the centre is the centre.
    move, focal, middle = (gradients[n][0] for n in ("pose", "lens", "lens"))
    far_move, far_lens = truth["pose"][0], truth["lens"][0]
    torch.testing.assert_close(move[:3, 3], far_move[:3, 3], rtol=1e-3, atol=1e-4 * float(far_move[:3, 3].norm()))
    ratio = focal.diagonal()[:2] / FAR
    torch.testing.assert_close(ratio, far_lens.diagonal()[:2], rtol=1e-3, atol=1e-9)
    torch.testing.assert_close(middle[:2, 2], far_lens[:2, 2], rtol=1e-3, atol=1e-3)


def test_perspective_from_far_away_by_the_same_kernels(backend):
    """Both by one backend, in float32, where depths of 1e6 have steps of .06."""
    pictures = [
        render(sketch_of("world", torch.float32), cameras_at(far, lens), backend=backend)
        for far, lens in ((FAR, False), (NEAR, True))
    ]
    torch.testing.assert_close(pictures[0].color, pictures[1].color, rtol=0, atol=3e-4)
    torch.testing.assert_close(pictures[0].alpha, pictures[1].alpha, rtol=0, atol=3e-4)


@pytest.mark.parametrize("depth", [0.3, 50.0])
@pytest.mark.parametrize(("width_space", "half_width"), [("image", 4.0), ("world", 2.0)])
def test_nothing_shrinks_with_depth(backend, antialiasing, depth, width_space, half_width):
    """A line along y at x = .25 of a unit that is 20 px: where it is, and how wide, whatever its depth."""
    line = torch.tensor([[[0.25, -9.0, depth], [0.25, 9.0, depth]]], dtype=torch.float64)
    sketch = Sketch(line, width=0.2, width_space=width_space)
    lens = torch.tensor([[[20.0, 0, 20], [0, 20, 20], [0, 0, 1]]], dtype=torch.float64)
    cameras = Cameras(torch.eye(4, dtype=torch.float64)[None], lens, (40, 40), orthographic=True)
    image = render(sketch, cameras, backend=backend, antialiasing=antialiasing)
    edges = torch.arange(40) + 0.5 - 25.0
    covered = (half_width + 0.5 - edges.abs()).clamp(0, 1)
    assert (image.alpha[0].double() - covered).abs().max() < 1e-6 + 3 * noise(backend, antialiasing)
    torch.testing.assert_close(image.depth[0, :, 25], torch.full((40,), depth).double(), rtol=1e-6, atol=0)


def test_a_slanted_stroke_has_the_depth_of_its_nearest_point(backend):
    """Depth is linear along a line on the screen, not its inverse."""
    line = torch.tensor([[[-1.0, 0.0, 1.0], [1.0, 0.0, 5.0]]], dtype=torch.float64)
    lens = torch.tensor([[[20.0, 0, 20], [0, 20, 5], [0, 0, 1]]], dtype=torch.float64)
    cameras = Cameras(torch.eye(4, dtype=torch.float64)[None], lens, (10, 40), orthographic=True)
    depth = render(Sketch(line, width=0.4), cameras, backend=backend).depth[0, 4]
    torch.testing.assert_close(depth, 1.0 + 4 * (torch.arange(40).double() + 0.5) / 40, rtol=1e-6, atol=0)


def test_strokes_in_front_of_the_near_plane_are_left_out(backend, antialiasing):
    """The part of a line beyond near is drawn alone: from the middle of the image on, with a round end before it."""
    line = torch.tensor([[[-1.0, 0.0, -0.5], [1.0, 0.0, 1.5]]], dtype=torch.float64, requires_grad=True)
    lens = torch.tensor([[[20.0, 0, 20], [0, 20, 5], [0, 0, 1]]], dtype=torch.float64)
    cameras = Cameras(torch.eye(4, dtype=torch.float64)[None], lens, (10, 40), near=0.5, orthographic=True)
    image = render(Sketch(line, width=0.4), cameras, backend=backend, antialiasing=antialiasing)
    assert image.alpha[0, :, :17].max() == 0
    assert (image.alpha[0, 4, 22:] > 0.99).all()
    assert image.depth[0, 4, 20:].min() >= 0.5
    image.color.sum().backward()
    assert line.grad.isfinite().all()
