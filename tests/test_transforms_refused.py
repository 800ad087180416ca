"""transforms.json: files, pictures and cameras that are refused, and what the errors say."""

import json
import math
import struct
import zlib

import pytest
import torch
from PIL import Image
from test_transforms import GOOD, IDENTITY, _frame, _write

import diff3ds as ds

SHEARED = [[1.0, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
MIRRORED = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
STRETCHED = [[1.0, 0, 0, 0], [0, 1.02, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
TRANSPOSED = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [4, 5, 6, 1]]
ZERO = [[0.0, 0, 0, 1], [0, 0, 0, 2], [0, 0, 0, 3], [0, 0, 0, 1]]
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
    ({**GOOD, "frames": [_frame(transform_matrix=SHEARED)]}, "frame 0: .* not a rotation .* not at right angles"),
    ({**GOOD, "frames": [_frame(), _frame(transform_matrix=MIRRORED)]}, "frame 1: .* not a rotation .* is mirrored"),
    ({**GOOD, "frames": [_frame(transform_matrix=STRETCHED)]}, "frame 0: .* not a rotation .* different lengths"),
    ({**GOOD, "frames": [_frame(transform_matrix=TRANSPOSED)]}, "frame 0: .* holds the translation: transpose it"),
    ({**GOOD, "frames": [_frame(transform_matrix=ZERO)]}, "frame 0: .* its axes have no directions"),
    ({"w": 4, "h": 4, "frames": [_frame()]}, "frame 0 has neither fl_x nor camera_angle_x"),
    ({**GOOD, "fl_x": "wide", "frames": [_frame()]}, "fl_x must be a finite number, got 'wide'"),
    ({**GOOD, "fl_x": True, "frames": [_frame()]}, "fl_x must be a finite number, got True"),
    ({**GOOD, "fl_x": -1.0, "frames": [_frame()]}, "focal lengths must be positive"),
    ({"w": 4, "h": 4, "camera_angle_x": 0.0, "frames": [_frame()]}, r"camera_angle_x must lie in \(0, pi\), got 0.0"),
    ({**GOOD, "cx": math.nan, "frames": [_frame()]}, "cx must be a finite number, got nan"),
    ({**GOOD, "k1": 0.1, "frames": [_frame()]}, "a.png has lens distortion; undistort"),
    ({**GOOD, "k1": "a", "frames": [_frame()]}, "k1 must be a finite number, got 'a'"),
    ({**GOOD, "k5": 0.1, "frames": [_frame()]}, "frame 0: lens distortion k5 is not supported; undistort"),
    ({**GOOD, "sx1": 0.1, "frames": [_frame()]}, "frame 0: lens distortion sx1 is not supported; undistort"),
    ({**GOOD, "frames": [_frame(latlong=True)]}, "frame 0: pictures that are latlong are not supported; undist"),
    ({**GOOD, "camera_model": "FISHEYE624", "frames": [_frame()]}, "camera_model 'FISHEYE624' is not one of"),
    ({**GOOD, "frames": [_frame(camera_model="EQUIRECTANGULAR")]}, "camera_model 'EQUIRECTANGULAR' is not .*; undist"),
    ({**GOOD, "frames": [_frame(camera_model=3)]}, "camera_model 3 is not one of"),
    ({**GOOD, "frames": [_frame(orthographic="yes")]}, "frame 0: orthographic must be true or false, got 'yes'"),
    (
        {**GOOD, "orthographic": False, "camera_model": "ORTHOPHOTO", "frames": [_frame()]},
        "frame 0: camera_model 'ORTHOPHOTO' contradicts orthographic false",
    ),
    (
        {**GOOD, "orthographic": True, "camera_model": "OPENCV", "frames": [_frame()]},
        "frame 0: camera_model 'OPENCV' contradicts orthographic true",
    ),
    (
        {"w": 4, "h": 4, "camera_angle_x": 1.0, "orthographic": True, "frames": [_frame()]},
        "frame 0 is orthographic, and has no fl_x, the pixels that a world unit takes",
    ),
    (
        {**GOOD, "k2": 0.1, "orthographic": True, "frames": [_frame()]},
        "distortion of orthographic pictures is not supp",
    ),
    (
        {**GOOD, "frames": [_frame(), _frame("b.png", orthographic=True)]},
        "all views must be orthographic, or all have perspective; .*b.png is orthographic and .*a.png is not",
    ),
    ({**GOOD, "frames": [_frame(mask_path=3)]}, "frame 0: mask_path must be a file name, got 3"),
    ({"w": 4, "h": 4, "camera_angle_y": 4, "frames": [_frame()]}, r"camera_angle_y must lie in \(0, pi\), got 4"),
    ({**GOOD, "frames": [_frame(p1=-0.1)]}, "has lens distortion"),
    ({**GOOD, "frames": [_frame(), _frame(w=5)]}, r"all views must have one size, got \[\(4, 4\), \(4, 5\)\]"),
    ({**GOOD, "w": "four", "frames": [_frame()]}, "w must be a finite number, got 'four'"),
    ({**GOOD, "fl_x": math.inf, "frames": [_frame()]}, "fl_x must be a finite number, got inf"),
    ({**GOOD, "fl_x": "nan", "frames": [_frame()]}, "fl_x must be a finite number, got 'nan'"),
    ({**GOOD, "ftheta_p0": 0.5, "frames": [_frame()]}, "frame 0: lens distortion ftheta_p0 is not supported"),
    ({"w": 4, "h": 4, "x_fov": 180, "frames": [_frame()]}, r"x_fov must lie in \(0, 180\), got 180"),
    ({"w": 4, "h": 4, "fl_x": None, "frames": [_frame()]}, "frame 0 has neither fl_x nor camera_angle_x"),
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
    with pytest.raises(FileNotFoundError, match=r"1 of 1 pictures are missing: .*gone\.png\. Paths are relative"):
        ds.load_transforms(path)
    Image.new("L", (8, 8)).save(tmp_path / "here.png")
    frames = [_frame("here"), *(_frame(f"{i}.jpg") for i in range(8))]
    path = _write(tmp_path, camera_angle_x=1.0, frames=frames)
    with pytest.raises(FileNotFoundError, match=r"8 of 9 pictures are missing: .*0\.jpg, .*4\.jpg, \.\.\.\."):
        ds.load_transforms(path)


def test_pictures_that_are_none_are_named(tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    path = _write(tmp_path, camera_angle_x=1.0, frames=[_frame("text")])
    with pytest.raises(ValueError, match=r"text\.png: cannot be read as a picture"):
        ds.load_transforms(path)
    header = struct.pack(">II5B", 20000, 20000, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", len(header)) + b"IHDR" + header + struct.pack(">I", zlib.crc32(b"IHDR" + header))
    (tmp_path / "text.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunk)
    with pytest.raises(ValueError, match=r"text\.png: cannot be read as a picture"):
        ds.load_transforms(path)


def test_nothing_is_written_on_errors(tmp_path):
    with pytest.raises(ValueError, match="expected 2 pictures, one a view, got 1"):
        ds.save_transforms(tmp_path / "t.json", ds.orbit([0.0, 90.0], 0.0, 3.0), ["a.png"])
    skewed = ds.orbit([0.0, 90.0], 0.0, 3.0)
    skewed.intrinsics[1, 0, 1] = 0.5
    with pytest.raises(ValueError, match=r"a transforms\.json holds no skew, and view 1 has 0\.5"):
        ds.save_transforms(tmp_path / "t.json", skewed, ["a.png", "b.png"])
    assert list(tmp_path.iterdir()) == []
