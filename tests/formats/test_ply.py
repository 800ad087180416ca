"""PLY, read back by trimesh: a closed mesh in the frame of the sketch, with its colours."""

import io

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.formats.mesh import load_mesh

pytestmark = needs("trimesh")


def test_places_colours_and_strokes_without_width(tmp_path):
    import trimesh

    points = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[0, 0, 5], [0, 0, 6]], [[0, 9, 0], [0, 9, 1]]])
    color = torch.tensor([[1.0, 0.5, 0], [0, 0, 2.0], [0, 0, 0]])
    width = torch.tensor([0.2, 0.2, 0.0])
    sketch = ds.Sketch(points, width=width, color=color, opacity=torch.tensor([1, 0.5, 1]), width_space="world")
    ds.save(tmp_path / "a.ply", sketch)
    mesh = trimesh.Trimesh(*load_mesh(tmp_path / "a.ply"), process=False)
    assert mesh.is_watertight
    assert mesh.body_count == 2
    assert mesh.volume > 0
    np.testing.assert_allclose(mesh.bounds, [[-0.1, -0.1, -0.1], [1.1, 0.1, 6.1]], atol=0.01)
    loaded = trimesh.load(io.BytesIO((tmp_path / "a.ply").read_bytes()), "ply", process=False)
    colors = np.asarray(loaded.visual.vertex_colors)
    low = loaded.vertices[:, 2] < 2
    assert (colors[low] == [255, 128, 0, 255]).all()
    assert (colors[~low] == [0, 0, 255, 128]).all()
    with pytest.raises(ValueError, match="needs at least one stroke with a width, got none of 1"):
        ds.save(tmp_path / "b.ply", sketch[2])
    assert [path.name for path in tmp_path.iterdir()] == ["a.ply"]
