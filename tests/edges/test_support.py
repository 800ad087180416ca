"""Which parts of curves views show, what crowds them, and which ridges no curve explains."""

import numpy as np
import pytest
import torch
from edge_scenes import (
    CORNERS,
    EDGES,
    around,
    box_edges,
    box_shown,
    lines_between,
    ridges_along,
    segment,
    turned,
    views_of,
)

from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.support import (
    APART,
    CROWDED,
    PARTS,
    SLANT,
    clear_support,
    crowded,
    headings,
    inliers,
    part_support,
    samples,
)
from diff3ds.edges.evidence.unexplained import unexplained
from diff3ds.render.backends import available_backends

CAMERAS = around(24, 128)
HALF, ROTATION = np.array([0.5, 0.4, 0.6]), turned()
BOX = box_edges(HALF, ROTATION)
SHOWN, _ = box_shown(CAMERAS, HALF, ROTATION)
CURVES = lines_between(*((line[0], line[-1]) for line in BOX))


def test_edges_of_a_box_are_supported_where_they_are_seen():
    views = views_of(CAMERAS, BOX, SHOWN)
    support = part_support(views, CURVES)
    assert support.shape == (24, 12, PARTS)
    seen = torch.from_numpy(SHOWN)[..., None].expand_as(support)
    # Parallel edges may appear on one another, and one seen along its length is hardly seen.
    assert support[seen].float().mean() > 0.98
    assert support[~seen].float().mean() < 0.15
    assert support[0].dtype == torch.bool


