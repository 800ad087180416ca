"""Strokes along outlines of smooth parts, told from edges by where pictures should show them."""

import sys
from pathlib import Path

import torch

import diff3ds as ds
from diff3ds.edges.clean.false_strokes import false_strokes
from diff3ds.edges.evidence.ridges import map_ridges

sys.path.insert(0, str(Path(__file__).parents[1] / "surfaces"))
from solids import icosphere

CAMERAS = ds.orbit([137.508 * i for i in range(12)], [-50 + 9.0 * i for i in range(12)], 4.0, fov=45, size=128)


def test_an_edge_on_a_ball_is_one_and_a_piece_of_its_outline_is_none():
    ball = ds.TriangleMesh(*icosphere(2))
    points, weights = ds.bezier.circle((0.0, 0.0, 0.5), 0.75**0.5)
    edge = ds.Sketch(points, weights, width=0.02, chains=ds.Chains.of([len(points)], [True])).to(torch.float32)
    pictures = ds.render(edge, CAMERAS, surface=ball).alpha
    ridges = [map_ridges(picture.numpy()) for picture in pictures]
    # A quarter of a great circle, up to the edge; a line that the ball hides from everywhere; one that is beside it.
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 1.0, (0.0, 1.0, 0.0), -20, 25)
    outline = ds.Sketch(points, weights).to(torch.float32)
    inside = ds.Sketch(torch.tensor([[[-0.4, 0, 0], [0.4, 0.1, 0]]])).elevate()
    beside = ds.Sketch(torch.tensor([[[1.5, 0, 0], [1.5, 1, 0]]])).elevate()
    all_of_them = ds.Sketch.concatenate([edge, outline, inside, beside])
    found = false_strokes(all_of_them, ball, CAMERAS, ridges)
    assert found.tolist() == [False, True, False, False]
