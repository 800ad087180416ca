"""`diff3ds mesh` with meshes that are bumpy and rounded: by the forms that they are made of, and only those."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.bezier import evaluate
from diff3ds.formats.mesh import save_surface
from diff3ds.surfaces.shape.level_set import level_set
from diff3ds.tasks.mesh.draw_mesh import run_mesh
from diff3ds.tasks.mesh.formed import formed
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.mesh.source import Source
from diff3ds.tasks.render.render_options import OrbitOptions

HALF = np.array([0.5, 0.35, 0.25])


def rounded_box(noise: float, radius: float = 0.03, cells: int = 44) -> ds.TriangleMesh:
    """A box with rounded edges through a grid, its distances off by bumps of some cells, as generated meshes are."""
    spacing = 1 / cells
    axes = [np.arange(-h - 4 * spacing, h + 4 * spacing, spacing) for h in HALF]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    out = np.abs(points) - HALF + radius
    away = np.linalg.norm(np.maximum(out, 0), axis=-1) + np.minimum(out.max(-1), 0) - radius
    bumps = gaussian_filter(np.random.default_rng(0).normal(size=away.shape), 0.8)
    return level_set(noise * bumps / bumps.std() - away, points[0, 0, 0], spacing)


def off_edges(points: np.ndarray) -> np.ndarray:
    """How far points are from the twelve edges of the sharp box."""
    off = np.abs(np.abs(points) - HALF)
    outside = np.maximum(np.abs(points) - HALF, 0)
    lines = [np.hypot(off[:, (k + 1) % 3], off[:, (k + 2) % 3]) + outside[:, k] for k in range(3)]
    return np.min(lines, axis=0)


def test_a_bumpy_box_lies_on_six_planes_and_the_edges_of_these_are_its_creases() -> None:
    told: list[str] = []
    found = formed(rounded_box(0.002), "edge", told.append)
    assert found is not None
    assert [form["kind"] for form in found.told["forms"]] == ["plane"] * 6
    assert len(found.features) == 12
    assert len(told) == 1
    assert "bumpy, rounded or scanned" in told[0]
    assert {name.partition(",")[0] for name in found.features.names} == {f"edge {k}" for k in range(12)}
    # A grid of cells three quarters as wide as the rounding cuts a little more off than that does.
    assert all(0.028 < edge["radius"] < 0.04 for edge in found.told["edges"])
    flat = found.mesh.form >= 0
    assert flat.mean() > 0.9
    assert np.abs(found.mesh.vertices[found.mesh.faces[flat]] / HALF).max(2).min() > 0.99


def test_inner_walls_that_nobody_sees_have_no_part_in_the_forms() -> None:
    outer = rounded_box(0.002)
    inner = 0.94 * outer.vertices, outer.faces[:, ::-1] + len(outer.vertices)
    double = ds.TriangleMesh(np.concatenate([outer.vertices, inner[0]]), np.concatenate([outer.faces, inner[1]]))
    found = Source(double).by_forms(MeshOptions(), lambda line: None)
    assert len(found.mesh) == len(outer)
    assert found.edges is not None
    assert found.edges[1] == ("crease",) * 12
    places = evaluate(found.edges[0].points, found.edges[0].weights, torch.linspace(0, 1, 9)).reshape(-1, 3)
    assert off_edges(places.numpy()).max() < 0.004


def test_what_has_no_more_faces_than_people_model_by_hand_is_as_it_was_meant() -> None:
    coarse = rounded_box(0.002, cells=12)
    assert 1000 < len(coarse) < 3000
    assert formed(coarse, "edge", lambda line: None) is None


def test_rounded_edges_are_two_tangent_lines_where_these_are_asked_for() -> None:
    found = formed(rounded_box(0.002), "tangents", lambda line: None)
    assert found is not None
    assert found.kinds == ("tangent",) * 24
    ends = np.abs(found.features.points[:, [0, 3]].reshape(-1, 3).numpy()) - HALF
    # On one side of the box, and a little within both others.
    assert np.abs(np.sort(ends, axis=1)[:, 2]).max() < 0.003
    assert (np.abs(np.sort(ends, axis=1)[:, :2] + 0.034) < 0.008).all()


@pytest.mark.slow
def test_a_bumpy_box_with_rounded_edges_has_twelve_lines_where_its_sides_would_meet(tmp_path: Path) -> None:
    mesh = rounded_box(0.002)
    save_surface(tmp_path / "box.glb", mesh.vertices, mesh.faces)
    told: list[str] = []
    options = MeshOptions(OrbitOptions(azimuth=(30.0,), distance=3.0), size=256, turntable=0)
    sketch = run_mesh(tmp_path / "box.glb", tmp_path / "out", options, say=told.append)
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert len(sketch) == run["kinds"]["crease"] == 12
    assert [form["kind"] for form in run["forms"]] == ["plane"] * 6
    assert any("bumpy, rounded or scanned" in line for line in told)
    along = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9, dtype=sketch.points.dtype))
    assert off_edges(along.reshape(-1, 3).double().numpy()).max() < 0.004
    sharp = ds.TriangleMesh(*box_of(2 * HALF))
    save_surface(tmp_path / "sharp.glb", sharp.vertices, sharp.faces)
    run_mesh(tmp_path / "sharp.glb", tmp_path / "sharp", options)
    one, other = (ink(tmp_path / name / "drawing-1.png") for name in ("out", "sharp"))
    away = np.concatenate([cKDTree(one).query(other)[0], cKDTree(other).query(one)[0]])
    assert (away < 3).mean() > 0.98


def box_of(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * size - size / 2
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])


def ink(path: Path) -> np.ndarray:
    """Where a drawing is dark, pixels."""
    return np.argwhere(np.asarray(Image.open(path).convert("L")) < 128)


@pytest.mark.parametrize("kind", ["box", "ball", "smooth box"])
def test_clean_meshes_stay_as_they_are(kind: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    if kind == "smooth box":
        mesh = rounded_box(0.0, radius=0.2)
    else:
        made = trimesh.creation.box() if kind == "box" else trimesh.creation.icosphere(4)
        mesh = ds.TriangleMesh(made.vertices, made.faces)
    assert formed(mesh, "edge", lambda line: None) is None


def test_an_animal_stays_as_it_is() -> None:
    # A body and a head, whose surface bends everywhere.
    spacing = 1 / 30
    axes = [np.arange(-0.7, 0.7, spacing)] * 3
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    body = 0.5 - np.linalg.norm(points * [1, 1.4, 1.6] + 0.1 * np.sin(7 * points[..., ::-1]), axis=-1)
    assert formed(level_set(body, points[0, 0, 0], spacing), "edge", lambda line: None) is None
