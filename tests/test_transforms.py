"""transforms.json: the dialects of nerfstudio, instant-ngp and NeRF synthetic, worked by hand."""

import json
import math

import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.distortion import Distortion
from diff3ds.transforms import present_views, read_views

IDENTITY = torch.eye(4).tolist()
GOOD = {"fl_x": 1.0, "w": 4, "h": 4}


def _close(actual, expected, tolerance: float = 1e-5) -> None:
    torch.testing.assert_close(
        actual.double(), torch.as_tensor(expected, dtype=torch.float64), rtol=0, atol=tolerance, check_device=False
    )


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
    x, y, z, w = (cameras.projection[0] @ torch.tensor([1.0, 1, -2, 1]).double()).tolist()
    assert (x / z, y / z, z / w) == pytest.approx((150, 0, 2))


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


def test_instant_ngp_form(tmp_path):
    """Angles of both axes, numbers of no interest here, and pictures that are JPEG though the name does not say so."""
    Image.new("RGB", (80, 60)).save(tmp_path / "0.001.jpg")
    unused = {"aabb_scale": 16, "is_fisheye": False, "offset": [0, 0, 0], "scale": 1, "k4": 0}
    angles = {"camera_angle_x": math.pi / 2, "camera_angle_y": 2 * math.atan(0.5)}
    path = _write(tmp_path, w=80.0, h=60.0, **angles, **unused, frames=[_frame("0.001", sharpness=27.5)])
    (view,) = read_views(path)
    assert view.picture == tmp_path / "0.001.jpg"
    assert view.size == (60, 80)
    _close(view.intrinsics, [[40, 0, 40], [0, 60, 30], [0, 0, 1]])


@pytest.mark.parametrize(
    "how",
    [
        {"camera_model": "ORTHOPHOTO"},
        {"orthographic": True},
        {"camera_model": "orthophoto", "orthographic": True, "camera_angle_x": 0.5},
    ],
)
@pytest.mark.parametrize("where", ["top", "frame"])
def test_orthographic_pictures(tmp_path, how, where):
    """To nerfstudio and to instant-ngp focal lengths are pixels a unit then: (1, 1, -2) lies 10 px right and 20 up."""
    top, frame = (how, {}) if where == "top" else ({"camera_model": "PINHOLE"}, how)
    path = _write(tmp_path, fl_x=10.0, fl_y=20.0, w=200, h=100, **top, frames=[_frame(**frame)])
    cameras, _ = ds.load_transforms(path)
    assert cameras.orthographic
    x, y, w, depth = (cameras.projection[0] @ torch.tensor([1.0, 1, -2, 1]).double()).tolist()
    assert (x / w, y / w, depth / w) == pytest.approx((110, 30, 2))


def test_orthographic_cameras_come_back(tmp_path):
    cameras = ds.orbit([0.0, 50.0, -90.0], [10.0, -30.0, 90.0], 3.0, height=[2.0, 3.0, 4.0], size=(30, 40))
    ds.save_transforms(tmp_path / "t.json", cameras, ["a.png", "b.png", "c.png"])
    back, _ = ds.load_transforms(tmp_path / "t.json")
    assert back.orthographic
    _close(back.projection, cameras.projection)
    # What nerfstudio and instant-ngp look for.
    written = json.loads((tmp_path / "t.json").read_text())
    assert (written["camera_model"], written["orthographic"]) == ("ORTHOPHOTO", True)
    ds.save_transforms(tmp_path / "p.json", ds.orbit(0.0), ["a.png"])
    assert not {"camera_model", "orthographic"} & set(json.loads((tmp_path / "p.json").read_text()))


def test_a_frame_wins_over_the_file_in_either_form(tmp_path):
    frames = [_frame(), _frame(camera_angle_x=math.pi / 2), _frame(fl_y=7.0)]
    views = read_views(_write(tmp_path, w=80, h=60, fl_x=100.0, camera_angle_y=math.pi / 2, frames=frames))
    assert [float(view.intrinsics[0, 0]) for view in views] == pytest.approx([100, 40, 100])
    assert [float(view.intrinsics[1, 1]) for view in views] == pytest.approx([30, 30, 7])


def test_nerfstudio_poses_are_those_of_the_file(tmp_path):
    """`applied_transform` tells how they came about; they hold it already."""
    flip = [[0.0, 1, 0, 3], [1, 0, 0, 0], [0, 0, -1, 0]]
    path = _write(tmp_path, fl_x=100.0, w=200, h=100, applied_transform=flip, applied_scale=2.0, frames=[_frame()])
    _close(ds.load_transforms(path)[0].centers, [[0, 0, 0]])


