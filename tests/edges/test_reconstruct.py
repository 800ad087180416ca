"""Refinement through the renderer, and the whole way from ridges to curves: a box and a circle, and their bytes."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import arc, around, box_edges, lines_between, ridges_along, segment, turned, views_of, whole
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import curves_of, sampled
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.first_curves import edge_points, first_curves
from diff3ds.edges.reconstruct import (
    CALIBRATED,
    COMPLETED,
    DONE,
    FITTED,
    JOINED,
    NOTHING,
    REFINED,
    _Scene,
    confirming,
    reconstruct,
)
from diff3ds.edges.refine import _missed, draw_ridges, refined
from diff3ds.edges.watch import no_report, no_tick, not_said

CAMERAS = around(20, 128)
HALF, ROTATION = np.array([0.5, 0.4, 0.55]), turned(3)
CENTER, RADIUS = np.array([0.1, 0.0, 0.1]), 0.3
CIRCLE = RADIUS * ROTATION[0], RADIUS * ROTATION[1]
LINES = [*box_edges(HALF, ROTATION), arc(CENTER, *CIRCLE)]
RIDGES = ridges_along(CAMERAS, LINES)
VIEWS = views_of(CAMERAS, LINES)
# These ridges have no bias: the first curves are the last.
STAGES = [1, CALIBRATED, REFINED, JOINED, FITTED, COMPLETED, DONE]


def distances(points, lines):
    return cKDTree(np.concatenate(lines)).query(points.reshape(-1, 3))[0] / VIEWS.pixel


def test_ridges_are_drawn_as_lines():
    drawn = draw_ridges(VIEWS, 0)
    assert drawn.shape == (128, 128)
    assert drawn.dtype == np.float32
    assert drawn.max() == 1
    y, x = np.mgrid[:128, :128] + 0.5
    away = cKDTree(RIDGES[0].points).query(np.stack([x, y], -1).reshape(-1, 2))[0].reshape(128, 128)
    # Within half a pixel all ink, beyond one and a half none.
    assert (drawn[away < 0.45] > 0.9).mean() > 0.99
    assert (drawn[away > 2.4] == 0).all()


@pytest.mark.parametrize("compiled", [True, False])
def test_what_images_miss_is_a_mean_over_views(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr("diff3ds.edges.refine.kernels", lambda: None)
    generator = torch.Generator().manual_seed(5)
    wanted = torch.randint(256, (4, 9, 7), generator=generator, dtype=torch.uint8)
    alpha = torch.rand(3, 9, 7, generator=generator, requires_grad=True)
    loss = _missed(alpha, wanted, torch.tensor([3, 0, 2]))
    off = alpha.detach().double() - wanted[[3, 0, 2]].double() / 255
    assert loss.item() == pytest.approx(float(off.square().sum()) / 3, rel=1e-6)
    (gradient,) = torch.autograd.grad(5 * loss, alpha)
    torch.testing.assert_close(gradient.double(), 5 * 2 / 3 * off, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_displaced_curves_return():
    line = ((-0.5, 0.1, 0.2), (0.5, -0.2, -0.1))
    true = [segment(*line, samples=4000), arc(CENTER, *CIRCLE, samples=4000)]
    views = views_of(CAMERAS, true)
    for curves, own in zip((lines_between(line), curves_of([whole(CENTER, *CIRCLE)])), true, strict=True):
        shift = torch.tensor([0.6, -0.5, 0.6]) * views.pixel
        start = curves.moved(curves.points + shift)
        losses = []
        found = refined(start, CAMERAS, views, 120, 0.09, report=lambda step, loss, to=losses: to.append((step, loss)))
        before, after = (cKDTree(own).query(sampled(c).reshape(-1, 3))[0] / views.pixel for c in (start, found))
        assert before.mean() > 0.5
        # Within the ends of a line nothing says where it ends.
        assert np.percentile(after, 90) < 0.1
        assert [step for step, _ in losses] == list(range(1, 121))
        assert np.mean([loss for _, loss in losses[-4:]]) < np.mean([loss for _, loss in losses[:4]])
        torch.testing.assert_close(found.constrained(found.points)[0], found.points, rtol=0, atol=1e-5)


@pytest.fixture(scope="module")
def stages():
    """The results of all stages, and what was reported."""
    results, told = [], []
    end = reconstruct(CAMERAS, RIDGES, save=results.append, report=lambda *about: told.append(about))
    assert end is results[-1]
    return results, told


def test_a_box_and_a_circle_are_found(stages):
    results, told = stages
    assert [r.stage for r in results] == STAGES
    curves = results[-1].curves
    kinds = curves.kind.tolist()
    assert kinds.count(Kind.LINE) == 12
    assert kinds.count(Kind.CIRCLE) == len(kinds) - 12 == 1
    on = sampled(curves)
    assert distances(on, LINES).max() < 0.5
    back = cKDTree(sampled(curves, 400).reshape(-1, 3)).query(np.concatenate(LINES))[0] / VIEWS.pixel
    assert back.max() < 1
    # Corners are shared: 8 of the box, 2 ends of half a circle.
    assert len(curves.vertex.unique()) == 10
    circle = on[curves.closed.numpy()]
    np.testing.assert_allclose(np.linalg.norm(circle - CENTER, axis=2), RADIUS, rtol=0.005)
    assert max(abs(v) for v in vars(results[-1].bias).values()) < 0.1
    # Told in order, with losses of every step.
    begun = list(dict.fromkeys(about[0] for about in told))
    assert begun[:5] == ["carve", "points on edges", "first curves", "calibration", "refine"]
    steps = [step for stage, step, _, _, _ in told if stage == "refine"]
    assert steps == list(range(len(steps)))


@pytest.mark.slow
def test_an_ellipse_is_found():
    """Of 41 by 21 pixels, whose ridges are off by a tenth: first as arcs and cubics, at the end as one ellipse."""
    a, b = 0.8, 0.4
    rng = np.random.default_rng(0)
    ridges = ridges_along(CAMERAS, [arc(CENTER / 2, a * ROTATION[0], b * ROTATION[1])])
    ridges = [replace(r, points=r.points + 0.1 * rng.normal(size=r.points.shape)) for r in ridges]
    curves = reconstruct(CAMERAS, ridges).curves
    assert curves.kind.tolist() == [Kind.ELLIPSE]
    offset = (sampled(curves) - CENTER / 2) @ ROTATION.T
    np.testing.assert_allclose(np.hypot(offset[..., 0] / a, offset[..., 1] / b), 1, rtol=0.01)
    assert np.abs(offset[..., 2]).max() < 0.1 * VIEWS.pixel


def same(a, b):
    fields = ("points", "kind", "vertex")
    return a.bias == b.bias and all(torch.equal(getattr(a.curves, n), getattr(b.curves, n)) for n in fields)


@pytest.mark.parametrize(
    "stage", [pytest.param(stage, marks=[pytest.mark.slow] * (stage in (1, 2, 3, 4))) for stage in range(len(STAGES))]
)
def test_going_on_from_a_stage_gives_the_same_bytes(stages, stage):
    """Of the next stage, and so of all."""
    results, _ = stages
    saved = []

    def save(result):
        saved.append(result)
        raise KeyboardInterrupt

    if stage == len(STAGES) - 1:
        assert same(reconstruct(CAMERAS, RIDGES, reached=results[stage], save=save), results[stage])
        return
    with pytest.raises(KeyboardInterrupt):
        reconstruct(CAMERAS, RIDGES, reached=results[stage], save=save)
    assert saved[0].stage == STAGES[stage + 1]
    assert same(saved[0], results[stage + 1])


@pytest.mark.slow
def test_two_threads_give_the_bytes_of_one(stages):
    results, _ = stages
    torch_before = torch.get_num_threads()
    assert torch_before == 1
    try:
        ds.set_num_threads(2)
        torch.set_num_threads(2)
        assert same(reconstruct(CAMERAS, RIDGES), results[-1])
    finally:
        ds.set_num_threads(None)
        torch.set_num_threads(torch_before)


@pytest.mark.slow
def test_curves_to_start_from(stages):
    """Given curves are refined and cleaned, and nothing is carved."""
    line = LINES[0]
    shift = 0.5 * VIEWS.pixel
    start = lines_between((line[0] + shift, line[-1] + shift))
    found = reconstruct(CAMERAS, RIDGES, start=start).curves
    assert len(found) == 1
    assert np.percentile(distances(sampled(found), [line]), 90) < 0.2


def test_first_curves_of_exact_ridges():
    curves = first_curves(VIEWS, confirming(20))
    assert (curves.kind == Kind.LINE).sum() >= 12
    assert np.percentile(distances(sampled(curves), LINES), 95) < 1


def test_edges_without_a_bias_are_looked_for_where_they_were_with_it():
    shifted = [replace(ridge, points=ridge.points + np.array([0.5, -0.4])) for ridge in RIDGES]
    scene = _Scene(CAMERAS, shifted, confirming(20), 0, no_report, not_said)
    found = scene.points_without(VIEWS)
    everywhere = edge_points(VIEWS, scene.cells, confirming(20), lambda stage: no_tick)
    assert np.percentile(distances(found.points, LINES), 95) < 0.5
    assert (cKDTree(found.points).query(everywhere.points)[0] < VIEWS.pixel).mean() > 0.97


def test_more_views_more_to_confirm():
    needed = [confirming(n) for n in (1, 12, 25, 50, 200)]
    assert needed == sorted(needed)
    assert needed[0] == 3
    assert all(a < n for a, n in zip(needed[1:], (12, 25, 50, 200), strict=True))


def test_views_that_agree_on_nothing():
    rng = np.random.default_rng(0)
    lost = []
    for _ in range(20):
        lines = [np.linspace(*rng.uniform(10, 118, (2, 2)), 80) for _ in range(3)]
        tangents = np.concatenate([np.repeat((line[-1:] - line[:1]), 80, 0) for line in lines])
        normals = np.stack([tangents[:, 1], -tangents[:, 0]], 1) / np.linalg.norm(tangents, axis=1)[:, None]
        lost.append(Ridges.sharp(np.concatenate(lines), normals, np.ones(240)))
    with pytest.raises(ValueError, match=NOTHING.split(":")[0]):
        reconstruct(CAMERAS, lost)
    none = Ridges.sharp(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    with pytest.raises(ValueError, match=NOTHING.split(":")[0]):
        reconstruct(CAMERAS, [none] * 20)
    wrong = lines_between(((0.7, 0.7, 0.1), (0.7, 0.6, 0.5)))
    with pytest.raises(ValueError, match=NOTHING.split(":")[0]):
        reconstruct(CAMERAS, RIDGES, start=wrong)
