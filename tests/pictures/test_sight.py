"""Cameras that look at nothing in common are refused before their pictures are read."""

import json
import math

import pytest
import torch

import diff3ds as ds
from diff3ds.pictures.dataset import load_posed

FLIP = torch.diag(torch.tensor([1.0, -1, -1, 1]).double())
AROUND = ds.orbit([30.0 * i for i in range(12)], [10.0, 35.0, 60.0] * 4, 3.0, size=32)
SHIFT = torch.tensor([5e5, 4.6e6, 100.0], dtype=torch.float64)


PICTURE = "cannot be read as a picture"


def to_world(cameras):
    """What a transforms.json holds of them."""
    return torch.linalg.inv(cameras.world_to_camera.double()) @ FLIP


def transposed(matrices):
    turned = matrices.clone()
    turned[:, :3, :3] = matrices[:, :3, :3].mT
    return turned


def written(folder, matrices, fov=40.0, **values):
    """Of pictures that are no pictures: to read them would be another error."""
    frames = []
    for i, matrix in enumerate(matrices.tolist()):
        (folder / f"{i}.png").write_text("no picture")
        frames.append({"file_path": f"{i}.png", "transform_matrix": matrix})
    path = folder / "transforms.json"
    path.write_text(json.dumps({"x_fov": fov, "w": 32, "h": 32, **values, "frames": frames}))
    return path


MISTAKES = [
    ("rotations are transposed", lambda m: transposed(m)),
    ("matrices are world-to-camera, with OpenCV's axes", lambda m: torch.linalg.inv(m @ FLIP)),
    ("matrices are world-to-camera;", lambda m: torch.linalg.inv(m)),
    ("camera axes are OpenCV's", lambda m: m @ FLIP),
    ("rotations are transposed and the axes OpenCV's", lambda m: transposed(m @ FLIP)),
]


@pytest.mark.parametrize(("message", "mistake"), MISTAKES)
@pytest.mark.parametrize("fov", [10.0, 40.0, 80.0])
@pytest.mark.parametrize("target", [(0.0, 0.0, 0.0), (1.0, -2.0, 0.5)])
def test_the_mistake_is_named(tmp_path, message, mistake, fov, target):
    cameras = ds.orbit([30.0 * i for i in range(12)], [10.0, 35.0, 60.0] * 4, 3.0, target=target)
    told = rf"do not look at one thing.* 100% show one point there if the {message}"
    # World-to-camera matrices of cameras at one distance from the origin all hold the same translation.
    with pytest.raises(ValueError, match=f"{told}|all cameras stand at one place" if "world" in message else told):
        load_posed(written(tmp_path, mistake(to_world(cameras)), fov))


def flat_file(folder, matrices):
    return written(folder, matrices, fl_x=10.0, orthographic=True)


@pytest.mark.parametrize(("message", "mistake"), MISTAKES)
def test_the_mistake_is_named_of_orthographic_pictures(tmp_path, message, mistake):
    cameras = ds.orbit([30.0 * i for i in range(12)], [10.0, 35.0, 60.0] * 4, 3.0, target=(1.0, -2.0, 0.5))
    with pytest.raises(ValueError, match=f"do not look at one thing.* 100% show one point there if the {message}"):
        load_posed(flat_file(tmp_path, mistake(to_world(cameras))))


@pytest.mark.parametrize("away", [0.5, 3.0, 1e4])
def test_orthographic_cameras_see_what_lies_in_front(tmp_path, away):
    cameras = ds.orbit([30.0 * i for i in range(12)], [10.0, 35.0, 60.0] * 4, away)
    with pytest.raises(ValueError, match=PICTURE):
        load_posed(flat_file(tmp_path, to_world(cameras)))


GOOD = {
    "around": AROUND,
    "two": AROUND[:2],
    "one": AROUND[:1],
    "far": ds.orbit([0.0, 20.0, 40.0, 60.0], 10.0, 1000.0),
    "in a row, all looking the same way": ds.look_at(
        torch.tensor([[0.1 * i, -3.0, 0.0] for i in range(9)]), torch.tensor([[0.1 * i, 0.0, 0.0] for i in range(9)])
    ),
    "turntable": ds.orbit([10.0 * i for i in range(36)], 5.0, 2.0),
    "along a wall": ds.look_at(
        torch.tensor([[1.0 * i, -3.0, 0.0] for i in range(20)]), torch.tensor([[1.0 * i, 0.0, 0.0] for i in range(20)])
    ),
    "lying": ds.look_at(AROUND.centers[:, [2, 0, 1]], up=(1.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", GOOD)
@pytest.mark.parametrize(
    "scale", [pytest.param(1e-6, marks=pytest.mark.slow), 1.0, pytest.param(1e6, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("shift", [0.0, 1.0])
def test_good_cameras_go_on_to_the_pictures(tmp_path, name, scale, shift):
    matrices = to_world(GOOD[name])
    matrices[:, :3, 3] = scale * matrices[:, :3, 3] + shift * max(scale, 1.0) * SHIFT
    if scale < 1 and shift:
        return  # In these coordinates float64 has a thousandth of the distances left.
    fov = 1.0 if name == "far" else 60.0
    with pytest.raises(ValueError, match=PICTURE):
        load_posed(written(tmp_path, matrices, fov))


def test_off_centre_lenses(tmp_path):
    """A crop whose principal point is far outside: what it shows counts, not its axis."""
    angle = math.atan2(316.0, 900.0)
    turn = torch.eye(4, dtype=torch.float64)
    turn[0, 0], turn[0, 2] = math.cos(angle), math.sin(angle)
    turn[2, 0], turn[2, 2] = -math.sin(angle), math.cos(angle)
    matrices = to_world(ds.orbit([0.0, 90.0, 180.0], 0.0, 3.0)) @ FLIP @ turn.T @ FLIP
    with pytest.raises(ValueError, match=PICTURE):
        load_posed(written(tmp_path, matrices, cx=-300.0, fl_x=900.0))
    with pytest.raises(ValueError, match="no two cameras look at the same place"):
        load_posed(written(tmp_path, to_world(ds.orbit([0.0, 90.0, 180.0], 0.0, 3.0)), cx=-300.0, fl_x=900.0))


def test_views_from_one_place(tmp_path):
    turning = ds.orbit([0.0, 20.0, 40.0], 0.0, 2.0).world_to_camera.double()
    turning[:, :3, 3] = 0
    with pytest.raises(ValueError, match=r"all cameras stand at one place.*Are the matrices world-to-camera"):
        load_posed(written(tmp_path, torch.linalg.inv(turning) @ FLIP))


def test_views_of_different_places(tmp_path):
    poses = to_world(ds.orbit([0.0, 120.0, 240.0], 0.0, 3.0))
    poses[:, 2, 3] += torch.tensor([0.0, 50.0, -50.0])
    with pytest.raises(ValueError, match="no two cameras look at the same place"):
        load_posed(written(tmp_path, poses, 10.0))


def test_a_room_seen_from_inside(tmp_path):
    """Level cameras that look outwards: their rotations, transposed, would all be one, and see one far point."""
    rooms = torch.linalg.inv(ds.orbit([10.0 * i for i in range(36)], 0.0, 1.0).world_to_camera.double())
    rooms[:, :3, 3] *= torch.linspace(-0.5, 0.5, 36)[:, None]
    with pytest.raises(ValueError, match=PICTURE):
        load_posed(written(tmp_path, rooms @ FLIP, 60.0))