def test_a_half_hidden_edge_is_supported_on_its_other_half():
    line = segment((-0.6, 0, 0.1), (0.6, 0.1, 0))
    support = part_support(views_of(CAMERAS, [line[: len(line) // 2]]), lines_between((line[0], line[-1])))
    across = support.float().mean(0)[0]
    assert (across[: PARTS // 2] > 0.9).all()
    # Views along the line see all of it on one ridge.
    assert (across[PARTS // 2 + 1 :] < 0.2).all()


def test_ridges_that_run_across_support_nothing():
    line = segment((-0.5, 0, 0), (0.5, 0, 0))
    x, tangents = samples(lines_between((line[0], line[-1])))
    assert len(x) % PARTS == 0
    np.testing.assert_allclose(tangents, np.tile([1.0, 0, 0], (len(x), 1)), rtol=0, atol=1e-5)
    np.testing.assert_allclose(x[:, 0], (np.arange(len(x)) + 0.5) / len(x) - 0.5, rtol=0, atol=1e-6)
    views = views_of(CAMERAS, [line])
    assert inliers(views, x, tangents).mean() > 0.99
    sideways = np.tile([0.0, 1, 0], (len(x), 1))
    # But where both directions appear as one.
    assert inliers(views, x, sideways).mean() < 0.3


def test_headings_are_those_of_projected_steps():
    views = views_of(CAMERAS, BOX)
    x, tangents = samples(CURVES)
    pixel = views.project(x)[0]
    expected = views.project(x + 1e-5 * tangents)[0] - views.project(x - 1e-5 * tangents)[0]
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    assert (headings(views, x, tangents, pixel) * expected).sum(-1).min() > 0.999


def test_parallel_lines_crowd_each_other_where_they_appear_side_by_side():
    # Two lines a fifth apart along y: from along y they are one, from along z they are 10 pixels apart.
    ends = [((-0.5, y, 0.0), (0.5, y, 0.0)) for y in (-0.1, 0.1)]
    lines = [segment(*pair) for pair in ends]
    views = views_of(CAMERAS, lines)
    curves = lines_between(*ends)
    x, tangents = samples(curves)
    pixel = views.project(x)[0]
    half = len(x) // 2
    apart = np.linalg.norm(pixel[:, :half, None] - pixel[:, None, half:], axis=-1).min(2)
    found = crowded(views, x, tangents)[:, :half]
    # Close is found close, far is far; lines that meet at an angle do not crowd.
    assert found[apart < 1.5].mean() > 0.9
    assert not found[apart > 6].any()
    assert (apart < 1.5).any()
    only = np.arange(len(x)) < half
    beside = crowded(views, x, tangents, by=only)
    assert not beside[:, :half].any()
    assert (beside[:, half:] == crowded(views, x, tangents)[:, half:]).all()
    # Crowded views say nothing, if others are left.
    clear, shown = clear_support(views, curves), part_support(views, curves)
    assert not (clear & ~shown).any()
    parts = found.reshape(24, PARTS, -1).all(2)
    assert not (clear[:, 0].numpy() & parts).any()
    assert clear.sum() > 0.6 * shown.sum()


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without the compiled kernels")
def test_points_that_the_kernel_finds_on_ridges_are_those_of_numpy(monkeypatch):
    views = views_of(CAMERAS, BOX, SHOWN)
    rng = np.random.default_rng(4)
    x, tangents = samples(CURVES)
    x, tangents = (values + rng.normal(0, scale, values.shape) for values, scale in ((x, 0.02), (tangents, 0.4)))
    # And some that views do not contain.
    x = np.concatenate([x, rng.uniform(-9, 9, x.shape)])
    tangents = np.concatenate([tangents, tangents])
    found = inliers(views, x, tangents)
    monkeypatch.setattr("diff3ds.edges.evidence.support.kernels", lambda: None)
    assert 0.1 < found.mean() < 0.5
    assert (inliers(views, x, tangents) == found).all()


@pytest.mark.parametrize("compiled", [True, False])
def test_what_crowds_a_point_is_what_a_look_at_all_pairs_says(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr("diff3ds.edges.evidence.support.kernels", lambda: None)
    views = views_of(CAMERAS, BOX)
    rng = np.random.default_rng(2)
    # Along a plane a hundredth of the scene thick, so that some views see all of it as a line.
    x = rng.uniform(-0.5, 0.5, (300, 3)) * [1, 1, 0.01]
    tangents = rng.normal(size=(300, 3))
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    by, at = rng.random(300) < 0.5, rng.random((24, 300)) < 0.7
    pixel = views.project(x)[0]
    u, v = headings(views, x, tangents, pixel).transpose(2, 0, 1)
    near = np.linalg.norm(pixel[:, :, None] - pixel[:, None], axis=-1) <= CROWDED
    same_way = np.abs(u[:, :, None] * v[:, None] - v[:, :, None] * u[:, None]) < SLANT
    step = x[:, None] - x
    first = np.where((np.arange(300)[:, None] < np.arange(300))[..., None], tangents[:, None], tangents[None])
    apart = (APART * views.pixel) ** 2
    two = ((step**2).sum(2) > apart) & ((step**2).sum(2) - (step * first).sum(2) ** 2 > apart)
    expected = at & (near & same_way & two & by).any(2)
    found = crowded(views, x, tangents, by, at=at)
    assert 100 < expected.sum() < 0.9 * at.sum()
    assert (found == expected).all()


def test_alone_nothing_is_crowded():
    curves = lines_between(((-0.5, 0, 0), (0.5, 0, 0)))
    views = views_of(CAMERAS, [segment((-0.5, 0, 0), (0.5, 0, 0))])
    x, tangents = samples(curves)
    assert not crowded(views, x, tangents).any()
    assert torch.equal(clear_support(views, curves), part_support(views, curves))


def test_ridges_of_curves_are_explained_and_others_are_not():
    ridges = ridges_along(CAMERAS, BOX)
    views = edge_views(CAMERAS, ridges)
    every = sum(len(r) for r in ridges)
    assert sum(len(r) for r in unexplained(views, ridges, CURVES)) < 0.01 * every
    # Without one edge, its ridges are left, but where others pass.
    some = torch.arange(12) != 4
    left = unexplained(views, ridges, CURVES[some])
    alone = ridges_along(CAMERAS, [BOX[4]])
    assert sum(len(r) for r in left) > 0.75 * sum(len(r) for r in alone)
    for rest, own in zip(left, alone, strict=True):
        if len(rest):
            assert np.linalg.norm(rest.points[:, None] - own.points, axis=2).min(1).max() < 1.0
    assert len(left) == len(CAMERAS)


def test_views_without_ridges_have_nothing_to_explain():
    shown = np.ones((24, 12), bool)
    shown[3] = False
    ridges = ridges_along(CAMERAS, BOX, shown)
    assert len(unexplained(edge_views(CAMERAS, ridges), ridges, CURVES)[3]) == 0


def test_the_box_is_a_box():
    """The scene itself: 12 edges of three lengths, each in two faces, more than half of them seen."""
    assert len(EDGES) == 12
    lengths = np.array([np.linalg.norm(line[-1] - line[0]) for line in BOX])
    np.testing.assert_allclose(np.sort(lengths), np.repeat(np.sort(2 * HALF), 4), rtol=1e-12)
    assert (SHOWN.sum(1) >= 7).all()
    assert (SHOWN.sum(1) <= 9).all()
    assert len(CORNERS) == 8
