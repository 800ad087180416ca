"""OBJ: lines within their tolerance of the exact curves, colours, names, closed strokes."""

import numpy as np
import pytest
import torch

import diff3ds as ds


def read(path):
    """Vertices (V, 6) with colours, and the numbers of the lines by object."""
    vertices, lines, name = [], {}, None
    for row in path.read_text().splitlines():
        kind, *rest = row.split()
        if kind == "v":
            vertices.append([float(x) for x in rest])
        elif kind == "o":
            name = rest[0]
        elif kind == "l":
            lines[name] = [int(x) for x in rest]
    return np.array(vertices), lines


def test_lines_run_along_the_strokes(tmp_path):
    points, weights = ds.bezier.circle((1.0, 2.0, 3.0), 5.0, (1.0, 1.0, 0.0))
    ring = ds.Sketch(points, weights, color=(1.0, 0.5, 0.25), chains=ds.Chains.of([len(points)], True))
    line = ds.Sketch(torch.tensor([[[0.0, 0, 0], [1, 2, 3]]]).double())
    ds.save(tmp_path / "a.obj", ds.Sketch.concatenate([ring, line]))
    vertices, lines = read(tmp_path / "a.obj")
    assert list(lines) == ["stroke_0", "stroke_1"]
    assert lines["stroke_0"][0] == lines["stroke_0"][-1] == 1
    around = vertices[np.array(lines["stroke_0"]) - 1]
    np.testing.assert_allclose(around[:, 3:], [[1.0, 0.5, 0.25]] * len(around))
    # The ball around all control points has a radius below 10: lines are within .001 of the circle.
    middles = (around[1:, :3] + around[:-1, :3]) / 2
    np.testing.assert_allclose(np.linalg.norm(around[:, :3] - [1, 2, 3], axis=1), 5, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(middles - [1, 2, 3], axis=1), 5, atol=1e-3)
    assert vertices[np.array(lines["stroke_1"]) - 1].tolist() == [[0, 0, 0, 0, 0, 0], [1, 2, 3, 0, 0, 0]]


def test_trimesh_reads_the_vertices(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    line = torch.tensor([[[0.0, 0, 0], [1, 2, 3]], [[5, 5, 5], [6, 5, 5]]])
    ds.save(tmp_path / "a.obj", ds.Sketch(line))
    read = trimesh.load(tmp_path / "a.obj")
    assert np.array(read.bounds).tolist() == [[0, 0, 0], [6, 5, 5]]


def test_no_strokes_is_an_error_and_leaves_the_old_file(tmp_path):
    (tmp_path / "a.obj").write_text("old")
    with pytest.raises(ValueError, match=r"a\.obj: an OBJ file needs at least one stroke, got none"):
        ds.save(tmp_path / "a.obj", ds.Sketch(torch.zeros(0, 4, 3)))
    assert (tmp_path / "a.obj").read_text() == "old"
