"""Projects of every kind: read, with the cameras that they hold, or refused in a sentence."""

import re

import numpy as np
import pytest
from written_projects import (
    CAMERAS,
    FOCAL,
    KINDS,
    NAMES,
    PLACES,
    POINTS,
    SIZE,
    TURNS,
    WITH_LENS,
    WITH_POINTS,
    colmap_text,
    pictures,
    seen,
    write_colmap,
    write_meta_data,
    write_metashape,
)

from diff3ds.photogrammetry.find_project import NoCameras, find_project, present_views, project_of, sparse_points
from diff3ds.photogrammetry.picture_files import masks_for, pictures_in
from diff3ds.photogrammetry.shot import quaternion_pose
from diff3ds.transforms import read_views, save_views

# Programs list pictures that they have not placed.
pytestmark = pytest.mark.filterwarnings("ignore:.*1 of 5 pictures are left out, .*never:UserWarning")


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_the_same_cameras(tmp_path, kind):
    KINDS[kind](tmp_path)
    views = present_views(find_project(tmp_path))
    assert [view.picture.name for view in views] == NAMES
    for i, view in enumerate(views):
        np.testing.assert_allclose(view.world_to_camera, CAMERAS.world_to_camera[i], atol=2e-6)
        np.testing.assert_allclose(view.intrinsics, CAMERAS.intrinsics[i], atol=1e-5)
        assert view.size == SIZE
        assert view.distortion.radial[:2] == ((-0.1, 0.05) if kind in WITH_LENS else ())
    found = sparse_points(find_project(tmp_path))
    assert found.tolist() == (POINTS.tolist() if kind in WITH_POINTS else [])


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_comes_back_from_a_transforms_json(tmp_path, kind):
    KINDS[kind](tmp_path)
    views = present_views(find_project(tmp_path))
    save_views(tmp_path / "transforms.json", views)
    for view, again in zip(views, read_views(tmp_path / "transforms.json"), strict=True):
        np.testing.assert_allclose(seen(again), seen(view), atol=1e-9)
        assert (again.picture, again.size) == (view.picture, view.size)


def test_metashape_names_the_tangential_coefficients_the_other_way_round(tmp_path):
    """Its manual: x' = x (1 + K1 r^2) + P1 (r^2 + 2 x^2) + 2 P2 x y, u = w/2 + cx + x' f + x' B1 + y' B2."""
    write_metashape(tmp_path)
    text = (tmp_path / "cameras.xml").read_text()
    more = "<cx>1.5</cx><cy>-2</cy><b1>0.5</b1><b2>0.25</b2><p1>0.01</p1><p2>-0.02</p2><k1>-0.1</k1>"
    (tmp_path / "cameras.xml").write_text(text.replace("<k1>-0.1</k1><k2>0.05</k2>", more))
    view = present_views(find_project(tmp_path))[0]
    moved = POINTS @ TURNS[0].T + PLACES[0]
    for (x, y), pixel in zip(moved[:, :2] / moved[:, 2:], seen(view), strict=True):
        r2 = x * x + y * y
        bent_x = x * (1 - 0.1 * r2) + 0.01 * (r2 + 2 * x * x) - 0.04 * x * y
        bent_y = y * (1 - 0.1 * r2) - 0.02 * (r2 + 2 * y * y) + 0.02 * x * y
        expected = (SIZE[1] / 2 + 1.5 + bent_x * (FOCAL + 0.5) + bent_y * 0.25, SIZE[0] / 2 - 2 + bent_y * FOCAL)
        np.testing.assert_allclose(pixel, expected, atol=1e-5)


def test_edges_or_pictures_of_an_edge_data_set(tmp_path):
    write_meta_data(tmp_path)
    path = find_project(tmp_path)
    assert {view.picture.parent.name for view in present_views(path)} == {"edge_DexiNed"}
    assert {view.picture.parent.name for view in present_views(path, "color-edges")} == {"color"}


