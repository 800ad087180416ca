"""Projection: of the curve's points and of the curve are the same, and the kernels' one is the reference's."""

import math

import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

import diff3ds as ds
from diff3ds.bezier.curves import elevate_homogeneous, homogeneous
from diff3ds.render.backends import kernels as load_kernels

kernels = pytest.mark.skipif("cpu" not in ds.available_backends(), reason="installed without the compiled kernels")

seeds = st.integers(0, 10**6)
T = torch.linspace(0, 1, 33, dtype=torch.float64)


def _cameras(seed: int, views: int) -> ds.Cameras:
    """Cameras of any pose near the strokes, each view with focal lengths, centre and skew of its own."""
    g = torch.Generator().manual_seed(seed)
    eye = 2 * torch.randn(views, 3, generator=g, dtype=torch.float64)
    target = torch.randn(views, 3, generator=g, dtype=torch.float64)
    cameras = ds.look_at(eye, target, size=(300, 400))
    intrinsics = cameras.intrinsics.clone()
    intrinsics[:, [0, 1], [0, 1]] = 10 ** (1 + 3 * torch.rand(views, 2, generator=g, dtype=torch.float64))
    intrinsics[:, 0, 1] = torch.randn(views, generator=g, dtype=torch.float64)
    intrinsics[:, :2, 2] += 100 * torch.randn(views, 2, generator=g, dtype=torch.float64)
    return ds.Cameras(cameras.world_to_camera, intrinsics, (300, 400))


def _sketch(seed: int, controls: int, dtype: torch.dtype = torch.float64, count: int = 6) -> ds.Sketch:
    g = torch.Generator().manual_seed(seed)
    points = torch.randn(count, controls, 3, generator=g, dtype=dtype)
    weights = 10 ** (4 * torch.rand(count, controls, generator=g, dtype=dtype) - 2)
    return ds.Sketch(points, weights, width=torch.rand(count, generator=g, dtype=dtype))


@given(seeds, st.sampled_from([2, 3, 4]), st.sampled_from([1, 3]))
def test_projected_curves_are_curves_of_projected_points(seed, controls, views):
    """project(evaluate(t)) == evaluate(project)(t) to 1e-11 of the coordinates' magnitude, for depths over 0.1."""
    sketch, cameras = _sketch(seed, controls), _cameras(seed, views)
    # A point at a time through the pinhole, without homogeneous coordinates.
    points = ds.bezier.evaluate(sketch.points, sketch.weights, T)
    rotation, shift = cameras.world_to_camera[:, :3, :3], cameras.world_to_camera[:, :3, 3]
    inside = torch.einsum("vij,nmj->vnmi", rotation, points) + shift[:, None, None]
    depth = inside[..., 2]
    k = cameras.intrinsics[:, None, None]
    across, down = inside[..., 0] / depth, inside[..., 1] / depth
    x = k[..., 0, 0] * across + k[..., 0, 1] * down + k[..., 0, 2]
    y = k[..., 1, 1] * down + k[..., 1, 2]
    # The projected curve, evaluated.
    cubics = ds.project(sketch, cameras).cubics
    basis = torch.stack([math.comb(3, i) * (1 - T) ** (3 - i) * T**i for i in range(4)], -1)
    big_x, big_y, big_z, big_w = (basis @ cubics).unbind(-1)
    seen = depth > 0.1
    assume(bool(seen.any()))
    magnitude = 1 + x.abs() + y.abs() + cameras.intrinsics.abs().amax((1, 2))[:, None, None]
    for found, expected in ((big_x / big_z, x), (big_y / big_z, y), (big_z / big_w, depth)):
        assert ((found - expected).abs() / magnitude)[seen].max() < 1e-11


def test_a_control_point_behind_the_camera_does_no_harm():
    """The part in front of the camera is the curve, though two control points are behind it."""
    points = torch.tensor([[[0.0, 0, 1], [0, 0.5, -3], [0.5, 0, -1], [1, 1, 4]]], dtype=torch.float64)
    cameras = ds.Cameras(torch.eye(4).double()[None], torch.eye(3).double()[None], (8, 8))
    cubics = ds.project(ds.Sketch(points), cameras).cubics
    torch.testing.assert_close(cubics[0, 0], torch.cat([points[0], torch.ones(4, 1)], 1))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_projection_is_computed_in_float64(dtype):
    sketch, cameras = _sketch(0, 4, dtype), _cameras(0, 2)
    strokes = ds.project(sketch, cameras)
    assert strokes.cubics.dtype == torch.float64
    assert strokes.half_width.dtype == strokes.color.dtype == dtype
    assert torch.equal(strokes.cubics, ds.project(sketch.to(torch.float64), cameras).cubics)


def test_half_widths():
    """Image: a fraction of the height, one row for all views. World: pixels times depth, where pixels are square."""
    points = torch.zeros(2, 4, 3, dtype=torch.float64)
    cameras = _cameras(0, 3)
    image = ds.project(ds.Sketch(points, width=torch.tensor([0.01, 0.02]).double()), cameras)
    torch.testing.assert_close(image.half_width, torch.tensor([[1.5, 3.0]]).double())
    world = ds.project(ds.Sketch(points, width=torch.tensor([0.2, 0.4]).double(), width_space="world"), cameras)
    # A disc of the world is one where pixels are square, with this radius.
    disc = world.square @ cameras.intrinsics[:, :2, :2]
    for n, half_width in enumerate((0.1, 0.2)):
        radius = (world.half_width[:, n] / half_width)[:, None, None]
        torch.testing.assert_close(disc.mT @ disc, radius**2 * torch.eye(2).double())
    assert (image.width_space, world.width_space) == ("image", "world")
    assert image.near == cameras.near


