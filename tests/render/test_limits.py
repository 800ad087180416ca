"""The ends of the range: nothing to draw, odd sizes, strokes beside, behind or through the camera, many of them."""

from dataclasses import replace

import pytest
import torch
from scenes import draw, noise, seeded, strokes_at, tracked

from diff3ds import Sketch, bezier, render
from diff3ds.camera import look_at
from diff3ds.project import project
from diff3ds.render import available_backends, rasterize

BACKGROUND = (0.2, 0.5, 0.7)


def assert_empty(image, tensors=()) -> None:
    """Only background, and gradients of zero."""
    assert (image.color - torch.tensor(BACKGROUND).to(image.color)).abs().max() < 1e-7
    assert image.alpha.abs().max() == 0
    assert image.depth.abs().max() == 0
    if tensors:
        (image.color.sum() + image.alpha.sum() + image.depth.sum()).backward()
        for tensor in tensors:
            assert tensor.grad is not None
            assert (tensor.grad == 0).all()


@pytest.mark.parametrize("size", [1, (1, 40), (37, 2), (16, 16), (17, 33)])
def test_no_strokes(backend, antialiasing, size):
    strokes = strokes_at(torch.zeros(0, 4, 2))
    tensors = tracked(strokes)
    image = draw(strokes, size, backend, antialiasing, background=BACKGROUND)
    height, width = (size, size) if isinstance(size, int) else size
    assert image.color.shape == (1, height, width, 3)
    assert image.alpha.shape == image.depth.shape == (1, height, width)
    assert_empty(image, tensors)


LENSES = pytest.mark.parametrize("lens", [{}, {"height": 1.0}], ids=["perspective", "orthographic"])


@LENSES
@pytest.mark.parametrize("width_space", ["image", "world"])
def test_no_views(backend, antialiasing, width_space, lens):
    """No pictures, of the right shape, and gradients of zero, also for the cameras."""
    sketch, cameras = Sketch(torch.rand(3, 4, 3), width_space=width_space), looking(lens)[:0]
    inputs = [*sketch.tensors().values(), cameras.world_to_camera, torch.tensor(BACKGROUND)]
    for tensor in inputs:
        tensor.requires_grad_()
    options = {"background": inputs[-1], "backend": backend, "antialiasing": antialiasing}
    for image in (render(sketch, cameras, **options), rasterize(project(sketch, cameras), cameras.size, **options)):
        assert image.color.shape == (0, 32, 32, 3)
        assert image.alpha.shape == image.depth.shape == (0, 32, 32)
        assert image.color.dtype == sketch.color.dtype
        for gradient in torch.autograd.grad(image.color.sum() + image.alpha.sum() + image.depth.sum(), inputs):
            assert (gradient == 0).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 23), (40, 3), (15, 17), (33, 16)])
def test_size_only_cuts_the_picture(backend, size):
    """Each size shows what a larger picture shows there."""
    bend = [[[-2.0, 30.0], [4.0, -14.0], [20.0, -4.0], [16.0, 36.0]]]
    strokes = strokes_at(bend, half_width=3.0, opacity=0.8, depth=[[1.0, 2.0, 1.5, 1.2]], color=0.3)
    small, large = (draw(strokes, s, backend, background=BACKGROUND) for s in (size, 48))
    for name in ("color", "alpha", "depth"):
        expected = getattr(large, name)[:, : size[0], : size[1]]
        # The kernels cut strokes at the borders into other chords, from which their last steps start.
        torch.testing.assert_close(getattr(small, name), expected, rtol=0, atol=1e-5)


def test_off_the_image(backend, antialiasing):
    places = torch.tensor([[-60.0, 10.0], [90.0, 10.0], [10.0, -80.0], [10.0, 5e6], [-1e12, -1e12]])
    strokes = strokes_at(places[:, None] + torch.tensor([[0.0, 0.0], [9.0, 9.0]]), half_width=2.0)
    tensors = tracked(strokes)
    assert_empty(draw(strokes, 32, backend, antialiasing, background=BACKGROUND), tensors)


def looking(lens: dict, size: int = 32):
    """A camera at the origin that looks along x."""
    return look_at(torch.zeros(1, 3, dtype=torch.float64), (1.0, 0.0, 0.0), size=size, near=0.1, **lens)


@LENSES
def test_behind_the_camera(backend, antialiasing, lens):
    points = torch.tensor([[[-1.0, -0.2, 0.1], [-2.0, 0.3, 0.1]], [[-0.5, 0, 0], [0.05, 0, 0]]], dtype=torch.float64)
    sketch = Sketch(points.requires_grad_(), width=0.2)
    options = {"background": BACKGROUND, "backend": backend, "antialiasing": antialiasing}
    assert_empty(render(sketch, looking(lens), **options), [points])


