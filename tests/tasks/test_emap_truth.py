"""Ground truth as NEF's and EMAP's data sets have it, by `diff3ds eval`: ABC's models, DTU's scans, damaged files."""

import json
import math

import pytest
import torch

import diff3ds as ds
from diff3ds.photogrammetry.point_files import save_points
from diff3ds.tasks.evaluate.emap_truth import emap_truth
from diff3ds.tasks.evaluate.evaluate import evaluate
from diff3ds.tasks.evaluate.evaluate_options import JudgeOptions

# A rectangle of 40 x 20 at height 5 of a box from (-10, 0, 0) to (30, 20, 10), and a curve that is not sharp.
VERTICES = [(-10, 0, 5), (30, 0, 5), (30, 20, 5), (-10, 20, 5), (0, 0, 9)]
BOX = [-10, 0, 0, 30, 20, 10, 40, 20, 10]
CURVES = [{"sharp": True, "type": "Line", "vert_indices": [k, (k + 1) % 4]} for k in range(4)]
CURVES.append({"sharp": False, "type": "Circle", "vert_indices": [0, 4]})
# The rectangle in the world of the pictures: the longest side is 1, the box's middle in (.5, .5, .5).
CORNERS = [(0.0, 0.25), (1.0, 0.25), (1.0, 0.75), (0.0, 0.75)]


def run_of(tmp_path, scene, corners):
    """A run that drew the rectangle with these corners."""
    lines = [[corners[k], corners[(k + 1) % 4]] for k in range(4)]
    ds.save(tmp_path / "out" / "a" / "sketch.json", ds.Sketch(torch.tensor(lines), width=0.01))
    record = {"options": {"source": str(scene)}, "target": "edges", "scores": {}}
    (tmp_path / "out" / "a" / "run.json").write_text(json.dumps(record))


def abc(tmp_path, feats=CURVES, stats=BOX, obj=None):
    """The files of ABC beside a scene."""
    scene, truth = tmp_path / "set" / "data" / "00000007", tmp_path / "set" / "groundtruth"
    for folder in (scene, truth / "obj"):
        folder.mkdir(parents=True, exist_ok=True)
    (truth / "chunk_0000_feats.json").write_text(json.dumps({"00000007": feats}))
    (truth / "chunk_0000_stats.json").write_text(json.dumps({"00000007": {"bbox": stats}}))
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in VERTICES) if obj is None else obj
    (truth / "obj" / "00000007_abc_trimesh_000.obj").write_text(f"{text}vn 0 0 1\nf 1 2 3\n")
    return scene


def test_sharp_edges_of_a_model_of_abc(tmp_path):
    """The sketch lies 3 mm above them, where the model is a metre long."""
    run_of(tmp_path, abc(tmp_path), [(x, y, 0.503) for x, y in CORNERS])
    (row,) = evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())
    assert 3 <= row.scores["acc_mm"] <= math.hypot(3, 2.5)
    assert 3 <= row.scores["comp_mm"] <= math.hypot(3, 3.9)
    assert row.scores["F5"] == 1


def dtu(tmp_path, worldtogt=None, points=None):
    """A scan: the rectangle of 300 x 150 mm, where the pictures' world is turned, moved and has 600 mm a unit."""
    scene = tmp_path / "set" / "data" / "scan37"
    truth = tmp_path / "set" / "groundtruth" / "edge_points" / "scan37"
    for folder in (scene, truth):
        folder.mkdir(parents=True, exist_ok=True)
    matrix = [[0, -600, 0, 100], [600, 0, 0, -20], [0, 0, 600, 7], [0, 0, 0, 1]] if worldtogt is None else worldtogt
    (scene / "meta_data.json").write_text(json.dumps({"frames": [], "worldtogt": matrix}))
    if points is None:
        t = torch.linspace(0, 1, 201, dtype=torch.float64)
        corners = torch.tensor([(100.0, -20, 7), (100, 280, 7), (-50, 280, 7), (-50, -20, 7)], dtype=torch.float64)
        points = torch.cat([corners[k] + t[:, None] * (corners[(k + 1) % 4] - corners[k]) for k in range(4)])
    save_points(truth / "edge_points.ply", points)
    return scene


