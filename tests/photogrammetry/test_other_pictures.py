"""Which pictures are meant: beside masks, in smaller copies and subfolders, straightened; and what is not read."""

import json
import re

import numpy as np
import pytest
from needs import needs
from PIL import Image
from written_projects import CAMERAS, FOCAL, KINDS, NAMES, SIZE, pictures, write_colmap, write_meshroom, write_metashape

import diff3ds as ds
from diff3ds.formats.png import load_image
from diff3ds.photogrammetry.find_project import NoCameras, find_project, present_views, project_of
from diff3ds.tasks.views.run_views import run_views
from diff3ds.transforms import of_picture_sizes

pytestmark = pytest.mark.filterwarnings("ignore:.*1 of 5 pictures are left out, .*never:UserWarning")
STEMS = [name[:-4] for name in NAMES]


def named(folder, *suffixes):
    """Pictures of one name with these suffixes in place of those that are there."""
    for name in NAMES:
        (folder / name).unlink()
    for suffix in suffixes:
        pictures(folder, [stem + suffix for stem in STEMS])


@pytest.mark.parametrize("kind", ["metashape", "gaussians", "mvsnet"])
def test_masks_beside_photographs_are_not_taken_for_them(tmp_path, kind):
    KINDS[kind](tmp_path)
    named(tmp_path / "images", ".png", ".jpg")
    with pytest.warns(UserWarning, match=r"4 files are named as pictures .* left out: .*0\.png.*folder 'masks'"):
        views = present_views(find_project(tmp_path))
    assert [view.picture.name for view in views] == [f"{stem}.jpg" for stem in STEMS]


def test_one_suffix_that_most_have(tmp_path):
    write_metashape(tmp_path)
    named(tmp_path / "images", ".png")
    pictures(tmp_path / "images", [f"{STEMS[0]}.tif"])
    with pytest.warns(UserWarning, match=r"1 files are named as pictures .*0\.tif"):
        assert {view.picture.suffix for view in present_views(find_project(tmp_path))} == {".png"}


@pytest.mark.parametrize("others", [(".png", ".tif"), (".jpg", ".heic"), (".png", ".PNG")])
def test_two_pictures_that_may_be_meant_are_both_named(tmp_path, others, monkeypatch):
    monkeypatch.setattr("diff3ds.photogrammetry.picture_files.SUFFIXES", (".jpg", ".png", ".PNG", ".tif", ".heic"))
    write_metashape(tmp_path)
    named(tmp_path / "images")
    for stem in STEMS:
        for suffix in others:
            (tmp_path / "images" / f"{stem}{suffix}").write_bytes(b"")
    a, b = map(re.escape, others)
    with pytest.raises(ValueError, match=rf"shot 0({a} or shot 0{b}|{b} or shot 0{a}) for shot 0\? Put masks"):
        present_views(find_project(tmp_path))


def test_fewer_photographs_than_masks_are_not_guessed(tmp_path):
    """Without the photograph of one view, its mask would be taken for it."""
    write_metashape(tmp_path)
    named(tmp_path / "images", ".png", ".jpg")
    (tmp_path / "images" / f"{STEMS[1]}.jpg").unlink()
    with pytest.raises(ValueError, match=r"shot 0\.jpg or shot 0\.png"):
        present_views(find_project(tmp_path))


@pytest.mark.parametrize(
    ("bundle", "names"),
    [
        ("scene.bundle.out", "scene.list.txt"),
        ("scene.out", "scene.list.txt"),
        ("bundle.out", "bundle.out.list.txt"),
        ("bundle.out", "bundle.txt"),
        ("bundle.out", "pictures.list.txt"),
    ],
)
def test_lists_of_bundler_and_of_those_who_write_its_files(tmp_path, bundle, names):
    KINDS["bundler"](tmp_path)
    (tmp_path / "bundle.out").rename(tmp_path / bundle)
    (tmp_path / "list.txt").rename(tmp_path / names)
    assert [view.picture.name for view in present_views(find_project(tmp_path))] == NAMES
    for other in ("a.list.txt", "b.list.txt"):
        (tmp_path / names).with_name(other).write_text("")
    (tmp_path / names).unlink()
    with pytest.raises(FileNotFoundError, match="the list of its pictures is missing"):
        present_views(find_project(tmp_path))


