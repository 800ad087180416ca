"""Points of a reconstruction: PLY files of several kinds, and the ball that they put around an object."""

import json
import math

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.photogrammetry.find_project import sparse_points
from diff3ds.photogrammetry.point_files import load_points, save_points
from diff3ds.pictures.frame import Frame, bound_by_points
from diff3ds.pictures.store import store_of

POINTS = torch.tensor([[1.5, -2.0, 3.25], [0.1, 0.2, 0.3], [1e6, -1e-3, 7.0]], dtype=torch.float64)
NERFSTUDIO = "ply\nformat ascii 1.0\ncomment by nerfstudio\nelement vertex 3\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
RGB = "property uint8 red\nproperty uint8 green\nproperty uint8 blue\nend_header\n"


def test_points_come_back(tmp_path):
    save_points(tmp_path / "p.ply", POINTS)
    assert torch.equal(load_points(tmp_path / "p.ply"), POINTS)
    save_points(tmp_path / "none.ply", POINTS[:0])
    assert load_points(tmp_path / "none.ply").shape == (0, 3)


@pytest.mark.parametrize("order", ["<", ">"])
def test_other_programs_files_are_read(tmp_path, order):
    rows = "".join(f"{x} {y} {z} 1 2 3\n" for x, y, z in POINTS.tolist())
    (tmp_path / "a.ply").write_text(NERFSTUDIO + XYZ + RGB + rows)
    assert torch.equal(load_points(tmp_path / "a.ply"), POINTS)
    # A colour first, a point that is none, and faces behind.
    table = np.zeros(4, [("c", "u1"), ("x", f"{order}f4"), ("y", f"{order}f4"), ("z", f"{order}f4")])
    for k, axis in enumerate("xyz"):
        table[axis][:3] = POINTS[:, k]
    table["y"][3] = math.nan
    name = "binary_little_endian" if order == "<" else "binary_big_endian"
    header = f"ply\nformat {name} 1.0\nelement vertex 4\nproperty uchar c\n{XYZ}element face 1\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    (tmp_path / "b.ply").write_bytes(header.encode() + table.tobytes() + b"\x03" + bytes(12))
    torch.testing.assert_close(load_points(tmp_path / "b.ply"), POINTS.float().double(), rtol=0, atol=0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("no", "no header of PLY"),
        ("ply\nformat ascii 1.0\nelement vertex 3\n", "no header of PLY"),
        ("ply\nformat text 1.0\nelement vertex 1\nend_header\n", "not understood: 'format text"),
        ("ply\nformat ascii 1.0\nelement face 1\nend_header\n", "face|vertices must have"),
        ("ply\nformat ascii 1.0\nelement vertex\nend_header\n", "element"),
        (NERFSTUDIO + "property float x\nend_header\n" + "1\n" * 3, "must have x, y and z"),
        (NERFSTUDIO + XYZ + RGB + "1 2 3 1 1 1\n", "cut off or broken: its 3 of vertex are not there"),
        (NERFSTUDIO.replace("ascii", "binary_little_endian") + XYZ + RGB, "cut off or broken: its 3 of vertex"),
        (NERFSTUDIO + XYZ + RGB + "1 2 x 1 1 1\n" * 3, "'x' is no number"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused(tmp_path, content, message):
    (tmp_path / "p.ply").write_text(content)
    with pytest.raises(ValueError, match=message):
        load_points(tmp_path / "p.ply")


def test_a_transforms_json_names_its_points(tmp_path):
    path = tmp_path / "transforms.json"
    ds.save_transforms(path, ds.orbit([0.0, 90.0, 180.0]), ["a", "b", "c"])
    assert len(sparse_points(path)) == 0
    path.write_text(json.dumps({**json.loads(path.read_text()), "ply_file_path": "some/p.ply"}))
    assert len(sparse_points(path)) == 0
    (tmp_path / "some").mkdir()
    save_points(tmp_path / "some" / "p.ply", POINTS)
    assert torch.equal(sparse_points(path), POINTS)


def test_a_ball_around_what_most_cameras_look_at(generator):
    """An object of radius .3 off the middle, walls all around; cameras look at it from all sides."""
    object_, walls = (torch.nn.functional.normalize(torch.randn(400, 3, generator=generator), dim=1) for _ in range(2))
    center = torch.tensor([0.1, 0.0, 0.05])
    points = torch.cat([center + 0.3 * object_, 4 * walls]).double()
    cameras = ds.orbit([30.0 * i for i in range(12)], 20.0, 2.0, fov=50.0, size=64)
    frame = Frame(torch.zeros(3, dtype=torch.float64), 0.9)
    everywhere = store_of(torch.ones(12, 64, 64, 4))
    found = bound_by_points(frame, cameras, everywhere, points)
    torch.testing.assert_close(found.center.float(), center, rtol=0, atol=0.05)
    assert 0.28 < found.radius < 0.4
    # An object before nothing is where the pictures say; a smaller frame, and a few points, leave it as it is.
    alone = torch.zeros(12, 64, 64, 4)
    alone[:, 20:40, 20:40] = 1
    assert bound_by_points(frame, cameras, store_of(alone), points) is frame
    small = Frame(frame.center, 0.2)
    assert bound_by_points(small, cameras, everywhere, points) is small
    assert bound_by_points(frame, cameras, everywhere, points[:20]) is frame
