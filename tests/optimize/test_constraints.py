"""Fits that see the sketch, whose rates have schedules, and whose strokes keep to constraints."""

import pytest
import torch

import diff3ds as ds
from diff3ds import Chains, FitConfig, Rates, Sketch, constraints, losses

CAMERAS = ds.orbit([0, 90], 30, 4, size=24)


def strokes(count: int = 3) -> Sketch:
    g = torch.Generator().manual_seed(0)
    return Sketch(0.5 * torch.randn(count, 4, 3, generator=g), width=0.1)


def darken(image, cameras, step):
    return -image.alpha.mean()


def fitted(sketch: Sketch, objective=darken, **options) -> Sketch:
    config = FitConfig(**({"steps": 4, "rates": Rates(points=0.05, color=0.05)} | options))
    *_, last = ds.fit(sketch, objective, CAMERAS, config)
    return last.sketch


def test_an_objective_with_a_sketch_is_handed_it():
    seen = []

    def short(image, cameras, step, sketch):
        seen.append(sketch.points.requires_grad)
        return losses.lengths(sketch).sum() + 0 * image.alpha.sum()

    start = strokes()
    assert losses.lengths(fitted(start, short)).sum() < losses.lengths(start).sum() - 0.1
    assert seen == [True] * 4


def test_rates_may_be_functions_of_the_step():
    asked = []

    def rate(step: int) -> float:
        asked.append(step)
        return 0.1 if step == 0 else 0.0

    one, whole = fitted(strokes(), steps=1, rates=Rates(points=rate)), fitted(strokes(), rates=Rates(points=rate))
    assert torch.equal(one.points, whole.points)
    assert not torch.equal(one.points, strokes().points)
    assert asked == [0, 0, 1, 2, 3]


def test_a_run_with_a_schedule_goes_on_from_its_checkpoint(tmp_path):
    options = {"rates": Rates(points=lambda step: 0.1 / (1 + step)), "checkpoint": tmp_path / "c"}
    whole = fitted(strokes(), **options)
    (tmp_path / "c").unlink()
    run = ds.fit(strokes(), darken, CAMERAS, FitConfig(steps=4, **options))
    next(run), next(run)
    run.close()
    assert torch.equal(fitted(strokes(), resume=True, **options).points, whole.points)
    with pytest.raises(ValueError, match="rate of points"):
        fitted(strokes(), checkpoint=tmp_path / "c", resume=True)


def test_fixed_strokes_stay():
    start = strokes()
    end = fitted(start, constraints=[constraints.fixed(start, [0, 2])])
    assert torch.equal(end.points[[0, 2]], start.points[[0, 2]])
    assert torch.equal(end.color[[0, 2]], start.color[[0, 2]])
    assert (end.points[1] - start.points[1]).abs().max() > 0.05


def test_strokes_on_a_plane():
    start = strokes()
    end = fitted(start, constraints=[constraints.on_plane(start, [1], (0.0, 0.0, 2.0), offset=0.5)])
    assert end.points[1, :, 2].tolist() == pytest.approx([0.5] * 4, abs=1e-6)
    assert end.points[0, :, 2].std() > 0.01


def test_mirrored_strokes_are_images():
    start = strokes(4)
    end = fitted(start, constraints=[constraints.mirrored(start, [0, 1], [2, 3], (1.0, 0.0, 0.0))])
    flipped = end.points[:2] * torch.tensor([-1.0, 1.0, 1.0])
    assert torch.allclose(end.points[2:], flipped, atol=1e-6)
    assert torch.equal(end.color[2:], end.color[:2])
    assert (end.points[:2] - start.points[:2]).abs().max() > 0.05


def test_constraints_compose_and_know_chains():
    g = torch.Generator().manual_seed(1)
    chains = Chains.of([2, 2, 1])
    start = Sketch(chains.joined(0.5 * torch.randn(5, 4, 3, generator=g)), width=0.1, chains=chains)
    rules = [constraints.mirrored(start, [0], [1], (0.0, 1.0, 0.0)), constraints.fixed(start, [2])]
    end = fitted(start, constraints=rules)
    assert torch.allclose(end.points[2:4], end.points[:2] * torch.tensor([1.0, -1.0, 1.0]), atol=1e-6)
    assert torch.equal(end.points[4], start.points[4])


@pytest.mark.parametrize("closed", [False, True])
def test_smooth_joints_stay_smooth(closed):
    g = torch.Generator().manual_seed(2)
    points = ds.bezier.catmull_rom(0.6 * torch.randn(6, 3, generator=g), closed)
    # One joint is a corner, and stays free.
    points[2, 2] += torch.tensor([0.1, 0.2, -0.1])
    chains = Chains.of([len(points)], closed)
    start = Sketch(points, width=0.1, chains=chains)

    def turns(sketch: Sketch) -> torch.Tensor:
        ends, starts = chains.joints
        before = sketch.points[ends, 3] - sketch.points[ends, 2]
        after = sketch.points[starts, 1] - sketch.points[starts, 0]
        across = torch.linalg.vector_norm(torch.linalg.cross(before, after), dim=-1)
        return across / (before.norm(dim=-1) * after.norm(dim=-1))

    end = fitted(start, constraints=[constraints.smooth(start)])
    free = fitted(start)
    assert (turns(start) > 0.01).tolist() == (turns(end) > 0.01).tolist() == [k == 2 for k in range(len(turns(start)))]
    assert (turns(free) > 0.01).sum() > 3
    assert (end.points - start.points).abs().max() > 0.05


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda s: constraints.fixed(s, [3]), IndexError, r"strokes must be indices from 0 to 2, got \[3\]"),
        (lambda s: constraints.fixed(s, [0.5]), TypeError, "strokes must be whole numbers"),
        (lambda s: fitted(s, constraints=[lambda moved: None]), TypeError, "must return a Sketch, got NoneType"),
        (
            lambda s: fitted(s, rates=Rates(points=lambda step: -1.0)),
            ValueError,
            "the rate of points in step 0 must be a finite number",
        ),
        (lambda s: constraints.on_plane(s, [0], (0.0, 0.0, 0.0)), ValueError, "normal must be three numbers"),
        (lambda s: constraints.mirrored(s, [0, 1], [2], (1.0, 0, 0)), ValueError, "as many images as originals"),
        (lambda s: constraints.mirrored(s, [0], [0], (1.0, 0, 0)), ValueError, "all different"),
        (
            lambda s: FitConfig(constraints=[constraints.fixed(s, [0])], refinements=[ds.NoiseDeletion()]),
            ValueError,
            "cannot be combined",
        ),
    ],
)
def test_what_does_not_fit_is_refused(make, error, message):
    with pytest.raises(error, match=message):
        make(strokes())
