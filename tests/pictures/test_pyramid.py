"""Coarse to fine targets, and the views of every step."""

import pytest
import torch

import diff3ds as ds
from diff3ds.pictures.pyramid import build_pyramid
from diff3ds.pictures.store import Store, as_bytes, store_of


@pytest.fixture
def scene(generator):
    cameras = ds.orbit([0, 50, 100, 150, 200, 250, 300], 20, 2.5, size=256)
    return ds.Sketch.random(10, generator=generator, radius=0.8, width=0.02), cameras


def test_targets_are_what_a_perfect_sketch_renders():
    """At every level a sketch, drawn as `fit` draws it, is its own target.

    For a line that leaves the images: ends and crossings of strokes differ from what a filter in two dimensions makes.
    """
    cameras = ds.orbit([0, 50, 100, 150, 200], 0, 2.0, size=256)
    sketch = ds.Sketch(torch.tensor([[[-0.6, 0.2, -2.0], [0.7, -0.3, 2.0]]]), width=0.05)
    pyramid = build_pyramid(cameras, store_of(ds.render(sketch, cameras).alpha[..., None]), 40, 3, seed=0)
    for step in (0, 10, 20, 39):
        drawn = ds.render(
            sketch, pyramid.cameras(step, torch.Generator()), antialiasing=pyramid.antialiasing(step)
        ).alpha
        target = pyramid.targets(step).alpha
        assert drawn.shape == target.shape
        inner = (drawn - target)[:, 4:-4, 4:-4].abs()  # at the borders the filter sees no more of the line

        assert inner.max() < 0.086


def test_levels_share_the_steps(scene):
    sketch, cameras = scene
    pyramid = build_pyramid(cameras, store_of(ds.render(sketch, cameras).alpha[..., None]), 100, 3, seed=0)
    heights = [pyramid.level(step).cameras.size[0] for step in range(100)]
    assert heights == [32] * 25 + [64] * 25 + [128] * 25 + [256] * 25


def test_every_view_comes_once_before_any_comes_again(scene):
    sketch, cameras = scene
    pyramid = build_pyramid(cameras, store_of(ds.render(sketch, cameras).alpha[..., None]), 100, 2, seed=1)
    for epoch in range(5):
        rows = torch.cat([pyramid.views(3 * epoch + i) for i in range(3)])
        assert len(rows.unique()) == 6
    other = build_pyramid(cameras, store_of(ds.render(sketch, cameras).alpha[..., None]), 100, 2, seed=2)
    assert any(not torch.equal(pyramid.views(i), other.views(i)) for i in range(10))


def test_fewer_views_than_a_batch(scene):
    sketch, cameras = scene
    pyramid = build_pyramid(cameras, store_of(ds.render(sketch, cameras).alpha[..., None]), 100, 50, seed=1)
    assert sorted(pyramid.views(17).tolist()) == list(range(7))


def test_only_what_is_known_is_a_target(generator):
    """A picture that fills the top left of its canvas has the pyramid of the picture alone."""
    cameras = ds.orbit([0, 50, 100, 150, 200, 250, 300], 20, 2.5, size=256)
    ink = torch.rand(7, 256, 256, 1, generator=generator)
    # One value as far as the blur reaches on the coarsest level: there the two differ in how noise goes on beyond.
    ink[:, -32:], ink[:, :, -32:] = 0.6, 0.6
    alone = build_pyramid(cameras, store_of(ink), 40, 3, seed=0)
    canvas = torch.zeros(7, 320, 384, 1)
    canvas[:, :256, :256] = ink
    known = torch.zeros(7, 320, 384, dtype=torch.bool)
    known[:, :256, :256] = True
    wide = ds.Cameras(cameras.world_to_camera, cameras.intrinsics, (320, 384))
    padded = build_pyramid(wide, Store(as_bytes(canvas), known), 40, 3, seed=0)
    for step in (0, 10, 20, 39):
        expected, found = alone.targets(step), padded.targets(step)
        side = expected.alpha.shape[1]
        assert found.known[:, :side, :side].all()
        assert found.known.sum() == 3 * side * side
        # Eight bits.
        torch.testing.assert_close(found.alpha[:, :side, :side], expected.alpha, rtol=0, atol=1.01 / 255)
        torch.testing.assert_close(
            padded.cameras(step, torch.Generator()).intrinsics, alone.cameras(step, torch.Generator()).intrinsics
        )
        assert (found.alpha[~found.known] == 0).all()