def test_lens_mask_and_size_of_each_view(tmp_path):
    lens = {"k1": 0.1, "k2": 0.2, "k3": 0.3, "p1": 0.4, "p2": 0.5}
    frames = [_frame("a.png", mask_path="masks/a.png"), _frame("b.png", w=50, h=40, k1=-0.1)]
    path = _write(tmp_path, camera_model="OPENCV", fl_x=9.0, w=4, h=3, **lens, frames=frames)
    a, b = read_views(path)
    assert (a.size, b.size) == ((3, 4), (40, 50))
    assert (a.mask, b.mask) == (tmp_path / "masks" / "a.png", None)
    assert a.distortion == Distortion((0.1, 0.2, 0.3), (0.4, 0.5))
    assert b.distortion == Distortion((-0.1, 0.2, 0.3), (0.4, 0.5))


def test_three_rows_are_enough(tmp_path):
    matrix = [[1.0, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]
    path = _write(tmp_path, fl_x=1.0, w=4, h=4, frames=[_frame(transform_matrix=matrix)])
    _close(ds.load_transforms(path)[0].centers, [[1, 2, 3]])


TURNED = ds.orbit(30.0, 20.0, 3.0).to(torch.float64).world_to_camera[0].inverse() @ torch.diag(
    torch.tensor([1.0, -1, -1, 1]).double()
)


@pytest.mark.parametrize("scale", [0.001, 1.001, 7.0])
def test_a_scale_of_the_axes_is_none_of_the_world(tmp_path, scale):
    """As both programs have it: directions are made unit vectors, and the place is the last column."""
    matrix = TURNED.clone()
    matrix[:3, :3] *= scale
    path = _write(tmp_path, **GOOD, frames=[_frame(transform_matrix=matrix.tolist())])
    _close(ds.load_transforms(path)[0].world_to_camera, ds.orbit(30.0, 20.0, 3.0).world_to_camera, 1e-6)


@pytest.mark.parametrize("digits", [3, 4, 8])
def test_rounded_matrices_become_rotations(tmp_path, digits):
    matrix = torch.round(TURNED, decimals=digits).tolist()
    matrix[3][3] = 1 + 2**-52
    pose = ds.load_transforms(_write(tmp_path, **GOOD, frames=[_frame(transform_matrix=matrix)]))[0].world_to_camera[0]
    _close(pose[:3, :3] @ pose[:3, :3].T, torch.eye(3), 1e-14)
    # Six or so roundings of half a unit in the last place.
    _close(pose, ds.orbit(30.0, 20.0, 3.0).world_to_camera[0], max(1e-6, 5 * 10.0**-digits))


def test_numbers_may_be_text(tmp_path):
    """As nerfstudio reads them."""
    matrix = [[str(value) for value in row] for row in TURNED.tolist()]
    path = _write(tmp_path, fl_x="7.5", w="4", h=" 4 ", cx="1e0", frames=[_frame(transform_matrix=matrix)])
    (view,) = read_views(path)
    assert view.size == (4, 4)
    _close(view.intrinsics, [[7.5, 0, 1], [0, 7.5, 2], [0, 0, 1]])
    _close(view.world_to_camera, ds.orbit(30.0, 20.0, 3.0).world_to_camera[0], 1e-6)


def test_null_is_as_good_as_missing(tmp_path):
    empty = {"fl_y": None, "k1": None, "mask_path": None, "camera_model": None, "cx": None, "is_fisheye": None}
    (view,) = read_views(_write(tmp_path, **GOOD, cy=None, **empty, frames=[_frame(fl_x=None, **empty)]))
    assert (view.mask, view.distortion) == (None, Distortion())
    _close(view.intrinsics, [[1, 0, 2], [0, 1, 2], [0, 0, 1]])


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-8"])
def test_encodings_of_windows(tmp_path, encoding):
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({**GOOD, "frames": [_frame("ä.png")]}, ensure_ascii=False), encoding=encoding)
    assert read_views(path)[0].picture == tmp_path / "ä.png"


def test_comments_are_passed_over(tmp_path):
    """As instant-ngp passes over them; what looks like one in a name is none."""
    path = tmp_path / "transforms.json"
    text = json.dumps({**GOOD, "frames": [_frame("a//b /* c */ d.png")]}, indent=1)
    path.write_text("// by hand\n" + text.replace('"w": 4,', '"w": 4, /* pixels\n "w": 5, */'))
    (view,) = read_views(path)
    assert (view.size, view.picture) == ((4, 4), tmp_path / "a" / "b /* c */ d.png")


def test_paths_of_other_systems(tmp_path):
    (tmp_path / "images").mkdir()
    Image.new("L", (4, 4)).save(tmp_path / "images" / "a.JPG")
    Image.new("L", (4, 4)).save(tmp_path / "back\\slash.png")
    names = ["images\\a.JPG", ".\\images\\a", "./images/a.JPG", str(tmp_path / "images" / "a.JPG"), "back\\slash.png"]
    found = [view.picture for view in present_views(_write(tmp_path, **GOOD, frames=[_frame(name) for name in names]))]
    assert all(picture.is_file() for picture in found)
    masked = read_views(_write(tmp_path, **GOOD, frames=[_frame(mask_path="images\\a.JPG")]))
    assert masked[0].mask == tmp_path / "images" / "a.JPG"