def test_points_of_a_scan_of_dtu_in_its_own_millimetres(tmp_path):
    """The sketch lies 12 mm above them."""
    corners = [(0.0, 0.0, 0.02), (0.5, 0.0, 0.02), (0.5, 0.25, 0.02), (0.0, 0.25, 0.02)]
    run_of(tmp_path, dtu(tmp_path), corners)
    (row,) = evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())
    assert 12 <= row.scores["acc_mm"] <= math.hypot(12, 1)
    assert [row.scores[f"F{mm}"] for mm in (5, 10, 20)] == [0, 0, 1]


def test_what_has_no_truth_is_no_fault(tmp_path):
    (tmp_path / "set" / "data" / "other").mkdir(parents=True)
    assert emap_truth(abc(tmp_path, feats=[{"sharp": False, "vert_indices": [0, 4]}])) is None
    assert emap_truth(tmp_path / "set" / "data" / "other") is None


def test_damaged_files_are_named(tmp_path):
    for given, message in (
        ({"feats": 3}, r"chunk_0000_feats.json: 00000007 is no list of curves"),
        ({"feats": [{"vert_indices": [0, 1]}]}, "no list of curves"),
        ({"feats": [{"sharp": True, "vert_indices": [0, 9]}]}, "no vert_indices of vertices of 00000007_abc"),
        ({"feats": [{"sharp": True, "vert_indices": [2]}]}, "no vert_indices of vertices"),
        ({"feats": [{"sharp": True}]}, "no vert_indices of vertices"),
        ({"stats": [0, 0, 0, 1, 1, 1]}, "the bbox of 00000007 is nine numbers"),
        ({"stats": [0, 0, 0, 0, 0, 0, 0, 0, 0]}, "the bbox of 00000007 is nine numbers"),
        ({"stats": "wide"}, r"chunk_0000_stats.json: no bbox of 00000007"),
        ({"obj": "v 1 2\nv 1 2 3\n"}, r"trimesh_000.obj: damaged, a vertex is not three numbers"),
        ({"obj": "v 1 2 nan\n"}, "a vertex is not finite"),
    ):
        with pytest.raises(ValueError, match=message):
            emap_truth(abc(tmp_path, **given))
    scene = abc(tmp_path)
    truth = tmp_path / "set" / "groundtruth"
    (truth / "obj" / "00000007_again.obj").write_text("")
    with pytest.raises(ValueError, match=r"obj: 2 files 00000007\*.obj"):
        emap_truth(scene)
    (truth / "chunk_0000_stats.json").unlink()
    with pytest.raises(ValueError, match=r"beside it chunk_0000_stats.json is missing"):
        emap_truth(scene)
    (truth / "chunk_0000_feats.json").write_text("[1]")
    with pytest.raises(ValueError, match="not an object of JSON"):
        emap_truth(scene)


def test_damaged_files_of_scans_are_named(tmp_path):
    flat = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]
    sheared = [[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    mirrored = [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    for given, message in (
        ({"worldtogt": 5}, r"meta_data.json: no worldtogt of 4x4 numbers"),
        ({"worldtogt": [[1, 2], [3, 4]]}, "no worldtogt of 4x4 numbers"),
        *(({"worldtogt": matrix}, "does not turn, scale and move alone") for matrix in (flat, sheared, mirrored)),
        ({"points": torch.zeros((0, 3), dtype=torch.float64)}, r"edge_points.ply: no points in it"),
    ):
        with pytest.raises(ValueError, match=message):
            emap_truth(dtu(tmp_path, **given))
    scene = dtu(tmp_path)
    (scene / "meta_data.json").unlink()
    with pytest.raises(ValueError, match=r"in millimetres, and no .*meta_data.json says how the scene lies"):
        emap_truth(scene)
