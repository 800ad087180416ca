"""Rounded edges of clouds against closed forms: their radii, and the lines at which they begin."""

import numpy as np
import pytest

from diff3ds.curves.shapes.curve_set import sampled
from diff3ds.surfaces.form.form_curves import FormCurves, form_curves
from diff3ds.surfaces.form.samples import Samples

HALF = np.array([0.5, 0.35, 0.25])


def box(radius: float, count: int = 9000) -> np.ndarray:
    """Points of a box with rounded edges and corners, evenly on the sharp one and moved onto it."""
    rng = np.random.default_rng(0)
    area = np.array([HALF[1] * HALF[2], HALF[0] * HALF[2], HALF[0] * HALF[1]])
    x = rng.uniform(-1, 1, (count, 3)) * HALF
    side = rng.choice(3, count, p=area / area.sum())
    x[np.arange(count), side] = rng.choice([-1.0, 1.0], count) * HALF[side]
    inner = np.clip(x, radius - HALF, HALF - radius)
    away = np.linalg.norm(x - inner, axis=1, keepdims=True)
    return inner + radius * (x - inner) / np.maximum(away, 1e-12) if radius else x


def drum(radius: float, count: int = 9000) -> np.ndarray:
    """Points of a cylinder of radius .5 and height .5 whose rims are rounded."""
    rng = np.random.default_rng(0)
    turn, flat = rng.uniform(0, 2 * np.pi, count), rng.random(count) < 0.5
    q = np.where(flat, 0.5 * np.sqrt(rng.random(count)), 0.5)
    h = np.where(flat, 0.25 * rng.choice([-1.0, 1.0], count), rng.uniform(-0.25, 0.25, count))
    p = np.stack([q, h], 1)
    inner = np.stack([np.minimum(q, 0.5 - radius), np.clip(h, radius - 0.25, 0.25 - radius)], 1)
    p = inner + radius * (p - inner) / np.linalg.norm(p - inner, axis=1, keepdims=True)
    return np.stack([p[:, 0] * np.cos(turn), p[:, 0] * np.sin(turn), p[:, 1]], 1)


def radii(found: FormCurves) -> list[float]:
    return [edge.rounding.radius if edge.rounding else 0.0 for edge in found.edges]


@pytest.mark.parametrize("radius", [pytest.param(0.0, marks=pytest.mark.slow), 0.03])
def test_edges_of_a_box_have_the_radius_of_their_rounding(radius: float) -> None:
    found = form_curves(Samples.of_points(box(radius)))
    assert len(found.curves) == 12
    assert radii(found) == pytest.approx([radius] * 12, rel=0.04)


@pytest.mark.slow
def test_tangent_lines_of_a_box_meet_on_its_sides() -> None:
    found = form_curves(Samples.of_points(box(0.03)), rounded="tangents")
    assert found.kinds == ("tangent",) * 24
    off = np.sort(np.abs(np.abs(found.curves.points[:, [0, 3]].reshape(-1, 3).numpy()) - HALF), axis=1)
    assert off[:, 0].max() < 0.001
    assert np.abs(off[:, 1:] - 0.03).max() < 0.002


@pytest.mark.slow
def test_rims_of_a_drum_begin_on_circles() -> None:
    found = form_curves(Samples.of_points(drum(0.03)), rounded="tangents")
    assert radii(found) == pytest.approx([0.03] * 2, rel=0.04)
    places = np.concatenate(list(sampled(found.curves)))
    q, h = np.linalg.norm(places[:, :2], axis=1), np.abs(places[:, 2])
    top = h > 0.235
    assert top.mean() == pytest.approx(0.5, abs=0.2)
    assert np.abs(np.stack([q[top] - 0.47, h[top] - 0.25])).max() < 0.002
    assert np.abs(np.stack([q[~top] - 0.5, h[~top] - 0.22])).max() < 0.002
