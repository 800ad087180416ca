"""Projects of every kind: written by hand after each program's documentation, read, and points projected as it says."""

import json
import math
import re
import struct

import numpy as np
import pytest
import torch
from needs import needs
from PIL import Image

import diff3ds as ds
from diff3ds.photogrammetry.picture_files import masks_for, pictures_in
from diff3ds.photogrammetry.project import NoCamerasError, find_project, present_views, sparse_points
from diff3ds.photogrammetry.shot import quaternion_pose
from diff3ds.transforms import read_views, save_views

SIZE = (48, 64)
POINTS = np.array([[0.1, -0.2, 0.3], [-0.4, 0.3, 0.1], [0.0, 0.0, 0.0], [0.3, 0.35, -0.25]])
CAMERAS = ds.orbit([0.0, 80.0, 200.0, 290.0], [10.0, 25.0, -15.0, 40.0], 3.0, fov=40.0, size=SIZE).to(torch.float64)
# Rotation and translation of each, world to camera, OpenCV axes.
U, _, VH = np.linalg.svd(CAMERAS.world_to_camera[:, :3, :3].numpy())
TURNS = U @ VH  # the orbit is float32
PLACES = CAMERAS.world_to_camera[:, :3, 3].numpy()
NAMES = [f"shot {i}.png" for i in range(len(CAMERAS))]


def pictures(folder, names=NAMES, size=SIZE):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (size[1], size[0]), "white").save(folder / name)
    return folder


def seen(view, points=POINTS):
    """Pixels of points in a view as taken, with the lens: our own formulas."""
    placed = torch.from_numpy(points) @ view.world_to_camera[:3, :3].mT + view.world_to_camera[:3, 3]
    x, y = view.distortion.bent(placed[:, 0] / placed[:, 2], placed[:, 1] / placed[:, 2])
    return (torch.stack([x, y, torch.ones_like(x)], 1) @ view.intrinsics.mT)[:, :2].numpy()


def quaternion(turn):
    """(w, x, y, z) of a rotation, by the axis that it leaves alone."""
    angle = math.acos(max(-1.0, min(1.0, (np.trace(turn) - 1) / 2)))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (2 * math.sin(angle))
    return [math.cos(angle / 2), *(math.sin(angle / 2) * axis)]


# COLMAP

# Parameters, and what COLMAP's documentation makes of the direction (u, v, 1), in pixels.
MODELS = {
    "SIMPLE_PINHOLE": [60, 31, 25],
    "PINHOLE": [60, 62, 31, 25],
    "SIMPLE_RADIAL": [60, 31, 25, -0.1],
    "RADIAL": [60, 31, 25, -0.1, 0.05],
    "OPENCV": [60, 62, 31, 25, -0.1, 0.05, 0.01, -0.02],
    "FULL_OPENCV": [60, 62, 31, 25, -0.1, 0.05, 0.01, -0.02, 0.03, 0.2, -0.1, 0.05],
    "SIMPLE_RADIAL_FISHEYE": [60, 31, 25, -0.1],
    "RADIAL_FISHEYE": [60, 31, 25, -0.1, 0.05],
    "OPENCV_FISHEYE": [60, 62, 31, 25, -0.1, 0.05, 0.02, -0.01],
    "THIN_PRISM_FISHEYE": [60, 62, 31, 25, -0.1, 0.05, 0.01, -0.02, 0.03, -0.01, 0.02, 0.015],
    "SIMPLE_FISHEYE": [60, 31, 25],
    "FISHEYE": [60, 62, 31, 25],
}
NUMBERS = {
    "SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4, "OPENCV_FISHEYE": 5,
    "FULL_OPENCV": 6, "SIMPLE_RADIAL_FISHEYE": 8, "RADIAL_FISHEYE": 9, "THIN_PRISM_FISHEYE": 10, "SIMPLE_FISHEYE": 14,
    "FISHEYE": 15,
}  # fmt: skip


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


