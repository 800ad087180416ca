"""Cameras: orbits, look-at and transforms.json against the conventions, worked by hand."""

import json
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import diff3ds as ds

IDENTITY = torch.eye(4).tolist()


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
    ((*_with(0.0, (1, 1, 1), 1), 8), ValueError, r"intrinsics of view 1: focal lengths must be positive, got \[1.0, 0"),
    ((*_with(-2.0, (0, 0, 0), 1), 8), ValueError, r"intrinsics of view 0: focal lengths .* got \[-2.0, 1.0\]"),
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
        (lambda: ds.orbit(0.0, 90.0), r"elevation in \(-90, 90\) degrees"),
        (lambda: ds.orbit(0.0, 0.0, 0.0), "distance positive"),
        (lambda: ds.orbit(0.0, 0.0, math.nan), "distance positive"),
        (lambda: ds.orbit(math.nan), "azimuth must be finite, .* got nan, 0.0 and 2.0"),
        (lambda: ds.orbit(0.0, 0.0, math.inf), "distance positive, got 0.0, 0.0 and inf"),
        (lambda: ds.orbit([0.0, 1.0], [0.0, 1.0, 2.0]), r"one value or one a view, got \[2, 3\] values"),
        (lambda: ds.orbit(0.0, fov=180.0), r"fov must lie in \(0, 180\) degrees, got 180"),
        (lambda: ds.orbit(0.0, fov=0.0), r"fov must lie in \(0, 180\)"),
        (
            lambda: ds.orbit([0.0, 1.0], fov=[50.0, 60.0, 70.0]),
            r"fov must have one value or one for each of 2 views, got shape \(3,\)",
        ),
        (lambda: ds.orbit(0.0, size=0), "size must be a positive int"),
        (lambda: ds.look_at(torch.zeros(3)), r"eye must have shape \(V, 3\), got \(3,\)"),
        (
            lambda: ds.look_at(torch.zeros(1, 3)),
            r"eye of view 0 must be finite, apart from its target .*\[0.0, 0.0, 0.0\]",
        ),
        (lambda: ds.look_at(torch.tensor([[1.0, 0, 0], [math.nan, 0, 1]])), "eye of view 1 must be finite"),
        (lambda: ds.look_at(torch.ones(2, 3), torch.zeros(5, 3)), r"target must have shape \(3,\) or \(2, 3\), got"),
        (lambda: ds.look_at(torch.tensor([[1.0, 0, 0], [0, 0, 2]])), r"eye of view 1 .* \[0.0, 0.0, 2.0\]"),
    ],
)
def test_bad_arguments_are_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def _write(folder, **content):
    path = folder / "transforms.json"
    path.write_text(json.dumps(content))
    return path


def _frame(name: str = "a.png", **values):
    return {"file_path": name, "transform_matrix": IDENTITY, **values}


def test_files_hold_opengl_axes(tmp_path):
    """The identity looks along -z with y up: a point at (1, 1, -2) is to the right and above the centre."""
    path = _write(tmp_path, fl_x=100.0, w=200, h=100, frames=[_frame()])
    cameras, pictures = ds.load_transforms(path)
    assert pictures == [tmp_path / "a.png"]
    assert cameras.size == (100, 200)
    _close(_pixels(cameras, [(1, 1, -2)]), [[[150, 0, 2]]])