def test_folders_of_another_machine_are_found_below_that_of_the_pictures(tmp_path):
    write_meshroom(tmp_path)
    text = (tmp_path / "cameras.sfm").read_text()
    for i, name in enumerate(NAMES):
        text = text.replace(f"/elsewhere/{name}", f"D:\\\\photos\\\\cam{i}\\\\one.png")
        pictures(tmp_path / "images" / f"cam{i}", ["one.png"])
    (tmp_path / "cameras.sfm").write_text(text)
    views = present_views(find_project(tmp_path))
    assert [view.picture.parent.name for view in views] == [f"cam{i}" for i in range(4)]


def test_straightened_pictures_are_not_straightened_again(tmp_path):
    write_colmap(tmp_path)
    (tmp_path / "images").rename(tmp_path / "undistorted_images")
    with pytest.raises(ValueError, match=r"cameras have lens distortion, which the pictures in .* have no more"):
        present_views(find_project(tmp_path))


def test_distorted_models_of_gaussian_splatting_belong_to_its_input(tmp_path):
    write_colmap(tmp_path)
    (tmp_path / "distorted").mkdir()
    (tmp_path / "sparse").rename(tmp_path / "distorted" / "sparse")
    pictures(tmp_path / "input")
    assert {v.picture.parent.name for v in present_views(find_project(tmp_path))} == {"input"}


@pytest.mark.parametrize("times", [2, 4, 8])
def test_smaller_copies_of_a_transforms_json(tmp_path, times):
    names = [f"{i}.png" for i in range(len(CAMERAS))]
    ds.save_transforms(tmp_path / "transforms.json", CAMERAS, [f"images/{name}" for name in names])
    pictures(tmp_path / f"images_{times}", names, (SIZE[0] // times, SIZE[1] // times))
    with pytest.warns(UserWarning, match="focal lengths are scaled"):
        views = of_picture_sizes(tmp_path, present_views(tmp_path / "transforms.json"))
    for view, intrinsics in zip(views, CAMERAS.intrinsics, strict=True):
        assert view.picture.parent.name == f"images_{times}"
        np.testing.assert_allclose(view.intrinsics[:2], intrinsics[:2] / times)


def test_smaller_copies_need_the_size_of_the_pictures(tmp_path):
    ds.save_transforms(tmp_path / "transforms.json", CAMERAS, [f"images/{name}" for name in NAMES])
    data = json.loads((tmp_path / "transforms.json").read_text())
    del data["w"], data["h"]
    (tmp_path / "transforms.json").write_text(json.dumps(data))
    pictures(tmp_path / "images_2", NAMES, (SIZE[0] // 2, SIZE[1] // 2))
    with pytest.raises(FileNotFoundError, match="4 of 4 pictures are missing"):
        present_views(tmp_path / "transforms.json")


@pytest.mark.parametrize("kind", ["llff", "neus"])
def test_pictures_that_are_not_named_must_be_as_many_as_cameras(tmp_path, kind):
    KINDS[kind](tmp_path)
    folder = next(tmp_path.glob("image*"))
    (folder / NAMES[2]).unlink()
    with pytest.raises(ValueError, match=rf"cameras of 4 pictures, but there are 3 in .*{folder.name}"):
        present_views(find_project(tmp_path))


@pytest.mark.parametrize("kind", ["mvsnet", "neus"])
def test_intrinsics_of_pictures_of_another_size(tmp_path, kind):
    KINDS[kind](tmp_path)
    pictures(next(tmp_path.glob("image*")), NAMES, (2 * SIZE[0], 2 * SIZE[1]))
    with pytest.raises(ValueError, match=r"128 x 96 pixels, and its camera looks at \(32.0, 24.0\)"):
        present_views(find_project(tmp_path))


# What is not read


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("model.psx", "", "Metashape project: export its cameras as Agisoft XML"),
        ("a.rcproj", "", "RealityCapture project: export its registration as COLMAP"),
        ("cameras.csv", "#name,x,y,alt,heading,pitch,roll,f\n", "table of RealityCapture"),
        ("images/shot 0.xmp", "<x:xmpmeta xcr:Rotation='1'/>", "of RealityCapture's for one picture"),
        ("sfm_data.bin", "x", "OpenMVG's, binary"),
        ("sfm.abc", "x", "Alembic"),
        ("keyframes/corrected_cameras/1.json", "{}", "of Polycam"),
        ("metadata", '{"poses": []}', "of Record3D"),
    ],
)
def test_cameras_that_are_not_read_are_named_and_not_estimated_anew(tmp_path, name, content, what):
    pictures(tmp_path / "images")
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / name).write_text(content)
    with pytest.raises(
        FileNotFoundError, match=rf"is read\. Found: 4 pictures in images; .*{what}.* cameras .* anew\. "
    ):
        run_views(tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_other_tables_are_no_cameras(tmp_path):
    pictures(tmp_path / "images")
    (tmp_path / "notes.csv").write_text("name,weight\n")
    (tmp_path / "images" / "shot 0.xmp").write_text("<x:xmpmeta/>")
    with pytest.raises(FileNotFoundError, match=r"taken from\. Found: 4 pictures in images\. "):
        find_project(tmp_path)
    found = project_of(tmp_path)
    assert isinstance(found, NoCameras)
    assert found.not_read == ""


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("IMG_1.HEIC", r"1 HEIC pictures, which are not read: pip install 'diff3ds\[heic\]', or save them as JPEG"),
        ("IMG_1.CR2", "1 raw pictures"),
        ("clip.MP4", r"clip.MP4 is a video: ffmpeg -i clip.MP4 -vf fps=2 frames/%04d.jpg"),
    ],
)
def test_pictures_that_are_not_read_are_named(tmp_path, name, what, monkeypatch):
    monkeypatch.setattr("diff3ds.photogrammetry.not_read.HEIC_READ", ())
    monkeypatch.setattr("diff3ds.photogrammetry.picture_files.SUFFIXES", (".png",))
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(FileNotFoundError, match=rf"Found: {what}"):
        find_project(tmp_path)


