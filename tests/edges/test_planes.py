"""Planes that curves share, and circles placed in them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import arc, around, lines_between, ridges_along, segment, turned, whole

from diff3ds.curves.shapes.curve_set import concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import fit_circle
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.measure import fit_ridges
from diff3ds.edges.measure.fit_ridges import fit_to_ridges
from diff3ds.edges.measure.planes import shared_planes

PIXEL = 0.01
TILT = turned(4)
SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def square(half, height=0.0):
    """Four lines around a square of a plane across the third axis."""
    corners = (half * SQUARE + [0, 0, height]) @ TILT.T
    lines = lines_between(*((corners[k], corners[(k + 1) % 4]) for k in range(4)))
    return replace(lines, vertex=torch.tensor([[k, (k + 1) % 4] for k in range(4)]))


def ring(radius, height=0.0, tilt=0.0):
    """A circle around the third axis; its plane rises by `tilt` from one side to the other."""
    center, v = height * TILT[:, 2], radius * TILT[:, 1]
    u = radius * (np.cos(tilt) * TILT[:, 0] + np.sin(tilt) * TILT[:, 2])
    return curves_of([whole(center, u, v)])


def all_sure(curves):
    return np.ones(len(curves), bool)


def test_a_tilted_circle_is_found_in_the_plane_of_the_lines():
    curves = concatenated(square(0.5), ring(0.06, 0.2 * PIXEL, 0.03))
    found = shared_planes(curves, all_sure(curves), PIXEL)
    assert list(found) == [4]
    assert abs(found[4].normal @ TILT[:, 2]) == pytest.approx(1, abs=1e-12)
    x = np.random.default_rng(0).normal(size=(5, 3))
    assert found[4].distances(x) == pytest.approx(np.abs(x @ TILT[:, 2]), abs=1e-7)
    flat = found[4].project(x)
    assert flat == pytest.approx(x - np.outer(x @ TILT[:, 2], TILT[:, 2]), abs=1e-7)


def test_a_circle_beside_the_plane_belongs_to_no_plane():
    curves = concatenated(square(0.5), ring(0.06, 0.8 * PIXEL))
    assert shared_planes(curves, all_sure(curves), PIXEL) == {}
    curves = concatenated(square(0.5), ring(0.06, 0.0, 0.2))
    assert shared_planes(curves, all_sure(curves), PIXEL) == {}


def test_only_curves_that_are_placed_and_spread_farther_say_where_a_circle_lies():
    curves = concatenated(square(0.5), ring(0.06))
    sure = all_sure(curves)
    sure[:4] = False
    assert shared_planes(curves, sure, PIXEL) == {}
    sure[:2] = True
    assert list(shared_planes(curves, sure, PIXEL)) == [4]
    # Two circles in one plane: the larger one says where the small one lies.
    small = concatenated(ring(0.06), ring(0.3))
    assert list(shared_planes(small, all_sure(small), PIXEL)) == [0]
    line = concatenated(lines_between((0.3 * TILT[:, 0], 0.5 * TILT[:, 1])), ring(0.06))
    assert shared_planes(line, all_sure(line), PIXEL) == {}


def test_every_face_has_its_own_plane():
    curves = concatenated(concatenated(square(0.5), square(0.5, 0.2)), concatenated(ring(0.06), ring(0.06, 0.2)))
    found = shared_planes(curves, all_sure(curves), PIXEL)
    heights = {i: plane.origin @ TILT[:, 2] for i, plane in found.items()}
    assert heights == pytest.approx({8: 0.0, 9: 0.2}, abs=1e-7)


def wandering(cameras, seed):
    """Views of a square and of a small circle in its middle, whose ridges lie .3 pixels beside it in every picture."""
    corners = 0.6 * SQUARE @ TILT.T
    exact = ridges_along(cameras, [segment(a, b) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])
    small = ridges_along(cameras, [arc(np.zeros(3), 0.08 * TILT[:, 0], 0.08 * TILT[:, 1])])
    shift = np.random.default_rng(seed).normal(0, 0.3, (len(cameras), 1, 2))
    both = [
        Ridges.sharp(
            np.concatenate([s.points, c.points + o]), np.concatenate([s.normals, c.normals]), np.ones(len(s) + len(c))
        )
        for s, c, o in zip(exact, small, shift, strict=True)
    ]
    return edge_views(cameras, both)


def test_a_small_circle_is_placed_in_the_plane_of_its_face(monkeypatch):
    cameras = around(12, 160)
    errors = {"face": [], "alone": []}
    for seed in range(6):
        views = wandering(cameras, seed)
        rough = concatenated(square(0.6), ring(0.08, 0.2 * views.pixel, 0.02))
        for way, found in errors.items():
            with monkeypatch.context() as patch:
                if way == "alone":
                    patch.setattr(fit_ridges, "shared_planes", lambda *given: {})
                x = sampled(fit_to_ridges(rough, views, 0.0))[4:].reshape(-1, 3) / views.pixel
            found.append([np.abs(x @ TILT[:, 2]).max(), np.linalg.norm(fit_circle(x).center)])
    face, alone = np.array(errors["face"]), np.array(errors["alone"])
    assert face[:, 0].max() < 0.03
    assert alone[:, 0].max() > 0.1
    assert face[:, 1].mean() < 0.9 * alone[:, 1].mean()
