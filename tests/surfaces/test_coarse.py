"""Coarse meshes for small pictures: how far they are from what they stand for, and that thin walls keep both sides."""

import numpy as np
import pytest
import torch
from solids import box, icosphere, refined

import diff3ds as ds
from diff3ds.surfaces.shape.coarse import coarse, without_specks


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    monkeypatch.setattr("diff3ds.surfaces.shape.coarse.FEW", 1000)


def test_a_coarse_ball_is_round_to_less_than_a_cell():
    ball = ds.TriangleMesh(*icosphere(5))
    found = coarse(ball, 24)
    assert len(found) < len(ball) / 3
    cell = 2 / 24
    assert np.abs(np.linalg.norm(found.vertices, axis=1) - 1).max() < cell / 4
    assert not coarse(ball, 6).is_crease.any()
    # Its outline is where the ball's is.
    cameras = ds.orbit(25.0, 35.0, 4.0, height=3.0, size=64).to(torch.float64)
    (lines,) = ds.visible_lines(ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64)), cameras, found)
    outline = without_specks(lines.strokes(True), 2 * cell)
    length = float(ds.bezier.length(outline.points, outline.weights).sum())
    assert length == pytest.approx(2 * np.pi, rel=0.1)
    points = ds.bezier.evaluate(outline.points, outline.weights, torch.linspace(0, 1, 9, dtype=torch.float64))
    assert float((points.norm(dim=-1) - 1).abs().max()) < cell


def test_contours_of_a_rough_ball_are_no_specks():
    vertices, faces = icosphere(5)
    rough = vertices * (1 + 0.01 * np.random.default_rng(0).normal(size=(len(vertices), 1)))
    found = coarse(ds.TriangleMesh(rough, faces), 48)
    cameras = ds.orbit(25.0, 35.0, 4.0, height=3.0, size=64).to(torch.float64)
    (lines,) = ds.visible_lines(ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64)), cameras, found)
    lengths = ds.losses.lengths(lines.sketch)
    # Chords of a fine mesh are about as long as the strokes that are fitted to them.
    assert lengths.min() > 0.9 * found.specks > 3 * 2 / 48
    assert lengths.sum() > np.pi


def test_thin_walls_and_creases_stay_and_small_meshes_are_as_they_were():
    vertices, faces = box()
    for _ in range(4):
        vertices, faces = refined(vertices, faces)
    plate = ds.TriangleMesh(vertices * [1, 1, 0.001], faces)
    found = coarse(plate, 20)
    assert len(found) < len(plate) / 2
    up = found.face_normals[:, 2] * found.face_areas
    assert up[up > 0].sum() == pytest.approx(4, rel=0.05)
    assert up[up < 0].sum() == pytest.approx(-4, rel=0.05)
    block = coarse(ds.TriangleMesh(vertices, faces), 20)
    assert block.is_crease.any()
    small = ds.TriangleMesh(*icosphere(2))
    assert coarse(small, 4) is small