def test_masks_lie_in_a_folder_of_that_name(tmp_path):
    """With .png behind the whole name, as COLMAP has them, or another suffix in place of the picture's."""
    write_colmap(tmp_path)
    masks = [f"{NAMES[0]}.png", NAMES[1], NAMES[2].replace(".png", ".jpg")]
    pictures(tmp_path / "masks", masks)
    with pytest.warns(UserWarning, match="masks: 1 of 4 pictures have no mask there"):
        views = present_views(find_project(tmp_path))
    assert [view.mask and view.mask.name for view in views] == [*masks, None]


def test_missing_pictures_are_left_out(tmp_path):
    write_colmap(tmp_path)
    (tmp_path / "images" / NAMES[1]).unlink()
    with pytest.warns(UserWarning, match=r"1 of 4 pictures are missing: shot 1\.png\. They are left out"):
        assert len(present_views(find_project(tmp_path))) == 3
    (tmp_path / "images" / NAMES[2]).unlink()
    with pytest.raises(FileNotFoundError, match=r"2 of 4 pictures are missing: .* Looked in .*images.*put them into a"):
        present_views(find_project(tmp_path))


def test_one_picture_is_not_taken_for_two_of_its_name(tmp_path):
    write_meta_data(tmp_path)
    file = tmp_path / "meta_data.json"
    for i, name in enumerate(NAMES):
        file.write_text(file.read_text().replace(f'"{name}"', f'"cam{i}/{NAMES[max(i, 1)]}"'))
    with pytest.raises(FileNotFoundError, match=r"2 of 4 pictures are missing: cam0/shot 1\.png, cam1/shot 1\.png"):
        present_views(file)


def test_a_mask_is_no_picture_that_lies_outside(tmp_path):
    write_colmap(tmp_path)
    pictures(tmp_path / "other")
    pictures(tmp_path / "images" / "masks", NAMES[1:])
    pictures_outside = [tmp_path / "images" / ".." / "other" / name for name in NAMES]
    with pytest.warns(UserWarning, match="1 of 4 pictures have no mask"):
        masks = masks_for(pictures_outside, tmp_path / "images")
    assert masks == [None, *(tmp_path / "images" / "masks" / name for name in NAMES[1:])]


def test_a_folder_is_no_picture_whatever_it_is_called(tmp_path):
    write_colmap(tmp_path)
    (tmp_path / "images" / "a folder.png").mkdir()
    assert [file.name for file in pictures_in(tmp_path / "images")] == NAMES


@pytest.mark.parametrize("kind", sorted(WITH_POINTS))
@pytest.mark.parametrize("word", ["1e999", "1e200"])
def test_points_that_are_nowhere_are_left_out(tmp_path, kind, word):
    """As the one damaged number of a file; squares of what is kept are finite too."""
    KINDS[kind](tmp_path)
    last = str(POINTS[-1, -1])
    for file in tmp_path.rglob("*"):
        if file.suffix in (".txt", ".json", ".out"):
            file.write_text(file.read_text().replace(last, word))
    assert sparse_points(find_project(tmp_path)).tolist() == POINTS[:-1].tolist()


@pytest.mark.parametrize("word", ["nan", "inf", "-1", "1.5"])
def test_points_of_bundler_are_seen_a_whole_number_of_times(tmp_path, word):
    path = tmp_path / "bundle.out"
    path.write_text(f"# Bundle file v0.3\n0 1\n0 0 0\n0 0 0\n{word}\n")
    with pytest.raises(ValueError, match="in how many pictures a point is seen"):
        sparse_points(path)