def test_a_video_says_how_frames_are_taken(tmp_path):
    (tmp_path / "clip.mov").write_bytes(b"x")
    with pytest.raises(ValueError, match=r"clip.mov: a video, .* ffmpeg -i clip.mov"):
        find_project(tmp_path / "clip.mov")


def test_heic_without_the_package_that_reads_it(tmp_path, monkeypatch):
    monkeypatch.setattr("diff3ds.formats.pixels.HEIC_READ", ())
    (tmp_path / "a.HEIC").write_bytes(b"x")
    with pytest.raises(ValueError, match=r"a.HEIC: HEIC pictures are not read: pip install 'diff3ds\[heic\]'"):
        load_image(tmp_path / "a.HEIC")


@needs("pillow_heif")
def test_heic_pictures_are_read(tmp_path):
    import pillow_heif

    image = Image.new("RGB", (64, 48), (250, 10, 10))
    pillow_heif.from_pillow(image).save(tmp_path / "a.heic", quality=100)
    found = load_image(tmp_path / "a.heic")
    assert found.shape == (48, 64, 3)
    np.testing.assert_allclose(found[20, 20], [250 / 255, 10 / 255, 10 / 255], atol=0.03)


@pytest.mark.parametrize(
    ("version", "numbers"),
    [
        ((1, 0, 0), {"pxFocalLength": "FOCAL", "principalPoint": ["32", "24"]}),
        ((1, 2, 0), {"pxFocalLength": ["FOCAL", "FOCAL"], "principalPoint": ["32", "24"]}),
        ((1, 2, 1), {"pxFocalLength": ["FOCAL", "FOCAL"], "principalPoint": ["0", "0"]}),
        ((1, 2, 3), {}),
    ],
)
def test_every_version_of_meshroom_has_the_same_lens(tmp_path, version, numbers):
    """Focal lengths were pixels once, and principal points told from the corner."""
    text = json.dumps({"type": "radial3", "distortionParams": ["-0.1", "0.05", "0"]} | numbers)
    write_meshroom(tmp_path, version, json.loads(text.replace("FOCAL", repr(FOCAL))))
    view = present_views(find_project(tmp_path))[0]
    np.testing.assert_allclose(view.intrinsics, CAMERAS.intrinsics[0], atol=1e-5)
    assert view.distortion.radial == (-0.1, 0.05, 0)
