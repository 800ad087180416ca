"""The file between the stages of a reconstruction: round trips, and files that are refused."""

import json

import numpy as np
import pytest
import torch
from edge_scenes import lines_between
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from diff3ds.curves.shapes.curve_set import curves_of
from diff3ds.edges.cameras.coarse_to_fine import Refined
from diff3ds.edges.evidence.bias import Bias
from diff3ds.edges.reconstruct import Result
from diff3ds.edges.resume import CAMERAS, FIELDS, VERSION, Kept, read_result, write_result

SETTINGS = {"target": "edges", "seed": 3, "size": [64, 80]}
CURVES = lines_between(((0, 0, 0), (0.1, 0.2, 1 / 3)), ((1, 0, 0), (0, 1, 0)))
LOSSES = [0.5, 1 / 3]
RESULT = Result(2, CURVES, Bias(0.1, -1 / 3, 0.7))
REFINED = Refined(torch.eye(4).repeat(3, 1, 1), torch.eye(3).repeat(3, 1, 1) / 3, np.array([1.5, 1 / 3, np.nan]), -0.05)
KEPT = Kept(RESULT, LOSSES, REFINED)


@pytest.fixture
def path(tmp_path):
    write_result(tmp_path / "edges.safetensors", KEPT, SETTINGS)
    return tmp_path / "edges.safetensors"


def test_what_is_written_is_read(path):
    kept = read_result(path, SETTINGS)
    back = kept.result
    assert kept.losses == LOSSES
    assert back.stage == 2
    assert back.bias == RESULT.bias
    for name in FIELDS:
        assert torch.equal(getattr(back.curves, name), getattr(CURVES, name))
    for name in CAMERAS:
        np.testing.assert_array_equal(getattr(kept.refined, name), getattr(REFINED, name))
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_vertices_may_have_gaps_between_their_numbers(path):
    """As they have once curves were taken out."""
    lines = [((0, 0, 0), (0.1 * k, 1, 0)) for k in range(1, 9)]
    few = lines_between(*lines)[torch.tensor([3, 7])]
    assert int(few.vertex.max()) >= 2 * len(few)
    write_result(path, Kept(Result(2, few, RESULT.bias), LOSSES), SETTINGS)
    back = read_result(path, SETTINGS).result
    assert torch.equal(back.curves.points, few.points)
    assert torch.equal(*((c.vertex.reshape(-1, 1) == c.vertex.reshape(-1)) for c in (back.curves, few)))


def test_a_disk_that_fills_up_is_said(path, monkeypatch):
    def full(*arguments):
        raise SafetensorError("I/O error: No space left on device (os error 28)")

    monkeypatch.setattr("safetensors.torch.save_file", full)
    with pytest.raises(OSError, match="make room"):
        write_result(path, Kept(Result(1, CURVES, Bias(0.0, 0.0, 0.0)), []), SETTINGS)
    assert read_result(path, SETTINGS).result.stage == 2


def test_no_curves_are_a_result(path):
    write_result(path, Kept(Result(1, curves_of([]), Bias(0.0, 0.0, 0.0)), []), SETTINGS)
    assert len(read_result(path, SETTINGS).result.curves) == 0
    assert read_result(path, SETTINGS).refined is None


@pytest.mark.parametrize(("name", "value"), [("seed", 4), ("target", "color-edges"), ("size", [80, 64])])
def test_another_run_is_refused(path, name, value):
    with pytest.raises(ValueError, match=rf"the run to resume had {name}=.*: give the same, or start a new run"):
        read_result(path, {**SETTINGS, name: value})


def damaged(path, change, metadata=None):
    """The file with other tensors, or with other words about them."""
    tensors = load_file(path)
    change(tensors)
    about = {"version": VERSION, "stage": 2, "bias": vars(RESULT.bias), "settings": SETTINGS}
    save_file(tensors, path, {"diff3ds edges": json.dumps(about)} if metadata is None else metadata)


CHANGES = {
    "a tensor is missing": lambda t: t.pop("vertex"),
    "no losses": lambda t: t.pop("losses"),
    "shapes that do not fit": lambda t: t.update(kind=t["kind"][:1].clone()),
    "a vertex that is not there": lambda t: t["vertex"].fill_(4),
    "a negative vertex": lambda t: t["vertex"].fill_(-1),
    "a point that is not finite": lambda t: t["points"].view(-1)[5:6].fill_(float("nan")),
    "floating point kinds": lambda t: t.update(kind=t["kind"].float()),
    "a kind that is none": lambda t: t["kind"].fill_(7),
    "cameras without lenses": lambda t: t.pop("intrinsics"),
    "fewer cameras than lenses": lambda t: t.update(world_to_camera=t["world_to_camera"][:2].clone()),
    "a camera that is not finite": lambda t: t["world_to_camera"].view(-1)[3:4].fill_(float("inf")),
    "no distortion": lambda t: t.pop("k1"),
    "a distortion of several lenses": lambda t: t.update(k1=t["agreement"].clone()),
    "a distortion that is not finite": lambda t: t["k1"].fill_(float("nan")),
    "points of whole numbers": lambda t: t.update(points=t["points"].long()),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_damaged_tensors_are_refused(path, change, unchecked):
    damaged(path, change)
    with pytest.raises(ValueError, match=r"not a checkpoint of this version .*; delete it to start anew"):
        read_result(path, SETTINGS)


ABOUT = {
    "nothing": {},
    "no JSON": {"diff3ds edges": "{"},
    "a list": {"diff3ds edges": "[]"},
    "another version": {"diff3ds edges": json.dumps({"version": 99})},
    "another bias": {"diff3ds edges": json.dumps({"version": VERSION, "stage": 1, "bias": {"x": 1}, "settings": {}})},
    "settings that are none": {
        "diff3ds edges": json.dumps({"version": VERSION, "stage": 1, "bias": vars(RESULT.bias), "settings": 5})
    },
}


@pytest.mark.parametrize("metadata", ABOUT.values(), ids=ABOUT)
def test_foreign_files_are_refused(path, metadata, unchecked):
    damaged(path, lambda t: None, metadata)
    with pytest.raises(ValueError, match=r"not a checkpoint of this version .*; delete it to start anew"):
        read_result(path, SETTINGS)


@pytest.mark.parametrize("content", [b"", b"no tensors", b"\xff" * 200])
def test_what_is_no_safetensors_file_is_refused(path, content):
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"edges\.safetensors: not a checkpoint"):
        read_result(path, SETTINGS)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        read_result(path, SETTINGS)


def test_a_truncated_file_is_refused(path):
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(ValueError, match="delete it to start anew"):
        read_result(path, SETTINGS)