def test_smaller_copies_and_other_suffixes(tmp_path):
    colmap_text(tmp_path / "sparse" / "0")
    pictures(tmp_path / "images_2", [name.replace(".png", ".jpg") for name in NAMES], (SIZE[0] // 2, SIZE[1] // 2))
    views = present_views(find_project(tmp_path))
    assert {view.picture.parent.name for view in views} == {"images_2"}


@pytest.mark.parametrize(
    ("kind", "file", "change", "message"),
    [
        (
            "colmap",
            "sparse/0/cameras.txt",
            lambda t: t.replace("RADIAL", "FOV"),
            "camera 7: the camera model 'FOV'",
        ),
        ("colmap", "sparse/0/cameras.txt", lambda t: t.replace(" -0.1", ""), "RADIAL has 5 parameters, got 4"),
        ("colmap", "sparse/0/cameras.txt", lambda t: t.replace(repr(FOCAL), "nan"), "focal lengths must be positive"),
        ("colmap", "sparse/0/cameras.txt", lambda t: t.replace("64 48", "6.4 48"), r"line 2: expected a whole number"),
        (
            "colmap",
            "sparse/0/images.txt",
            lambda t: t.replace(" 7 shot", " 8 shot"),
            "camera 8, which cameras.txt",
        ),
        ("colmap", "sparse/0/images.txt", lambda t: t.replace(" 7 shot 1.png", ""), "expected IMAGE_ID, QW, QX"),
        ("colmap", "sparse/0/images.txt", lambda t: "# nothing", "no picture is registered"),
        ("bundler", "bundle.out", lambda t: t[:90], "damaged, it ends too early"),
        (
            "bundler",
            "bundle.out",
            lambda t: t.replace("5 4", "7 4"),
            "7 cameras, but the list of .* has 5",
        ),
        (
            "openmvg",
            "sfm_data.json",
            lambda t: t.replace("extrinsics", "poses"),
            "expected views, intrinsics",
        ),
        (
            "openmvg",
            "sfm_data.json",
            lambda t: re.sub('"focal_length": [0-9.]+', f'"focal_length": 1{"0" * 400}', t),
            "an intrinsic without a focal length",
        ),
        ("openmvg", "sfm_data.json", lambda t: t.replace("focal_length", "f"), "an intrinsic without a focal length"),
        ("meta_data", "meta_data.json", lambda t: t.replace("camtoworld", "pose"), "frame 0 has no camtoworld of"),
        ("meta_data", "meta_data.json", lambda t: t.replace("rgb_path", "path"), "frame 0 has no rgb_path"),
        ("metashape", "cameras.xml", lambda t: t.replace("</document>", ""), "not an XML file"),
        ("metashape", "cameras.xml", lambda t: "<!DOCTYPE a [<!ENTITY b 'c'>]>" + t[21:], "DOCTYPE is not read"),
        (
            "metashape",
            "cameras.xml",
            lambda t: t.replace('type="frame">', 'type="spherical">'),
            "is spherical, not",
        ),
        ("metashape", "cameras.xml", lambda t: t.replace("transform>", "moved>"), "no camera is aligned"),
    ],
)
def test_broken_projects_are_refused_in_a_sentence(tmp_path, kind, file, change, message):
    KINDS[kind](tmp_path)
    path = find_project(tmp_path)
    (tmp_path / file).write_text(change((tmp_path / file).read_text()))
    with pytest.raises(ValueError, match=message):
        present_views(path)


def test_a_folder_without_cameras_says_what_it_holds(tmp_path):
    (tmp_path / "model.psx").touch()
    with pytest.raises(
        FileNotFoundError, match=r"Found: model\.psx is a Metashape project: export .*What would do: a trans"
    ):
        find_project(tmp_path)
    pictures(tmp_path / "images")
    with pytest.raises(FileNotFoundError, match=r'Found: 4 pictures in images; model.psx .*"diff3ds cameras .*" finds'):
        find_project(tmp_path)
    found = project_of(tmp_path)
    assert isinstance(found, NoCameras)
    assert [file.name for file in found.pictures] == NAMES
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(ValueError, match="not a file with cameras"):
        present_views(tmp_path / "a.txt")


def test_a_rotation_of_nothing_is_none():
    with pytest.raises(ValueError, match="no rotation and translation"):
        quaternion_pose("here", [0.0] * 4, [0.0] * 3)
