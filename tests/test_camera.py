"""Cameras: orbits and look-at against the conventions, worked by hand."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import diff3ds as ds


def _pixels(cameras: ds.Cameras, points) -> torch.Tensor:
    """(V, N, 3): pixel x, y and depth of world points, written out without matrices of four columns."""
    points = torch.as_tensor(points, dtype=torch.float64)
    rotation, shift = cameras.world_to_camera[:, :3, :3].double(), cameras.world_to_camera[:, :3, 3].double()
    inside = torch.einsum("vij,nj->vni", rotation, points) + shift[:, None]
    on_sensor = torch.einsum("vij,vnj->vni", cameras.intrinsics.double(), inside / inside[..., 2:])
    return torch.cat([on_sensor[..., :2], inside[..., 2:]], -1)


def _close(actual, expected, tolerance: float = 1e-5) -> None:
    torch.testing.assert_close(
        actual.double(), torch.as_tensor(expected, dtype=torch.float64), rtol=0, atol=tolerance, check_device=False
    )


@pytest.mark.parametrize(
    ("azimuth", "elevation", "center"),
    [
        (0.0, 0.0, (2, 0, 0)),
        (90.0, 0.0, (0, 2, 0)),
        (180.0, 0.0, (-2, 0, 0)),
        (-90.0, 0.0, (0, -2, 0)),
        (0.0, 30.0, (math.sqrt(3), 0, 1)),
        (45.0, -30.0, (math.sqrt(1.5), math.sqrt(1.5), -1)),
    ],
)
def test_orbit_places_the_camera(azimuth, elevation, center):
    _close(ds.orbit(azimuth, elevation, 2.0).centers[0], center)


def test_orbit_sees_the_axes_where_they_belong():
    """From +x: z is up, y to the right (counter-clockwise seen from above), both at the edge for 90 degrees at 1."""
    cameras = ds.orbit(0.0, 0.0, 1.0, fov=90.0, size=(100, 200))
    seen = _pixels(cameras, [(0.0, 0, 0), (0, 0, 1), (0, 1, 0), (0.5, 0, 0), (-1, 0, 0)])[0]
    _close(seen, [[100, 50, 1], [100, 0, 1], [150, 50, 1], [100, 50, 0.5], [100, 50, 2]], 1e-4)


@given(st.floats(-360, 360), st.floats(-89, 89), st.floats(0.1, 10), st.floats(1, 170))
def test_field_of_view_is_vertical(azimuth, elevation, distance, fov):
    """The top of the image is half the field of view above the axis, in any image, seen from anywhere."""
    target = (0.3, -0.2, 0.1)
    cameras = ds.orbit(azimuth, elevation, distance, fov=fov, size=(64, 200), target=target)
    a, e = math.radians(azimuth), math.radians(elevation)
    up = torch.tensor([-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e)])
    top = torch.tensor(target) + distance * math.tan(math.radians(fov) / 2) * up
    x, y, depth = _pixels(cameras, [target, top.tolist()])[0].unbind(-1)
    # float32 matrices: eps times pixels and what the tangent of half the field of view adds.
    _close(x, [100, 100], 0.01)
    _close(y, [32, 0], 0.01)
    _close(depth / distance, [1, 1], 1e-4)


def test_orbit_takes_one_value_or_one_a_view():
    cameras = ds.orbit([0.0, 90.0, 180.0], elevation=10.0, distance=[1.0, 2.0, 3.0], size=32)
    assert len(cameras) == 3
    assert cameras.size == (32, 32)
    _close(torch.linalg.vector_norm(cameras.centers, dim=-1), [1, 2, 3])
    one = ds.orbit(90.0, 10.0, 2.0, size=32)
    _close(cameras[1].world_to_camera, one.world_to_camera)
    tensors = ds.orbit(torch.tensor([0.0, 90.0, 180.0]), torch.tensor(10.0), torch.tensor([1.0, 2.0, 3.0]))
    _close(tensors.world_to_camera, cameras.world_to_camera)


def test_look_at_is_rigid_and_looks_at(generator):
    eye = torch.randn(20, 3, generator=generator, dtype=torch.float64) * 3
    target = torch.randn(20, 3, generator=generator, dtype=torch.float64)
    cameras = ds.look_at(eye, target, fov=torch.linspace(20, 100, 20), size=(50, 80))
    assert cameras.world_to_camera.dtype == torch.float64
    rotation = cameras.world_to_camera[:, :3, :3]
    _close(rotation @ rotation.mT, torch.eye(3).expand(20, 3, 3), 1e-14)
    _close(torch.linalg.det(rotation), torch.ones(20), 1e-14)
    _close(cameras.centers, eye, 1e-13)
    for v in range(20):
        x, y, depth = _pixels(cameras[v], target[v : v + 1])[0, 0].tolist()
        assert math.isclose(x, 40, abs_tol=1e-10)
        assert math.isclose(y, 25, abs_tol=1e-10)
        assert math.isclose(depth, math.dist(eye[v].tolist(), target[v].tolist()), rel_tol=1e-12)


def test_look_at_keeps_up_up():
    """With y up and a camera on +z (the OpenGL view), x is right and y up."""
    cameras = ds.look_at(torch.tensor([[0.0, 0.0, 2.0]]), up=(0.0, 1.0, 0.0), fov=90.0, size=100)
    _close(_pixels(cameras, [(1, 0, 0), (0, 1, 0)])[0], [[75, 50, 2], [50, 25, 2]])


def test_gradients_reach_the_eye():
    eye = torch.tensor([[1.0, 2.0, 3.0]], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda e: ds.look_at(e, fov=50.0).projection, eye)


def _two() -> ds.Cameras:
    return ds.orbit([0.0, 90.0], size=(60, 40))


def test_cameras_are_frozen():
    with pytest.raises(AttributeError, match="cannot assign to field 'near'"):
        _two().near = 1.0


def test_views_are_selected():
    cameras = ds.orbit([0.0, 90.0, 180.0])
    for index, rows in ((1, [1]), (-1, [2]), (slice(1, None), [1, 2]), ([2, 0], [2, 0])):
        some = cameras[index]
        assert torch.equal(some.world_to_camera, cameras.world_to_camera[rows])
        assert len(some) == len(rows)
    mask = torch.tensor([True, False, True])
    assert torch.equal(cameras[mask].centers, cameras.centers[[0, 2]])


def test_to_converts_both_matrices():
    cameras = _two().to(torch.float64)
    assert (cameras.world_to_camera.dtype, cameras.intrinsics.dtype) == (torch.float64, torch.float64)
    assert cameras.size == (60, 40)
    assert cameras.to("cpu").to(torch.device("cpu")).to(torch.float32).intrinsics.dtype == torch.float32


def test_concatenate_joins_views():
    one, two = ds.orbit([0.0, 90.0], size=(60, 40)), ds.orbit(30.0, 10.0, size=(60, 40))
    both = ds.Cameras.concatenate([one, two])
    assert both.size == (60, 40)
    for name in ("world_to_camera", "intrinsics"):
        assert torch.equal(getattr(both, name), torch.cat([getattr(one, name), getattr(two, name)]))


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (ds.orbit(0.0, size=32), r"have one size, got \(60, 40\) and \(32, 32\)\. Make a Cameras .* render_batch\("),
        (ds.orbit(0.0, size=(60, 40), near=0.5), r"have one near, got 0.01 and 0.5\. .* render_batch\("),
        (ds.orbit(0.0, size=(60, 40), height=2.0), r"have one orthographic, got False and True\. .* render_batch\("),
    ],
)
def test_views_that_differ_in_more_than_their_matrices_are_no_batch(other, message):
    with pytest.raises(ValueError, match=message):
        ds.Cameras.concatenate([ds.orbit(0.0, size=(60, 40)), other])
    with pytest.raises(ValueError, match="at least one Cameras"):
        ds.Cameras.concatenate([])


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("size", [[(8, 8), (16, 16)], torch.tensor([[8, 8], [16, 16]]), [(8, 8)]])
def test_a_size_a_view_is_refused_with_what_to_do(size):
    for make in (
        lambda: ds.Cameras(*_matrices(), size),
        lambda: ds.orbit([0.0, 1.0], size=size),
        lambda: ds.look_at(torch.tensor([[1.0, 0, 0], [2.0, 0, 0]]), size=size),
        lambda: ds.orbit([0.0, 1.0]).resize(size),
    ):
        with pytest.raises(ValueError, match=r"size must be one for all views, .* Make a Cameras .* render_batch\("):
            make()


@pytest.mark.usefixtures("unchecked")
def test_several_cameras_are_for_render_batch():
    sketch, cameras = ds.Sketch(torch.rand(1, 2, 3)), ds.orbit(0.0, size=8)
    for pair in ((sketch, [cameras, cameras.resize(9)]), ([sketch, sketch], cameras)):
        with pytest.raises(TypeError, match=r"got .*list.*: render_batch takes several, of any sizes; concatenate"):
            ds.render(*pair)


def test_resize_scales_the_picture():
    cameras, points = _two(), [(0.1, 0.2, 0.3), (-0.2, 0.1, 0.0)]
    larger = cameras.resize((120, 20))
    assert larger.size == (120, 20)
    _close(_pixels(larger, points), _pixels(cameras, points) * torch.tensor([0.5, 2.0, 1.0]), 1e-4)


def test_projection_is_intrinsics_times_pose(generator):
    """Also for intrinsics of each view its own, with skew."""
    intrinsics = torch.eye(3).repeat(3, 1, 1) + torch.rand(3, 3, 3, generator=generator).triu()
    intrinsics[:, 2] = torch.tensor([0.0, 0.0, 1.0])
    poses = ds.orbit([10.0, 20.0, 30.0], 40.0).world_to_camera
    cameras = ds.Cameras(poses, intrinsics, (8, 8))
    points = torch.randn(5, 3, generator=generator, dtype=torch.float64)
    weights = torch.rand(5, 1, generator=generator, dtype=torch.float64) + 0.5
    assert cameras.projection.dtype == torch.float64
    x, y, z, w = (torch.cat([points * weights, weights], 1) @ cameras.projection.mT).unbind(-1)
    _close(torch.stack([x / z, y / z, z / w], -1), _pixels(cameras, points), 1e-12)


def test_projection_keeps_gradients_apart_from_its_cache():
    cameras = _two()
    assert cameras.projection is cameras.projection
    posed = ds.Cameras(cameras.world_to_camera.clone().requires_grad_(), cameras.intrinsics, cameras.size)
    assert posed.projection.requires_grad
    assert posed.projection is not posed.projection


def test_projection_is_that_of_the_matrices_as_they_are():
    """A preview in inference mode leaves nothing behind, nor does a change in place."""
    cameras = _two()
    with torch.inference_mode():
        assert cameras.projection.is_inference()
    assert not cameras.projection.is_inference()
    before = cameras.projection
    cameras.world_to_camera[:, 0, 3] += 0.5
    same = ds.Cameras(cameras.world_to_camera.clone(), cameras.intrinsics, cameras.size)
    assert torch.equal(cameras.projection, same.projection)
    assert not torch.equal(cameras.projection, before)
    with torch.inference_mode():
        passing = ds.Cameras(cameras.world_to_camera.clone(), cameras.intrinsics.clone(), cameras.size)
    assert torch.equal(passing.projection, same.projection)


def _matrices(count: int = 2) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.eye(4).repeat(count, 1, 1), torch.eye(3).repeat(count, 1, 1)


def _with(value: float, index: tuple[int, int, int], which: int):
    matrices = [m.clone() for m in _matrices()]
    matrices[which][index] = value
    return matrices


BAD_CAMERAS = [
    ((torch.eye(4), torch.eye(3)[None], 8), ValueError, r"world_to_camera must have shape \(V, 4, 4\), got \(4, 4\)"),
    ((_matrices()[0], torch.eye(3), 8), ValueError, r"intrinsics must have shape \(V, 3, 3\), got \(3, 3\)"),
    ((torch.eye(4).long()[None], torch.eye(3)[None], 8), TypeError, "world_to_camera must be a floating point tensor"),
    (([1.0], torch.eye(3)[None], 8), TypeError, "world_to_camera must be a floating point tensor, got list"),
    ((_matrices(2)[0], _matrices(3)[1], 8), ValueError, "one matrix a view, got 2 and 3"),
    ((*_with(math.nan, (1, 0, 3), 0), 8), ValueError, "world_to_camera of view 1 has a value that is not finite"),
    ((*_with(math.inf, (1, 0, 2), 1), 8), ValueError, "intrinsics of view 1 has a value that is not finite"),
    ((*_with(0.0, (1, 1, 1), 1), 8), ValueError, r"view 1 has focal lengths that are not positive: \[1.0, 0"),
    ((*_with(-2.0, (0, 0, 0), 1), 8), ValueError, r"intrinsics of view 0 has focal lengths .*: \[-2.0, 1.0\]"),
    ((*_matrices(), 0), ValueError, "size must be a positive int .* got 0"),
    ((*_matrices(), (8, -1)), ValueError, r"size must be .* got \(8, -1\)"),
    ((*_matrices(), (8, 8, 3)), ValueError, r"size must be .* got \(8, 8, 3\)"),
    ((*_matrices(), (8.0, 8)), ValueError, r"size must be .* got \(8.0, 8\)"),
    ((*_matrices(), 16.0), ValueError, "size must be a positive int .* got 16.0"),
    ((*_matrices(), 65537), ValueError, "up to 65536, got 65537"),
    ((*_matrices(), 8, 0.0), ValueError, "near must be a positive number, got 0.0"),
    ((*_matrices(), 8, math.inf), ValueError, "near must be a positive number, got inf"),
    ((*_matrices(), 8, "a"), ValueError, "near must be a positive number, got a"),
]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("arguments", "error", "message"), BAD_CAMERAS)
def test_bad_cameras_are_refused_by_name(arguments, error, message):
    with pytest.raises(error, match=message):
        ds.Cameras(*arguments)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ds.orbit(0.0, 90.1), r"elevation in \[-90, 90\] degrees"),
        (lambda: ds.orbit(0.0, 0.0, 0.0), "distance positive"),
        (lambda: ds.orbit(0.0, 0.0, math.nan), "distance positive"),
        (lambda: ds.orbit(math.nan), "azimuth must be finite, .* got nan, 0.0 and 2.0"),
        (lambda: ds.orbit(0.0, 0.0, math.inf), "distance positive, got 0.0, 0.0 and inf"),
        (lambda: ds.orbit([0.0, 1.0], [0.0, 1.0, 2.0]), r"one value or one a view, got \[2, 3\] values"),
        (lambda: ds.orbit(0.0, fov=180.0), r"fov must lie in \(0, 180\) degrees, got 180"),
        (lambda: ds.orbit(0.0, fov=0.0), r"fov must lie in \(0, 180\)"),
        (lambda: ds.orbit(0.0, height=0.0), r"height must be positive and finite, in world units, got 0\.0"),
        (lambda: ds.orbit([0.0, 1.0], height=[1.0, math.inf]), r"height must be positive and finite, .* \[1\.0, inf\]"),
        (lambda: ds.orbit(0.0, height=[1.0, 2.0]), r"height must have one value or one for each of 1 views"),
        (lambda: ds.orbit(0.0, fov=60.0, height=2.0), r"give one of them, got fov=60\.0 and height=2\.0"),
        (
            lambda: ds.orbit([0.0, 1.0], fov=[50.0, 60.0, 70.0]),
            r"fov must have one value or one for each of 2 views, got shape \(3,\)",
        ),
        (lambda: ds.orbit(0.0, target=(0.0, 0.0)), r"target must have 3 coordinates, got shape \(2,\)"),
        (lambda: ds.orbit(0.0, target=(0.0, 0.0, math.nan)), "target must be finite, got NaN or infinity"),
        (lambda: ds.orbit(0.0, size=0), "size must be a positive int"),
        (lambda: ds.look_at(torch.zeros(3)), r"eye must have shape \(V, 3\), got \(3,\)"),
        (
            lambda: ds.look_at(torch.zeros(1, 3)),
            r"eye of view 0 must be finite, apart from its target .*\[0.0, 0.0, 0.0\]",
        ),
        (lambda: ds.look_at(torch.tensor([[1.0, 0, 0], [math.nan, 0, 1]])), "eye of view 1 must be finite"),
        (lambda: ds.look_at(torch.ones(2, 3), torch.zeros(5, 3)), r"target must have shape \(3,\) or \(2, 3\), got"),
        (lambda: ds.look_at(torch.tensor([[1.0, 0, 0], [0, 0, 2]])), r"eye of view 1 .* \[0.0, 0.0, 2.0\]"),
        (lambda: ds.look_at(torch.ones(1, 3), up=(0.0, 1.0)), r"up must have shape \(3,\) or \(1, 3\), got \(2,\)"),
        (lambda: ds.look_at(torch.ones(1, 3), up=(0.0, 0.0, math.inf)), "up must be finite, got NaN or infinity"),
    ],
)
def test_bad_arguments_are_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("name", ["azimuth", "elevation", "distance", "fov", "height", "target"])
@pytest.mark.parametrize(("value", "kind"), [("x", "str"), ({}, "dict"), ([[1.0], [1.0, 2.0]], "list")])
def test_arguments_of_an_orbit_are_numbers(name, value, kind):
    with pytest.raises(TypeError, match=f"^{name} must be a number, a list of numbers or a tensor, got {kind}"):
        ds.orbit(**{"azimuth": 0.0, name: value})


def test_projections_are_kept_on_the_cpu_alone():
    """On a GPU another stream might read one too early, and that of a captured graph is not there before a replay."""
    cameras = ds.orbit([0.0, 90.0])
    assert cameras.projection is cameras.projection
    away = cameras.to("meta")
    assert away.projection is not away.projection


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((0, slice(0, 3), 1.1), r"view 1 is no rotation .* right angles, but \[\[-0\.55, 0\.9526, 0\.0\], "),
        ((slice(0, 3), slice(0, 3), 1.001), "view 1 is no rotation"),
        ((slice(0, 3), slice(0, 3), 0.0), "view 1 is no rotation"),
        ((1, slice(0, 4), -1.0), r"view 1 is mirrored: its rotation has determinant -1, axes \[\[-0\.5"),
        ((slice(0, 3), 0, -1.0), "view 1 is mirrored"),
        ((3, 3, 2.0), r"view 1 has a last row that is not \(0, 0, 0, 1\), but \[0\.0, 0\.0, 0\.0, 2\.0\]"),
        ((2, 3, math.inf), "view 1 has a value that is not finite, inf"),
        ((slice(0, 3), slice(0, 3), math.nan), "view 1 has a value that is not finite, nan"),
    ],
)
def test_what_is_no_rotation_is_refused(change, message):
    cameras = ds.orbit([0.0, 30.0, 60.0], 20.0, 3.0)
    pose = cameras.world_to_camera.clone()
    rows, columns, factor = change
    pose[1, rows, columns] *= factor
    with pytest.raises(ValueError, match=f"world_to_camera of {message}"):
        ds.Cameras(pose, cameras.intrinsics, cameras.size)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32, torch.bfloat16, torch.float16])
def test_rounded_rotations_are_rotations(dtype):
    cameras = ds.orbit(list(range(0, 360, 7)), 23.0, 3.0).to(dtype)
    assert cameras.world_to_camera.dtype == dtype


def test_a_last_row_of_intrinsics_is_refused():
    """It would make other depths of these."""
    pose, lens = _matrices()
    lens[1, 2, 2] = 0.5
    with pytest.raises(ValueError, match=r"view 1 has a last row that is not \(0, 0, 1\), but \[0\.0, 0\.0, 0\.5\]"):
        ds.Cameras(pose, lens, (8, 8))


@pytest.mark.parametrize("pole", [90.0, -90.0])
@pytest.mark.parametrize("azimuth", [-90.0, 0.0, 37.0, 180.0])
def test_plan_views_are_upright_as_their_neighbours(azimuth, pole):
    """The image of straight above and below is the limit of those beside it, to the angle between them."""
    exact = ds.orbit(azimuth, pole, 3.0).world_to_camera
    _close(exact[:, :3, :3] @ exact[:, :3, :3].mT, torch.eye(3)[None], 1e-6)
    for away in (1e-3, 0.05, 0.15, 1.0):  # on both sides of where the meridian says what is up
        beside = ds.orbit(azimuth, math.copysign(90 - away, pole), 3.0).world_to_camera
        _close(exact, beside, 3 * math.radians(away) + 1e-6)


def test_a_plan_has_x_to_the_right_and_y_up():
    """Azimuth -90 from above, 10 px a unit; from below y is down."""
    points = [(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    for elevation, y in ((90.0, 40.0), (-90.0, 60.0)):
        plan = ds.orbit(-90.0, elevation, 3.0, height=10.0, size=100)
        assert plan.orthographic
        homogeneous = torch.cat([torch.tensor(points), torch.ones(4, 1)], 1).double()
        big_x, big_y, weight, depth = (homogeneous @ plan.projection[0].T).unbind(-1)
        _close(weight, torch.ones(4))
        _close(big_x, [50, 60, 50, 50])
        _close(big_y, [50, 50, y, 50])
        _close(depth, [3, 3, 3, 3 - math.copysign(1, elevation)])


def test_orthographic_cameras_stay_so():
    cameras = ds.orbit([0.0, 90.0], 20.0, height=[2.0, 4.0], size=(60, 40))
    _close(cameras.intrinsics[:, 1, 1], [30, 15])
    for other in (cameras[1], cameras.to(torch.float64), cameras.resize(30)):
        assert other.orthographic
    _close(cameras.resize((30, 40)).intrinsics[:, 1, 1], [15, 7.5])
    assert not ds.orbit(0.0).orthographic


@pytest.mark.usefixtures("unchecked")
def test_one_kind_of_view():
    """No list of kinds is taken for one."""
    with pytest.raises(TypeError, match="orthographic must be True or False, for all views of Cameras, got list"):
        ds.Cameras(*_matrices(), 8, orthographic=[True, False])


def test_gradients_reach_the_eye_of_orthographic_cameras():
    eye = torch.tensor([[1.0, 2.0, 3.0]], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda e: ds.look_at(e, height=2.0).projection, eye)


@pytest.mark.parametrize("lens", [{"fov": 50.0}, {"height": 2.0}])
def test_points_along_a_ray_are_seen_in_its_pixel(lens):
    """At their distance along the view's axis from the camera; 0 where the ray of an orthographic view begins."""
    cameras = ds.orbit([0.0, 70.0], [20.0, -90.0], 3.0, size=(60, 80), **lens).to(torch.float64)
    pixels = torch.tensor([[12.0, 7.5], [71.0, 55.0]], dtype=torch.float64)
    origins, directions = cameras.rays(pixels)
    _close(directions.norm(dim=1), [1, 1], 1e-12)
    axes = cameras.world_to_camera[:, 2, :3]
    for along in (0.5, 2.0, 40.0):
        points = torch.cat([origins + along * directions, torch.ones(2, 1)], 1)
        found, depth = cameras.seen((cameras.projection @ points[..., None])[..., 0])
        _close(found, pixels, 1e-6)
        _close(depth, along * (directions * axes).sum(1), 1e-6)
    if cameras.orthographic:
        _close(directions, axes, 1e-6)