@LENSES
def test_through_the_camera_plane(backend, antialiasing, lens):
    """As if the curve were cut where its depth is `near`: the sub-curve in front gives the same picture."""
    points = torch.tensor([[[-1.0, -0.3, 0.1], [0.0, 0.4, 0.3], [0.5, -0.3, -0.3], [2.0, 0.2, 0.1]]]).double()
    weights = torch.tensor([[1.0, 0.7, 1.5, 1.0]]).double()
    # Bisection: depth x grows along the curve.
    low, high = torch.zeros(1).double(), torch.ones(1).double()
    for _ in range(60):
        middle = (low + high) / 2
        behind = bezier.evaluate(points, weights, middle[:, None])[..., 0, 0] < 0.1
        low, high = torch.where(behind, middle, low), torch.where(behind, high, middle)
    front = Sketch(*bezier.subcurve(points, weights, high, torch.ones(1).double()), width=0.1)
    points.requires_grad_()
    images = []
    for sketch in (Sketch(points, weights, width=0.1), front):
        images.append(render(sketch, looking(lens), backend=backend, antialiasing=seeded(antialiasing)))
    assert images[0].alpha.sum() > 20
    torch.testing.assert_close(images[0].alpha, images[1].alpha, rtol=0, atol=1e-5)
    torch.testing.assert_close(images[0].depth, images[1].depth, rtol=0, atol=1e-3)
    (images[0].color.sum() + images[0].depth.sum()).backward()
    assert points.grad.isfinite().all()
    assert (points.grad != 0).any()


def test_wide_stroke_beside_the_image_is_seen(backend, antialiasing):
    line = [[[-20.0, -50.0], [-20.0, 90.0]]]
    alpha = draw(strokes_at(line, half_width=30.0), 32, backend, antialiasing).alpha[0]
    tolerance = noise(backend, antialiasing)
    assert (alpha[:, :10] - 1).abs().max() < tolerance
    assert alpha[:, 10:].abs().max() < tolerance


def thousands(dtype: torch.dtype = torch.float32):
    g = torch.Generator().manual_seed(0)
    start = 300 * torch.rand(20_000, 1, 2, generator=g)
    points = start + 12 * torch.randn(20_000, 4, 2, generator=g)
    appearance = {"color": torch.rand(20_000, 3, generator=g), "opacity": torch.rand(20_000, generator=g)}
    return points, {**appearance, "depth": 1 + torch.rand(20_000, 1, generator=g), "dtype": dtype}


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")
def test_twenty_thousand_strokes():
    """The whole picture by the kernels, a corner of it by the reference as well."""
    points, appearance = thousands()
    strokes = strokes_at(points, **appearance)
    tensors = tracked(strokes)
    image = rasterize(strokes, 300, backend="cpu")
    image.color.sum().backward()
    assert all(t.grad.isfinite().all() for t in tensors)
    assert 0.99 < image.alpha.mean() <= 1
    corner = rasterize(strokes_at(points - 150, **appearance), 12, backend="reference")
    # Depths in float32 are told apart to 1e-7: of 60 strokes a pixel hardly any two are in another order.
    difference = (corner.color - image.color[:, 150:162, 150:162]).abs().amax(-1)
    assert (difference > 1e-4).sum() <= 1


# Found by fuzzing: rounding leaves parts that no cut makes tame, and cutting them all never ended.
ENDLESS = {
    "line through the eye": [
        [4.5820067952982655e20, -1.4542173530031253e20, 2.036447464577007e19, 0.6107943058013916],
        [1.5273357408197516e20, -4.84739162857873e19, 6.788158848087784e18, 0.8769756158192952],
        [-1.1701628660435585e19, 3.7138119205465836e18, -5.200723849082482e17, 1.1077322959899902],
        [-3.5104928697405694e19, 1.1141449318689116e19, -1.5602190532180308e18, 1.3030643463134766],
    ],
    "last visible part lost in rounding": [
        [-5.327714009859426e18, 4.18515672189494e18, -1.639296618270361e17, 43.439395904541016],
        [-8.203711594068887e21, -7.871860786330935e21, -2.1594542048611313e20, 1.0168803930282593],
        [7.871715066186374e21, 7.553293949958258e21, 2.0720631148752873e20, 0.0019287139875814319],
        [133027.88336385394, 301300.53607508197, 8265.450013602693, 0.015122130513191223],
    ],
}


@pytest.mark.parametrize("name", ENDLESS)
def test_huge_coordinates_come_to_an_end(backend, antialiasing, name):
    if (backend, antialiasing) == ("reference", "montecarlo"):
        pytest.skip("the reference comes to an end as well, but spends minutes on the outline")
    for half_width in (0.0, 11.5):
        strokes = strokes_at(torch.zeros(1, 4, 2), half_width=half_width)
        strokes = replace(strokes, cubics=torch.tensor([[ENDLESS[name]]], dtype=torch.float64))
        tensors = tracked(strokes)
        image = draw(strokes, (18, 45), backend, antialiasing)
        (image.color.sum() + image.alpha.sum()).backward()
        assert ((image.alpha >= 0) & (image.alpha <= 1)).all()
        assert all(not t.grad.isnan().any() for t in tensors)