def test_camera_to_world_is_turned_round(tmp_path):
    """A camera at (5, 0, 0) turned to look along -x (OpenGL: its z is +x, its y is +z)."""
    matrix = [[0.0, 0, 1, 5], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
    path = _write(tmp_path, fl_x=100.0, w=100, h=100, frames=[_frame(transform_matrix=matrix)])
    cameras, _ = ds.load_transforms(path)
    _close(cameras.centers, [[5, 0, 0]])
    _close(cameras.world_to_camera, ds.orbit(0.0, 0.0, 5.0).world_to_camera)


def test_nerf_synthetic_form(tmp_path):
    """One angle for all, no size, names without a suffix: the size comes from the picture."""
    Image.new("RGBA", (80, 60)).save(tmp_path / "r_0.png")
    Image.new("RGBA", (80, 60)).save(tmp_path / "r_1.png")
    path = _write(tmp_path, camera_angle_x=math.pi / 2, frames=[_frame("./r_0"), _frame("./r_1")])
    cameras, pictures = ds.load_transforms(path)
    assert [p.name for p in pictures] == ["r_0.png", "r_1.png"]
    assert cameras.size == (60, 80)
    _close(cameras.intrinsics, torch.tensor([[40.0, 0, 40], [0, 40, 30], [0, 0, 1]]).expand(2, 3, 3))


def test_nerfstudio_form_with_intrinsics_of_each_view(tmp_path):
    frames = [_frame("a.png", fl_x=90.0, cx=33.0), _frame("b.png"), _frame("c.png", fl_y=70.0)]
    path = _write(tmp_path, w=64, h=48, fl_x=100.0, fl_y=110.0, cy=20.0, k1=0.0, p2=0, frames=frames)
    k = ds.load_transforms(path)[0].intrinsics
    _close(k[:, 0, 0], [90, 100, 100])
    _close(k[:, 1, 1], [110, 110, 70])
    _close(k[:, 0, 2], [33, 32, 32])
    _close(k[:, 1, 2], [20, 20, 20])


def test_three_rows_are_enough(tmp_path):
    matrix = [[1.0, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]
    path = _write(tmp_path, fl_x=1.0, w=4, h=4, frames=[_frame(transform_matrix=matrix)])
    _close(ds.load_transforms(path)[0].centers, [[1, 2, 3]])


def test_round_trip(tmp_path, generator):
    intrinsics = torch.eye(3).repeat(4, 1, 1)
    intrinsics[:, [0, 1, 0, 1], [0, 1, 2, 2]] = 10 + 100 * torch.rand(4, 4, generator=generator)
    poses = ds.orbit([10.0, 100.0, 200.0, 300.0], [0.0, -40.0, 30.0, 80.0], 3.0).world_to_camera
    cameras = ds.Cameras(poses, intrinsics, (30, 50))
    names = [f"view {i}.png" for i in range(4)]
    ds.save_transforms(tmp_path / "new" / "transforms.json", cameras, names)
    back, pictures = ds.load_transforms(tmp_path / "new" / "transforms.json")
    assert [p.name for p in pictures] == names
    assert back.size == cameras.size
    assert torch.equal(back.intrinsics, cameras.intrinsics)
    # The file holds inverses: a rotation in float32 is one to 1e-7.
    _close(back.world_to_camera, cameras.world_to_camera, 1e-5)


def test_files_can_be_read_by_others(tmp_path):
    """Plain numbers, camera-to-world with OpenGL axes."""
    ds.save_transforms(tmp_path / "t.json", ds.orbit(0.0, 0.0, 5.0, fov=90.0, size=(20, 40)), ["x.png"])
    content = json.loads((tmp_path / "t.json").read_text())
    (frame,) = content["frames"]
    assert (content["w"], content["h"], frame["file_path"]) == (40, 20, "x.png")
    assert math.isclose(frame["fl_x"], 10, rel_tol=1e-6)
    _close(torch.tensor(frame["transform_matrix"]), [[0.0, 0, 1, 5], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


GOOD = {"fl_x": 1.0, "w": 4, "h": 4}
SHEARED = [[1.0, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
MIRRORED = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
BAD_FILES = [
    ("[]", "expected an object with a non-empty list 'frames'"),
    ("{}", "non-empty list 'frames'"),
    ('{"frames": []}', "non-empty list 'frames'"),
    ('{"frames": [1]}', "non-empty list 'frames'"),
    ("{", "not a JSON file"),
    ("[" * 100000, "not a JSON file"),
    (b"\xff\xfe\x00", "not a text file"),
    ({**GOOD, "frames": [{"transform_matrix": IDENTITY}]}, "frame 0 has no file_path"),
    ({**GOOD, "frames": [_frame(), {"file_path": "b.png"}]}, "frame 1 has no transform_matrix"),
    ({**GOOD, "frames": [_frame(transform_matrix=[[1, 2], [3]])]}, "frame 0 has no transform_matrix of 4x4 numbers"),
    ({**GOOD, "frames": [_frame(transform_matrix=torch.eye(3).tolist())]}, "must hold 4x4 finite numbers"),
    ({**GOOD, "frames": [_frame(transform_matrix="abc")]}, "frame 0 has no transform_matrix"),
    ({**GOOD, "frames": [_frame(transform_matrix=SHEARED)]}, "frame 0: transform_matrix is not a rotation"),
    ({**GOOD, "frames": [_frame(transform_matrix=MIRRORED)]}, "frame 0: transform_matrix is not a rotation"),
    ({"w": 4, "h": 4, "frames": [_frame()]}, "frame 0 has neither fl_x nor camera_angle_x"),
    ({**GOOD, "fl_x": "wide", "frames": [_frame()]}, "fl_x must be a finite number, got 'wide'"),
    ({**GOOD, "fl_x": True, "frames": [_frame()]}, "fl_x must be a finite number, got True"),
    ({**GOOD, "fl_x": -1.0, "frames": [_frame()]}, "focal lengths must be positive"),
    ({"w": 4, "h": 4, "camera_angle_x": 0.0, "frames": [_frame()]}, r"camera_angle_x must lie in \(0, pi\), got 0.0"),
    ({**GOOD, "cx": math.nan, "frames": [_frame()]}, "cx must be a finite number, got nan"),
    ({**GOOD, "k1": 0.1, "frames": [_frame()]}, r"lens distortion \(k1\); undistort"),
    ({**GOOD, "frames": [_frame(p1=-0.1)]}, r"lens distortion \(p1\)"),
    ({**GOOD, "frames": [_frame(), _frame(w=5)]}, r"all views must have one size, got \[\(4, 4\), \(4, 5\)\]"),
    ({**GOOD, "w": "4", "frames": [_frame()]}, "w must be a finite number, got '4'"),
    ({**GOOD, "w": [4], "frames": [_frame()]}, r"w must be a finite number, got \[4\]"),
    ({**GOOD, "w": 4.5, "frames": [_frame()]}, "w and h must be whole numbers, got 4.5"),
    ({**GOOD, "cy": 10**400, "frames": [_frame()]}, "cy must be a finite number, got 1000"),
    ({**GOOD, "frames": [_frame(transform_matrix=[[10**400] * 4] * 4)]}, "frame 0 has no transform_matrix"),
    ('{"frames": ' + "1" * 5000 + "}", "not a JSON file"),
    ({**GOOD, "frames": [_frame(transform_matrix=[*IDENTITY[:3], [0, 0, 1, 1]])]}, "is not a rotation"),
    ({**GOOD, "w": 0, "frames": [_frame()]}, "size must be a positive int"),
    ({**GOOD, "h": 10**9, "frames": [_frame()]}, "up to 65536"),
]


@pytest.mark.parametrize(("content", "message"), BAD_FILES)
def test_malformed_files_are_refused(tmp_path, content, message):
    path = tmp_path / "transforms.json"
    text = content if isinstance(content, str | bytes) else json.dumps(content)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=message) as caught:
        ds.load_transforms(path)
    assert str(path) in str(caught.value)


def test_files_too_large_are_not_read(tmp_path):
    path = tmp_path / "transforms.json"
    with path.open("wb") as file:
        file.truncate((1 << 28) + 1)
    with pytest.raises(ValueError, match=r"268435457 bytes are more than the 268435456 that are read"):
        ds.load_transforms(path)


def test_missing_files_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"transforms\.json"):
        ds.load_transforms(tmp_path / "transforms.json")
    path = _write(tmp_path, camera_angle_x=1.0, frames=[_frame("gone")])
    with pytest.raises(FileNotFoundError, match=r"gone\.png"):
        ds.load_transforms(path)


def test_pictures_that_are_none_are_named(tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    path = _write(tmp_path, camera_angle_x=1.0, frames=[_frame("text")])
    with pytest.raises(ValueError, match=r"text\.png: not a picture"):
        ds.load_transforms(path)


def test_nothing_is_written_on_errors(tmp_path):
    with pytest.raises(ValueError, match="expected 2 pictures, one a view, got 1"):
        ds.save_transforms(tmp_path / "t.json", _two(), ["a.png"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["nerf_synthetic/chair", "abc_nef/00000952", "abc_nef/00004926"])
def test_real_files(data_folder, name):
    for path in sorted((data_folder / name).glob("transforms*.json")):
        cameras, pictures = ds.load_transforms(path)
        assert cameras.size == (400, 400)
        assert len(cameras) == len(pictures)
        assert all(p.exists() for p in pictures)
