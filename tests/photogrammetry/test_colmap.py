"""COLMAP's models: read, and points projected as its documentation says, and as its own files say."""

import math
import struct

import numpy as np
import pytest
from needs import needs
from written_projects import (
    MODELS,
    NAMES,
    PLACES,
    POINTS,
    SIZE,
    TURNS,
    colmap_binary,
    colmap_text,
    pictures,
    seen,
    write_colmap,
)

from diff3ds.photogrammetry.find_project import find_project, present_views, sparse_points


def documented(model, p, u, v):
    """The pixel of one direction, worked as the documentation has it."""
    if "FISHEYE" in model:
        r = math.hypot(u, v)
        u, v = (math.atan(r) * c / r if r else c for c in (u, v))
    r2 = u * u + v * v
    one = model in (
        "SIMPLE_PINHOLE",
        "SIMPLE_RADIAL",
        "RADIAL",
        "SIMPLE_RADIAL_FISHEYE",
        "RADIAL_FISHEYE",
        "SIMPLE_FISHEYE",
    )
    fx, fy = (p[0], p[0]) if one else p[:2]
    cx, cy, *k = p[1:] if one else p[2:]
    du = dv = 0.0
    if model in ("SIMPLE_RADIAL", "SIMPLE_RADIAL_FISHEYE"):
        du, dv = u * k[0] * r2, v * k[0] * r2
    if model in ("RADIAL", "RADIAL_FISHEYE"):
        du, dv = (c * (k[0] * r2 + k[1] * r2**2) for c in (u, v))
    if model == "OPENCV_FISHEYE":
        du, dv = (c * sum(k[i] * r2 ** (i + 1) for i in range(4)) for c in (u, v))
    if model in ("OPENCV", "FULL_OPENCV", "THIN_PRISM_FISHEYE"):
        radial = k[0] * r2 + k[1] * r2**2
        if model == "FULL_OPENCV":
            radial = (1 + radial + k[4] * r2**3) / (1 + k[5] * r2 + k[6] * r2**2 + k[7] * r2**3) - 1
        if model == "THIN_PRISM_FISHEYE":
            radial += k[4] * r2**3 + k[5] * r2**4
            du, dv = k[6] * r2, k[7] * r2
        du += u * radial + 2 * k[2] * u * v + k[3] * (r2 + 2 * u * u)
        dv += v * radial + 2 * k[3] * u * v + k[2] * (r2 + 2 * v * v)
    return fx * (u + du) + cx, fy * (v + dv) + cy


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("write", [colmap_text, colmap_binary])
def test_colmap_sees_points_where_its_documentation_says(tmp_path, model, write):
    write(tmp_path / "sparse" / "0", model)
    pictures(tmp_path / "images")
    views = present_views(find_project(tmp_path))
    assert [view.picture.name for view in views] == NAMES
    for view, turn, place in zip(views, TURNS, PLACES, strict=True):
        moved = POINTS @ turn.T + place
        expected = [documented(model, MODELS[model], x / z, y / z) for x, y, z in moved]
        np.testing.assert_allclose(seen(view), expected, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(sparse_points(find_project(tmp_path)), POINTS)


@needs("pycolmap")
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("end", ["txt", "bin"])
def test_models_that_colmap_itself_writes(tmp_path, model, end):
    """Its own projection is the answer."""
    import pycolmap

    camera = pycolmap.Camera(model=model, width=SIZE[1], height=SIZE[0], params=MODELS[model], camera_id=7)
    written = pycolmap.Reconstruction()
    written.add_camera_with_trivial_rig(camera)
    for i, name in enumerate(NAMES):
        image = pycolmap.Image(name=name, camera_id=7, image_id=i + 1)
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(TURNS[i]), PLACES[i])
        written.add_image_with_trivial_frame(image, pose)
    written.add_point3D(POINTS[0], pycolmap.Track(), np.zeros(3, np.uint8))
    (tmp_path / "sparse").mkdir()
    (written.write_text if end == "txt" else written.write_binary)(str(tmp_path / "sparse"))
    pictures(tmp_path)
    for i, view in enumerate(present_views(find_project(tmp_path))):
        expected = camera.img_from_cam(POINTS @ TURNS[i].T + PLACES[i])
        np.testing.assert_allclose(seen(view), expected, rtol=0, atol=1e-6)
    np.testing.assert_allclose(sparse_points(find_project(tmp_path)), POINTS[:1])