def test_instant_ngp_has_angles_in_degrees_too(tmp_path):
    (view,) = read_views(_write(tmp_path, w=80, h=60, x_fov=90.0, y_fov="53.13010235415598", frames=[_frame()]))
    _close(view.intrinsics, [[40, 0, 40], [0, 60, 30], [0, 0, 1]])


def _pictures(folder, names):
    for name in names:
        Image.new("L", (4, 4)).save(folder / name)


def test_frames_without_pictures_are_left_out(tmp_path):
    """Counted and named, and not below three."""
    _pictures(tmp_path, ["1.png", "3.png", "4.png"])
    frames = [_frame(f"{i}.png", fl_x=float(i)) for i in range(1, 6)]
    # The size comes from the pictures that are there.
    path = _write(tmp_path, frames=frames)
    with pytest.warns(UserWarning, match=r"2 of 5 pictures are missing: .*2\.png, .*5\.png\. .* They are left out"):
        views = present_views(path)
    assert [float(view.intrinsics[0, 0]) for view in views] == [1, 3, 4]
    (tmp_path / "3.png").rename(tmp_path / "3.PNG")
    with pytest.raises(FileNotFoundError, match=r"3 of 5 pictures are missing: .*2\.png, .*3\.png, .*5\.png"):
        present_views(path)


@pytest.mark.parametrize(("named", "there"), [("a.png", "A.png"), ("a%20b.png", "a b.png"), ("a b.png", "a%20b.png")])
def test_names_that_other_systems_find_are_named(tmp_path, named, there):
    _pictures(tmp_path, [there])
    with pytest.raises(FileNotFoundError, match=rf"1 of 1 pictures are missing: .*{there} is there: write names as"):
        present_views(_write(tmp_path, **GOOD, frames=[_frame(named)]))


def test_the_split_of_nerfstudio(tmp_path):
    _pictures(tmp_path, ["1.png", "2.png", "3.png"])
    split = {"train_filenames": ["3.png", "./1"], "val_filenames": [], "test_filenames": ["2.png"]}
    frames = [_frame(f"{i}.png") for i in (1, 2, 3)]
    found = present_views(_write(tmp_path, **GOOD, **split, frames=frames))
    assert [view.picture.name for view in found] == ["1.png", "3.png"]
    for wrong in (["4.png"], [], "1.png", [1]):
        with pytest.raises(ValueError, match="train_filenames must"):
            present_views(_write(tmp_path, **GOOD, train_filenames=wrong, frames=frames))


def test_what_instant_ngp_would_do_is_said(tmp_path):
    _pictures(tmp_path, ["a.png"])
    keys = {"aabb_scale": 4, "scale": 0.3, "offset": [1, 2, 3], "up": [0, 0, 1], "ply_file_path": "a.ply"}
    path = _write(tmp_path, **GOOD, **keys, n_frames=0, white_transparent=False, frames=[_frame(sharpness=3)])
    (view,) = present_views(path)
    _close(view.world_to_camera, torch.diag(torch.tensor([1, -1, -1, 1])))
    for key in ("n_frames", "rolling_shutter", "white_transparent"):
        with pytest.warns(UserWarning, match=f"{key} is for instant-ngp; here "):
            present_views(_write(tmp_path, **GOOD, **{key: [1]}, frames=[_frame()]))


def test_map_coordinates_keep_their_digits(tmp_path):
    """Float32 would move this camera by a quarter of a metre."""
    centre = torch.tensor([500000.25, 4600000.1, 100.5], dtype=torch.float64)
    matrix = TURNED.clone()
    matrix[:3, 3] = centre
    cameras, _ = ds.load_transforms(_write(tmp_path, **GOOD, frames=[_frame(transform_matrix=matrix.tolist())]))
    _close(cameras.centers[0], centre, 1e-8)
    ds.save_transforms(tmp_path / "again.json", cameras, ["a.png"])
    _close(ds.load_transforms(tmp_path / "again.json")[0].centers[0], centre, 1e-8)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_near_plane_is_nearer_in_small_worlds(tmp_path, scale):
    """Whatever the unit, what the cameras stand around is drawn."""
    cameras = ds.orbit([0.0, 120.0, 240.0], 20.0, 3.0, size=32)
    cameras.world_to_camera[:, :3, 3] *= scale
    ds.save_transforms(tmp_path / "t.json", cameras, ["a.png"] * 3)
    loaded, _ = ds.load_transforms(tmp_path / "t.json")
    assert loaded.near <= 0.01
    point = scale * torch.tensor([[[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]]])
    assert (ds.render(ds.Sketch(point, width=0.1), loaded).alpha.amax((1, 2)) > 0.9).all()


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
    assert torch.equal(back.intrinsics, cameras.intrinsics.double())
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


@pytest.mark.parametrize("name", ["nerf_synthetic/chair", "abc_nef/00000952", "abc_nef/00004926"])
def test_real_files(data_folder, name):
    for path in sorted((data_folder / name).glob("transforms*.json")):
        cameras, pictures = ds.load_transforms(path)
        assert cameras.size == (400, 400)
        assert len(cameras) == len(pictures)
        assert all(p.exists() for p in pictures)