def test_gradients_reach_sketch_and_cameras():
    sketch, cameras = _sketch(1, 3, count=2), _cameras(1, 2)
    width = sketch.width

    def cubics(points, weights, pose, intrinsics):
        posed = ds.Cameras(pose, intrinsics, (8, 8))
        strokes = ds.project(ds.Sketch(points, weights, width, width_space="world"), posed)
        return strokes.cubics, strokes.half_width

    inputs = (sketch.points, sketch.weights, cameras.world_to_camera, cameras.intrinsics)
    assert torch.autograd.gradcheck(cubics, [v.clone().requires_grad_() for v in inputs])


@pytest.mark.usefixtures("unchecked")
def test_devices_must_agree():
    cameras = _cameras(0, 1)
    sketch = _sketch(0, 4)
    object.__setattr__(sketch, "points", sketch.points.to("meta"))
    with pytest.raises(
        ValueError, match=r"sketch and cameras must be on one device, got meta and cpu: use .to\(device"
    ):
        ds.project(sketch, cameras)


def _by_kernels(sketch: ds.Sketch, cameras: ds.Cameras) -> torch.Tensor:
    """The cubics that the compiled kernels draw."""
    return torch.from_numpy(load_kernels().project((sketch.points, sketch.weights, cameras.projection)))


@kernels
@given(seeds, st.sampled_from([2, 3, 4]), st.sampled_from([1, 3]), st.sampled_from([torch.float32, torch.float64]))
def test_the_kernels_project_alike(seed, controls, views, dtype):
    """Forward to rounding in float64; backward into the dtype of each input, the matrices included."""
    sketch, cameras = _sketch(seed, controls, dtype), _cameras(seed, views)
    found, expected = _by_kernels(sketch, cameras), ds.project(sketch, cameras).cubics
    assert (found - expected).abs().max() <= 1e-14 * expected.abs().max()

    inputs = [v.clone().requires_grad_() for v in (sketch.points, sketch.weights, cameras.projection)]
    control = elevate_homogeneous(homogeneous(*(v.double() for v in inputs[:2])))
    g_cubics = torch.randn(expected.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    wanted = torch.autograd.grad(control @ inputs[2][:, None].mT, inputs, g_cubics)
    for got, want in zip(load_kernels().project_backward(tuple(inputs), g_cubics), wanted, strict=True):
        assert torch.from_numpy(got).dtype == want.dtype
        # A few roundings of sums over strokes and views that cancel.
        tolerance = 16 * torch.finfo(want.dtype).eps
        assert (torch.from_numpy(got) - want).abs().max() <= tolerance * want.abs().max()


@kernels
@given(seeds, st.sampled_from(["image", "world"]))
def test_drawing_in_one_operation_is_projecting_and_drawing(seed, width_space):
    """The same picture and the same gradients, to the rounding of two ways to project."""
    shape, camera = _sketch(seed, 4), _cameras(seed, 2).resize(24)
    results = []
    for in_one in (True, False):
        names = ("points", "weights", "width")
        leaves = {name: getattr(shape, name).clone().requires_grad_() for name in names}
        pose = camera.world_to_camera.clone().requires_grad_()
        intrinsics = camera.intrinsics.clone().requires_grad_()
        sketch = ds.Sketch(**leaves, width_space=width_space)
        cameras = ds.Cameras(pose, intrinsics, camera.size)
        image = ds.render(sketch, cameras) if in_one else ds.rasterize(ds.project(sketch, cameras), camera.size)
        inputs = [*leaves.values(), pose, intrinsics]
        results.append([image.color, *torch.autograd.grad(image.color.square().sum(), inputs)])
    for found, expected in zip(*results, strict=True):
        torch.testing.assert_close(found, expected, rtol=1e-9, atol=1e-12 + 1e-9 * float(expected.detach().abs().max()))


@kernels
def test_the_kernels_project_no_strokes_and_no_views():
    none = ds.Sketch(torch.zeros(0, 3, 3))
    assert _by_kernels(none, _cameras(0, 2)).shape == (2, 0, 4, 4)
    assert _by_kernels(_sketch(0, 4), _cameras(0, 2)[[]]).shape == (0, 6, 4, 4)


@kernels
def test_the_kernels_give_gradients_to_what_needs_them():
    sketch, cameras = _sketch(0, 4), _cameras(0, 2)
    learned = ds.Sketch(sketch.points, sketch.weights.clone().requires_grad_(), sketch.width)
    assert ds.render(learned, cameras).color.requires_grad
    assert not ds.render(sketch, cameras).color.requires_grad
    pose = cameras.world_to_camera.clone().requires_grad_()
    image = ds.render(sketch, ds.Cameras(pose, cameras.intrinsics, cameras.size))
    (gradient,) = torch.autograd.grad(image.color.sum(), pose)
    assert gradient.shape == (2, 4, 4)
    assert gradient.abs().max() > 0


@kernels
def test_the_kernels_take_any_layout():
    """Transposed and expanded tensors, as selections and permutations leave them."""
    points = torch.randn(3, 4, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).permute(2, 1, 0)
    weights = torch.ones(1, dtype=torch.float64).expand(6, 4)
    cameras = _cameras(0, 1)[[0, 0, 0]]
    sketch = ds.Sketch(points, weights, 0.1)
    assert not sketch.points.is_contiguous()
    whole = ds.Sketch(points.contiguous(), weights.contiguous(), 0.1)
    assert torch.equal(ds.render(sketch, cameras).color, ds.render(whole, cameras).color)
    assert ds.render(whole, cameras).alpha.max() > 0
