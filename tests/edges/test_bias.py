"""The bias of a detector, put into exact ridges of a box and found again."""

import functools

import numpy as np
import pytest
import torch
from edge_scenes import around, box_edges, box_shown, lines_between, project, ridges_along, turned

from diff3ds.edges.evidence import bias as bias_module
from diff3ds.edges.evidence.bias import Bias, corrected, estimate_bias, outline_sides
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges

CAMERAS = around(24, 160)
HALF, ROTATION = np.array([0.55, 0.4, 0.6]), turned(2)
BOX = box_edges(HALF, ROTATION)
SHOWN, OUTLINE = box_shown(CAMERAS, HALF, ROTATION)
EXACT = ridges_along(CAMERAS, BOX, SHOWN)
CURVES = lines_between(*((line[0], line[-1]) for line in BOX))
MIDDLE = project(CAMERAS, np.zeros((1, 3)))[0][:, 0]


@functools.cache
def true_sides():
    """1 or -1 where the normals of ridges of outline edges point away from the box or into it; else 0."""
    found = []
    for view in range(len(CAMERAS)):
        outline = ridges_along(CAMERAS[[view]], BOX, OUTLINE[[view]])[0].points
        ridges = EXACT[view]
        on = np.linalg.norm(ridges.points[:, None] - outline, axis=2).min(1) < 1e-6
        # The box is convex, its image too: away from the middle is out.
        found.append(np.where(on, np.sign((ridges.normals * (ridges.points - MIDDLE[view])).sum(1)), 0.0))
    return found


def test_sides_of_outlines():
    inner = []
    for ridges, true in zip(EXACT, true_sides(), strict=True):
        sides = outline_sides(ridges, CAMERAS.size)
        assert set(np.unique(sides)) <= {-1.0, 0.0, 1.0}
        # Inner edges near their ends, or close to the outline, may count as outline; but never on the wrong side.
        assert (sides == true)[true != 0].mean() > 0.97
        assert not (sides * true == -1).any()
        inner += [sides[true == 0] == 0]
    assert np.concatenate(inner).mean() > 0.6


def test_outlines_with_gaps_have_sides():
    found = []
    for ridges, true in zip(EXACT, true_sides(), strict=True):
        # From one place of the outline, all ridges within 8 pixels are missing.
        place = ridges.points[np.nonzero(true)[0][0]]
        left = np.linalg.norm(ridges.points - place, axis=1) > 8
        near = np.linalg.norm(ridges.points - place, axis=1) < 16
        sides = outline_sides(ridges[left], CAMERAS.size)
        far = (true != 0) & ~near
        found += [(sides == true[left])[far[left]]]
    # Single points at the corners may fail.
    assert np.concatenate(found).mean() > 0.97


def test_no_ridges_no_sides():
    empty = Ridges.sharp(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    assert outline_sides(empty, (32, 32)).shape == (0,)


def biased(bias):
    """The exact ridges as a detector with this bias gives them."""
    shift = np.array([bias.dx, bias.dy])
    return [
        Ridges.sharp(r.points + shift + bias.outward * side[:, None] * r.normals, r.normals, r.values)
        for r, side in zip(EXACT, true_sides(), strict=True)
    ]


@pytest.mark.parametrize(
    "bias",
    [
        Bias(0, 0, 0),
        pytest.param(Bias(0.4, -0.3, 0), marks=pytest.mark.slow),
        pytest.param(Bias(0, 0, 0.6), marks=pytest.mark.slow),
        Bias(-0.25, 0.35, 0.5),
        Bias(0, 0.5, -0.4),
    ],
    ids=str,
)
def test_the_bias_is_found(bias):
    ridges = biased(bias)
    sides = [outline_sides(r, CAMERAS.size) for r in ridges]
    found = estimate_bias(edge_views(CAMERAS, ridges), np.concatenate(sides), CURVES)
    assert found.dx == pytest.approx(bias.dx, abs=0.05)
    assert found.dy == pytest.approx(bias.dy, abs=0.05)
    assert found.outward == pytest.approx(bias.outward, abs=0.05)


def test_corrected_takes_the_bias_back():
    bias = Bias(0.4, -0.3, 0.7)
    back = corrected(biased(bias), true_sides(), bias)
    for ridges, exact in zip(back, EXACT, strict=True):
        np.testing.assert_allclose(ridges.points, exact.points, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(ridges.normals, exact.normals)


def test_a_part_of_many_samples_says_the_same(monkeypatch):
    """Each seventh sample, and no curves at all."""
    bias = Bias(-0.25, 0.35, 0.5)
    views, sides = edge_views(CAMERAS, biased(bias)), np.concatenate(true_sides())
    every = estimate_bias(views, sides, CURVES)
    monkeypatch.setattr(bias_module, "MOST_SAMPLES", 60)
    some = estimate_bias(views, sides, CURVES)
    assert some != every
    for name in ("dx", "dy", "outward"):
        assert getattr(some, name) == pytest.approx(getattr(bias, name), abs=0.08)
    assert estimate_bias(views, sides, CURVES[torch.zeros(12, dtype=torch.bool)]) == Bias(0.0, 0.0, 0.0)
