"""Coloured sketches: where a fit starts, what it finds, and that it repeats."""

import math
from collections import deque
from dataclasses import replace

import pytest
import torch

import diff3ds as ds
from diff3ds.optimize.fit import fit
from diff3ds.pictures.content.visual_hull import Hull
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.store import store_of
from diff3ds.tasks.views.color_fit.color_sketch import FIRST, LEAST, MOST, color_scores, plan_color, strokes_on
from diff3ds.tasks.views.views_options import ViewsOptions


def truth():
    """Two crossing bars, one of them half transparent."""
    points = torch.tensor([[[-0.8, 0, -0.3], [0.8, 0, -0.3]], [[0.0, -0.8, 0.2], [0.0, 0.8, 0.4]]])
    color = torch.tensor([[0.9, 0.2, 0.1], [0.1, 0.3, 0.8]])
    return ds.Sketch(points, width=0.3, color=color, opacity=torch.tensor([1.0, 0.5]), width_space="world")


@pytest.fixture(scope="module")
def pictures():
    """Of these bars from all around, small, with alpha."""
    cameras = ds.orbit([137.508 * i for i in range(20)], [-40 + 5.0 * i for i in range(20)], 3.0, fov=45, size=48)
    drawn = ds.render(truth(), cameras, background=0.0)
    store = store_of(torch.cat([drawn.color, drawn.alpha[..., None]], -1))
    return PosedPictures(cameras, "color", store, tuple(f"{i}.png" for i in range(20)))


def run(plan, config=None):
    """The last sketch of a fit."""
    (last,) = deque(fit(plan.start, plan.objective, plan.pyramid.cameras, config or plan.config), maxlen=1)
    return last.sketch


def test_strokes_lie_along_the_hull(generator):
    points = torch.nn.functional.normalize(torch.randn(500, 3, generator=generator), dim=1)
    hull = Hull(points, points, points.abs(), 1e-3, 4 * math.pi)
    for count in (40, 700):
        sketch = strokes_on(hull, count, generator)
        assert len(sketch) == count
        centers = sketch.points.mean(1)
        distance, nearest = torch.cdist(centers, points).min(1)
        assert distance.max() < 1e-3
        along = sketch.points[:, -1] - sketch.points[:, 0]
        assert (along * points[nearest]).sum(1).abs().median() < 1e-5
        # Together they are as large as the surface.
        assert float((along.norm(dim=1) * sketch.width).sum()) == pytest.approx(4 * math.pi, rel=1e-4)
        assert torch.equal(sketch.color, points.abs()[nearest])


def test_colour_shape_and_transparency_are_found(pictures):
    plan = plan_color(pictures, ViewsOptions(strokes=40, steps=250), None)
    assert len(plan.start) == round(FIRST * 40)
    found = run(plan)
    assert len(found) == 40
    assert found.width_space == "world"
    scores = color_scores(plan.frame.to_world(found), plan, None)
    # A blank sheet has less than 15 dB.
    assert scores["psnr"] > 28
    assert scores["ssim"] > 0.9
    drawn = ds.render(plan.frame.to_world(found), pictures.cameras).alpha
    assert float((drawn - pictures.batch(range(20)).alpha).square().mean().sqrt()) < 0.06


def test_the_number_of_strokes_is_looked_for_between_64_and_1024(pictures):
    plan = plan_color(pictures, ViewsOptions(steps=100), None)
    (density,) = plan.config.refinements
    assert len(plan.start) == LEAST == density.least == 64
    assert density.most == MOST == 1024


@pytest.mark.slow
def test_the_number_of_strokes_is_found_between_limits(pictures):
    """Two bars need no more strokes than there are at the start; the tolerance decides."""
    plan = plan_color(pictures, ViewsOptions(steps=100), None)
    (density,) = plan.config.refinements
    strict = replace(plan.config, refinements=[replace(density, tolerance=0.0, most=100)])
    loose = replace(plan.config, refinements=[replace(density, tolerance=1.0)])
    assert len(run(plan, strict)) == 100
    assert len(run(plan, loose)) <= LEAST


@pytest.mark.slow
def test_a_plain_background_is_not_drawn(pictures):
    """The same pictures, opaque on gray, which is found at their borders."""
    batch = pictures.batch(range(20))
    color = batch.pixels[..., :3] + (1 - batch.alpha[..., None]) * 0.4
    gray = replace(pictures, store=store_of(torch.cat([color, torch.ones_like(color[..., :1])], -1)))
    plan = plan_color(gray, ViewsOptions(strokes=40, steps=250), None)
    torch.testing.assert_close(plan.background, torch.full((3,), 0.4), rtol=0, atol=2e-3)
    found = run(plan)
    assert color_scores(plan.frame.to_world(found), plan, None)["psnr"] > 28
    outside = ds.render(plan.frame.to_world(found), gray.cameras).alpha[batch.alpha == 0]
    assert outside.mean() < 0.02


@pytest.mark.slow
def test_a_broken_run_goes_on_as_if_unbroken(pictures, tmp_path):
    """Through the changes of the number of strokes, bit for bit."""
    options = ViewsOptions(strokes=24, steps=60)
    whole = run(plan_color(pictures, options, tmp_path / "whole"))
    plan = plan_color(pictures, options, tmp_path / "broken")
    steps = fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config)
    counts = [len(next(steps).sketch) for _ in range(14)]
    steps.close()
    assert len(set(counts)) > 1
    resumed = run(plan_color(pictures, replace(options, resume=True), tmp_path / "broken"))
    assert len(resumed) == 24
    for name, value in whole.tensors().items():
        assert torch.equal(value, getattr(resumed, name)), name


def test_the_background_is_an_option(pictures):
    with pytest.raises(ValueError, match="background must be white, black or R,G,B"):
        ViewsOptions(background="pink")
    plan = plan_color(pictures, ViewsOptions(strokes=8, steps=2, background="0,0.5,1"), None)
    assert plan.background.tolist() == [0.0, 0.5, 1.0]
    # Pictures with an alpha of their own keep it, and are fitted and scored over the colour.
    assert plan.pictures is pictures
    blank = replace(plan.start[:1], opacity=torch.zeros(1))
    scores = color_scores(blank, plan, None)
    wanted = pictures.batch(range(20))
    error = wanted.pixels[..., :3] - wanted.alpha[..., None] * plan.background
    assert scores["psnr"] == pytest.approx(float((-10 * error.square().mean((1, 2, 3)).log10()).mean()), rel=1e-5)