def colmap_text(folder, model="OPENCV", parameters=None):
    folder.mkdir(parents=True, exist_ok=True)
    given = " ".join(map(repr, MODELS[model] if parameters is None else parameters))
    (folder / "cameras.txt").write_text(f"# Camera list\n7 {model} {SIZE[1]} {SIZE[0]} {given}\n")
    lines = ["# Image list", ""]
    for i, name in enumerate(NAMES):
        pose = " ".join(map(repr, map(float, [*quaternion(TURNS[i]), *PLACES[i]])))
        lines += [f"{i + 1} {pose} 7 {name}", "10.5 3.25 -1 4 4 1" if i % 2 else ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    points = [f"{i} {x} {y} {z} 1 2 3 0.5 1 0" for i, (x, y, z) in enumerate(POINTS.tolist())]
    (folder / "points3D.txt").write_text("\n".join(points))


def colmap_binary(folder, model="OPENCV"):
    folder.mkdir(parents=True, exist_ok=True)
    given = [float(n) for n in MODELS[model]]
    camera = struct.pack("<QiiQQ", 1, 7, NUMBERS[model], SIZE[1], SIZE[0]) + struct.pack(f"<{len(given)}d", *given)
    (folder / "cameras.bin").write_bytes(camera)
    images = struct.pack("<Q", len(NAMES))
    for i, name in enumerate(NAMES):
        images += struct.pack("<i7di", i + 1, *quaternion(TURNS[i]), *PLACES[i], 7) + name.encode() + b"\0"
        images += struct.pack("<Q", i) + i * struct.pack("<ddq", 1.5, 2.5, -1)
    (folder / "images.bin").write_bytes(images)
    points = struct.pack("<Q", len(POINTS))
    for i, place in enumerate(POINTS.tolist()):
        points += struct.pack("<QdddBBBdQ", i, *place, 1, 2, 3, 0.5, i) + i * struct.pack("<ii", 1, 2)
    (folder / "points3D.bin").write_bytes(points)


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
    assert find_project(tmp_path) == tmp_path / "sparse" / "1"
    assert find_project(tmp_path / "sparse" / "0" / "cameras.txt") == tmp_path / "sparse" / "0"


# The others: each writes the cameras of CAMERAS, without distortion or with the one named


FOCAL = float(CAMERAS.intrinsics[0, 0, 0])


def gl_pose(i):
    """World to camera with y up, looking along -z."""
    flip = np.diag([1.0, -1.0, -1.0])
    return flip @ TURNS[i], flip @ PLACES[i]


def write_bundler(folder):
    lines = ["# Bundle file v0.3", f"{len(NAMES) + 1} {len(POINTS)}"]
    for i in range(len(NAMES)):
        turn, place = gl_pose(i)
        lines += [f"{FOCAL!r} -0.1 0.05", *(" ".join(map(repr, map(float, row))) for row in (*turn, place))]
    lines += ["0 0 0"] * 5
    for x, y, z in POINTS.tolist():
        lines += [f"{x} {y} {z}", "255 0 0", "2 0 5 1.5 -2.5 1 6 3.5 4.5"]
    (folder / "bundle.out").write_text("\n".join(lines))
    (folder / "list.txt").write_text("\n".join(f"images/{name} 0 {FOCAL}" for name in [*NAMES, "never.png"]))
    pictures(folder / "images")


def write_openmvg(folder):
    view = {"local_path": "", "width": SIZE[1], "height": SIZE[0], "id_intrinsic": 3}
    lens = {"width": SIZE[1], "height": SIZE[0], "focal_length": FOCAL, "principal_point": [SIZE[1] / 2, SIZE[0] / 2]}
    views = [
        {"key": i, "value": {"ptr_wrapper": {"id": 9, "data": {**view, "filename": name, "id_view": i, "id_pose": i}}}}
        for i, name in enumerate([*NAMES, "never.png"])
    ]
    poses = [
        {"key": i, "value": {"rotation": TURNS[i].tolist(), "center": CAMERAS.centers[i].tolist()}}
        for i in range(len(NAMES))
    ]
    intrinsics = [
        {"key": 3, "value": {"polymorphic_id": 1, "ptr_wrapper": {"data": {**lens, "disto_k3": [-0.1, 0.05, 0]}}}}
    ]
    structure = [{"key": i, "value": {"X": point, "observations": []}} for i, point in enumerate(POINTS.tolist())]
    data = {"views": views, "intrinsics": intrinsics, "extrinsics": poses, "structure": structure}
    (folder / "sfm_data.json").write_text(json.dumps({"sfm_data_version": "0.3", "root_path": "/elsewhere", **data}))
    pictures(folder / "images")


def write_metashape(folder):
    """In a component twice as large, turned by 90 degrees and moved; labels without suffixes."""
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    cameras = []
    for i, name in enumerate(NAMES):
        center = CAMERAS.centers[i].numpy()
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn.T @ TURNS[i].T, turn.T @ (center - [1, 2, 3]) / 2
        numbers = " ".join(map(repr, map(float, pose.flatten())))
        cameras.append(
            f'<camera id="{i}" sensor_id="0" component_id="0" label="{name[:-4]}">'
            f"<transform>{numbers}</transform></camera>"
        )
    resolution = f'<resolution width="{SIZE[1]}" height="{SIZE[0]}"/>'
    numbers = f"<f>{FOCAL!r}</f><k1>-0.1</k1><k2>0.05</k2>"
    calibration = f'<calibration type="frame" class="adjusted">{resolution}{numbers}</calibration>'
    turned = f"<rotation>{' '.join(map(str, turn.flatten()))}</rotation>"
    place = f"<transform>{turned}<translation>1 2 3</translation><scale>2</scale></transform>"
    (folder / "cameras.xml").write_text(
        f'<?xml version="1.0"?><document version="2.0.0"><chunk label="a"><sensors>'
        f'<sensor id="0" type="frame">{resolution}'
        f'{calibration}</sensor></sensors><components><component id="0">{place}</component></components>'
        f'<cameras>{"".join(cameras)}<camera id="9" sensor_id="0" label="never"/></cameras></chunk></document>'
    )
    pictures(folder / "images")


def write_meta_data(folder):
    frames = []
    for i, name in enumerate(NAMES):
        pose = torch.linalg.inv(CAMERAS.world_to_camera[i])
        k = torch.eye(4)
        k[:3, :3] = CAMERAS.intrinsics[i]
        frames.append({"rgb_path": name, "camtoworld": pose.tolist(), "intrinsics": k.double().tolist()})
    data = {"camera_model": "OPENCV", "height": SIZE[0], "width": SIZE[1], "frames": frames, "scene_box": {"near": 0.5}}
    (folder / "meta_data.json").write_text(json.dumps(data))
    pictures(folder / "color")
    pictures(folder / "edge_DexiNed")


def write_colmap(folder):
    colmap_text(folder / "sparse" / "0", "RADIAL", [FOCAL, SIZE[1] / 2, SIZE[0] / 2, -0.1, 0.05])
    pictures(folder / "images")


KINDS = {
    "bundler": write_bundler, "colmap": write_colmap, "meta_data": write_meta_data, "metashape": write_metashape,
    "openmvg": write_openmvg,
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_the_same_cameras(tmp_path, kind):
    KINDS[kind](tmp_path)
    views = present_views(find_project(tmp_path))
    assert [view.picture.name for view in views] == NAMES
    for i, view in enumerate(views):
        np.testing.assert_allclose(view.world_to_camera, CAMERAS.world_to_camera[i], atol=2e-6)
        np.testing.assert_allclose(view.intrinsics, CAMERAS.intrinsics[i], atol=1e-5)
        assert view.size == SIZE
        assert view.distortion.radial[:2] == (() if kind == "meta_data" else (-0.1, 0.05))
    found = sparse_points(find_project(tmp_path))
    assert found.tolist() == ([] if kind in ("meta_data", "metashape") else POINTS.tolist())


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
    """With .png behind the whole name, as COLMAP has them, or in place of the suffix."""
    write_colmap(tmp_path)
    pictures(tmp_path / "masks", [f"{NAMES[0]}.png", *NAMES[1:3]])
    with pytest.warns(UserWarning, match="masks: 1 of 4 pictures have no mask there"):
        views = present_views(find_project(tmp_path))
    assert [view.mask and view.mask.name for view in views] == [f"{NAMES[0]}.png", *NAMES[1:3], None]


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


def test_a_folder_without_cameras_says_what_it_holds(tmp_path):
    (tmp_path / "model.psx").touch()
    with pytest.raises(
        NoCamerasError, match=r"Found: model\.psx is a Metashape project: export .*What would do: a trans"
    ):
        find_project(tmp_path)
    pictures(tmp_path / "images")
    with pytest.raises(
        NoCamerasError, match=r'Found: 4 pictures in images; model.psx .*"diff3ds cameras .*" finds'
    ) as e:
        find_project(tmp_path)
    assert [file.name for file in e.value.pictures] == NAMES
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(ValueError, match="not a file with cameras"):
        present_views(tmp_path / "a.txt")


def test_a_rotation_of_nothing_is_none():
    with pytest.raises(ValueError, match="no rotation and translation"):
        quaternion_pose("here", [0.0] * 4, [0.0] * 3)