def test_the_largest_of_several_models_is_taken(tmp_path):
    colmap_text(tmp_path / "sparse" / "1")
    colmap_text(tmp_path / "sparse" / "0")
    shorter = (tmp_path / "sparse" / "0" / "images.txt").read_text().splitlines()[:4]
    (tmp_path / "sparse" / "0" / "images.txt").write_text("\n".join(shorter))
    with pytest.warns(UserWarning, match=r"2 models of COLMAP, of which the largest is read, sparse.1; .*sparse.0"):
        assert find_project(tmp_path) == tmp_path / "sparse" / "1"
    assert find_project(tmp_path / "sparse" / "0" / "cameras.txt") == tmp_path / "sparse" / "0"


@pytest.mark.parametrize("file", ["cameras.bin", "images.bin", "points3D.bin"])
def test_binary_files_that_end_early_or_count_too_much(tmp_path, file):
    """No count makes the reader take memory or time before the file's size is compared with it."""
    colmap_binary(tmp_path)
    pictures(tmp_path)
    whole = (tmp_path / file).read_bytes()
    read = sparse_points if file.startswith("points") else present_views
    for broken in (whole[:-3], struct.pack("<Q", 1 << 60) + whole[8:], whole[: len(whole) // 2], b"\1"):
        (tmp_path / file).write_bytes(broken)
        with pytest.raises(ValueError, match=f"{file}: damaged"):
            read(tmp_path)


@pytest.mark.parametrize("keep", ["none", "some"])
def test_text_models_of_one_line_a_picture(tmp_path, keep):
    """As converters and editors leave them, which drop empty lines."""
    write_colmap(tmp_path)
    file = tmp_path / "sparse" / "0" / "images.txt"
    lines = [line for line in file.read_text().splitlines() if line and (keep == "some" or "png" in line)]
    assert len(lines) == (7 if keep == "some" else 4)
    file.write_text("\n".join(lines))
    assert [view.picture.name for view in present_views(find_project(tmp_path))] == NAMES


@pytest.mark.parametrize("line", ["1 2 3 4", "1 2 a", "nothing at all"])
def test_a_line_that_is_neither_points_nor_a_picture(tmp_path, line):
    write_colmap(tmp_path)
    file = tmp_path / "sparse" / "0" / "images.txt"
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:3], line, *lines[4:]]))
    with pytest.raises(ValueError, match=r"line 4: expected IMAGE_ID"):
        present_views(find_project(tmp_path))


@needs("pycolmap")
def test_rigs_and_frames_of_colmap(tmp_path):
    """Two cameras of a rig: images hold the places of each, whatever rigs.bin and frames.bin say."""
    import pycolmap

    written, offset = pycolmap.Reconstruction(), pycolmap.Rigid3d(pycolmap.Rotation3d(TURNS[1]), PLACES[1])
    rig = pycolmap.Rig(rig_id=1)
    for number in (1, 2):
        camera = pycolmap.Camera(model="PINHOLE", width=SIZE[1], height=SIZE[0], params=[60, 60, 32, 24])
        camera.camera_id = number
        written.add_camera(camera)
    rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 1))
    rig.add_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 2), offset)
    written.add_rig(rig)
    expected = {}
    for i in range(4):
        frame = pycolmap.Frame(frame_id=i + 1, rig_id=1)
        frame.rig_from_world = pycolmap.Rigid3d(pycolmap.Rotation3d(TURNS[i]), PLACES[i])
        for number in (1, 2):
            frame.add_data_id(pycolmap.data_t(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, number), 2 * i + number))
        written.add_frame(frame)
        for number in (1, 2):
            name = f"cam{number}/{i}.png"
            image = pycolmap.Image(name=name, camera_id=number, image_id=2 * i + number)
            image.frame_id = i + 1
            written.add_image(image)
            expected[name] = (TURNS[i], PLACES[i])
            if number == 2:
                expected[name] = (TURNS[1] @ TURNS[i], TURNS[1] @ PLACES[i] + PLACES[1])
        written.register_frame(i + 1)
    (tmp_path / "sparse").mkdir()
    written.write_binary(str(tmp_path / "sparse"))
    assert (tmp_path / "sparse" / "frames.bin").is_file()
    pictures(tmp_path / "images", list(expected))
    views = present_views(find_project(tmp_path))
    assert len(views) == 8
    for view in views:
        turn, place = expected[view.picture.relative_to(tmp_path / "images").as_posix()]
        np.testing.assert_allclose(view.world_to_camera[:3, :3], turn, atol=1e-9)
        np.testing.assert_allclose(view.world_to_camera[:3, 3], place, atol=1e-9)
