"""Projects of every kind, written by hand after each program's documentation, of known cameras and points."""

import json
import math
import struct

import numpy as np
import torch
from PIL import Image

import diff3ds as ds

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


def write_opensfm(folder):
    camera = {"projection_type": "brown", "width": SIZE[1], "height": SIZE[0], "k1": -0.1, "k2": 0.05}
    camera |= {"focal_x": FOCAL / SIZE[1], "focal_y": FOCAL / SIZE[1], "c_x": 0, "c_y": 0, "p1": 0, "p2": 0, "k3": 0}
    shots = {}
    for i, name in enumerate(NAMES):
        w, *axis = quaternion(TURNS[i])
        angle = 2 * math.acos(w)
        turn = [angle / math.sin(angle / 2) * n for n in axis]
        shots[name] = {"camera": "v2 unknown", "rotation": turn, "translation": PLACES[i].tolist()}
    points = {str(i): {"coordinates": point, "color": [0, 0, 0]} for i, point in enumerate(POINTS.tolist())}
    whole = {"cameras": {"v2 unknown": camera}, "shots": shots, "points": points}
    (folder / "reconstruction.json").write_text(json.dumps([whole]))
    pictures(folder / "images")


def write_meshroom(folder, version=(1, 2, 6), lens=None):
    """As AliceVision writes it: all numbers as text, rotations by columns, lengths in millimetres."""
    views, poses = [], []
    for i, name in enumerate([*NAMES, "never.png"]):
        views.append({"viewId": f"{i}", "poseId": f"{i}", "intrinsicId": "7", "path": f"/elsewhere/{name}"})
        if name in NAMES:
            transform = {"rotation": [repr(float(n)) for n in TURNS[i].T.flatten()]}
            transform["center"] = [repr(float(n)) for n in -TURNS[i].T @ PLACES[i]]
            poses.append({"poseId": f"{i}", "pose": {"transform": transform, "locked": "0"}})
    camera = {"intrinsicId": "7", "width": f"{SIZE[1]}", "height": f"{SIZE[0]}", "sensorWidth": "36"}
    camera |= {"focalLength": repr(FOCAL / SIZE[1] * 36), "pixelRatio": "1", "principalPoint": ["0", "0"]}
    camera |= lens or {"type": "pinhole", "distortionType": "radialk3", "distortionParams": ["-0.1", "0.05", "0"]}
    data = {"version": [*map(str, version)], "views": views, "intrinsics": [camera], "poses": poses}
    (folder / "cameras.sfm").write_text(json.dumps(data))
    pictures(folder / "images")


def write_nvm(folder):
    lines = ["NVM_V3", "", f"{len(NAMES)}"]
    for i, name in enumerate(NAMES):
        pose = " ".join(map(repr, map(float, [*quaternion(TURNS[i]), *-TURNS[i].T @ PLACES[i]])))
        lines.append(f"images/{name.replace(' ', chr(34))}\t{FOCAL!r} {pose} 0 0")
    (folder / "scene.nvm").write_text("\n".join([*lines, "", "0", "", "0"]))
    pictures(folder / "images")


def write_gaussians(folder):
    cameras = []
    for i, name in enumerate(NAMES):
        camera = {"id": i, "img_name": name[:-4], "width": SIZE[1], "height": SIZE[0], "fx": FOCAL, "fy": FOCAL}
        cameras.append(camera | {"position": (-TURNS[i].T @ PLACES[i]).tolist(), "rotation": TURNS[i].T.tolist()})
    (folder / "cameras.json").write_text(json.dumps(cameras))
    pictures(folder / "images")


def write_neus(folder):
    """With a world that is moved and half as large in that of the file, where the projections are of any scale."""
    scale = np.diag([2.0, 2.0, 2.0, 1.0])
    scale[:3, 3] = [1, 2, 3]
    matrices = {}
    for i in range(len(NAMES)):
        whole = np.eye(4)
        whole[:3] = CAMERAS.intrinsics[i].numpy() @ np.concatenate([TURNS[i], PLACES[i][:, None]], 1)
        matrices |= {f"world_mat_{i}": (-3 if i else 1) * whole @ np.linalg.inv(scale), f"scale_mat_{i}": scale}
    np.savez(folder / "cameras_sphere.npz", **matrices)
    pictures(folder / "image")


def write_llff(folder):
    rows = []
    for i in range(len(NAMES)):
        right, down, ahead = TURNS[i]
        place = -TURNS[i].T @ PLACES[i]
        rows.append([*np.stack([down, right, -ahead, place, [*SIZE, FOCAL]], 1).flatten(), 0.5, 9.0])
    np.save(folder / "poses_bounds.npy", np.array(rows))
    pictures(folder / "images")


def write_mvsnet(folder):
    (folder / "cams").mkdir()
    for i, name in enumerate(NAMES):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = TURNS[i], PLACES[i]
        extrinsic, intrinsic = (
            "\n".join(" ".join(map(repr, map(float, row))) for row in m) for m in (pose, CAMERAS.intrinsics[i].tolist())
        )
        text = f"extrinsic\n{extrinsic}\n\nintrinsic\n{intrinsic}\n\n425.0 2.5\n"
        (folder / "cams" / f"{name[:-4]}_cam.txt").write_text(text)
    pictures(folder / "images")


def write_colmap(folder):
    colmap_text(folder / "sparse" / "0", "RADIAL", [FOCAL, SIZE[1] / 2, SIZE[0] / 2, -0.1, 0.05])
    pictures(folder / "images")


KINDS = {
    "bundler": write_bundler, "colmap": write_colmap, "gaussians": write_gaussians, "llff": write_llff,
    "meshroom": write_meshroom, "meta_data": write_meta_data, "metashape": write_metashape, "mvsnet": write_mvsnet,
    "neus": write_neus, "nvm": write_nvm, "openmvg": write_openmvg, "opensfm": write_opensfm,
}  # fmt: skip
# Those that hold lens distortion, and points.
WITH_LENS = ("bundler", "colmap", "meshroom", "metashape", "openmvg", "opensfm")
WITH_POINTS = ("bundler", "colmap", "openmvg", "opensfm")
