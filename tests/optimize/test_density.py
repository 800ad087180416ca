"""Which strokes of a coloured sketch are dropped and halved: scenes in which the answer is known."""

from dataclasses import replace

import pytest
import torch

import diff3ds as ds
from diff3ds.optimize.density import Density, Observation, footprints, halves
from diff3ds.project import project
from diff3ds.render import rasterize

SIZE = 48
# Shares of the steps: changes after steps 50, 100, ... of 1000, of which 49, counted from 0, is the first.
DUE, STEPS = 49, 1000


def bar(y, z=0.0, *, x=0.0, color=(1.0, 0.0, 0.0), length=1.0, **fields):
    """A horizontal stroke at height z in the plane x; the cameras look along -x."""
    ends = [[[x, y - length / 2, z], [x, y + length / 2, z]]]
    return ds.Sketch(torch.tensor(ends), width=fields.pop("width", 0.2), color=color, width_space="world", **fields)


def seen(truth, cameras, known=None, blur=0.0):
    """The pictures of this sketch."""
    drawn = ds.render(truth, cameras, background=0.0, antialiasing=ds.Analytic(blur))
    targets = torch.cat([drawn.color, drawn.alpha[..., None]], -1)
    return Observation(cameras, targets, torch.ones(targets.shape[:3], dtype=torch.bool) if known is None else known)


def density(truth, cameras, **fields):
    """A refinement that wants the pictures of this sketch."""
    observed = seen(truth, cameras)
    return Density(
        observed, lambda step: observed, **({"least": 1, "most": 100, "start": 0.0, "growth": 10.0} | fields)
    )


@pytest.fixture
def front():
    return ds.orbit([0.0], 0.0, 3.0, fov=45, size=SIZE)


def test_footprints_are_shares_of_pixels(front):
    """A half transparent stroke shows half of its pixels; what lies behind it shows the other half."""
    before, behind = bar(0.0, x=0.5, opacity=0.5), bar(0.0, x=-0.5, length=0.6, width=0.1)
    alone = float(ds.render(bar(0.0, x=0.5), front).alpha.sum())
    hidden = float(ds.render(behind, front).alpha.sum())
    shown, _ = footprints(ds.Sketch.concatenate([behind, before]), seen(behind, front))
    assert shown.tolist() == pytest.approx([0.5 * hidden, 0.5 * alone], rel=1e-4)
    opaque = ds.Sketch.concatenate([behind, bar(0.0, x=0.5)])
    assert footprints(opaque, seen(behind, front))[0][0] == pytest.approx(0, abs=1e-4)


def test_errors_count_where_a_stroke_shows(front):
    """A red stroke over blue paint errs by 1 in two of four channels: a half in each of its pixels."""
    red, blue, right = bar(0.0, 0.5), bar(0.0, 0.5, color=(0.0, 0.0, 1.0)), bar(0.0, -0.5)
    observed = seen(ds.Sketch.concatenate([blue, right]), front)
    shown, error = footprints(ds.Sketch.concatenate([red, right]), observed)
    # Where its edge covers a share a of a pixel, the square of the error is a^2 / 2, and the stroke's share a.
    alpha = ds.render(red, front).alpha
    assert float(error[0]) == pytest.approx(float((alpha**3).sum()) / 2, rel=1e-4)
    assert float(shown[0]) == pytest.approx(float(alpha.sum()), rel=1e-4)
    assert float(error[1]) == pytest.approx(0, abs=1e-6)


def test_views_in_many_parts_and_unknown_pixels(generator):
    cameras = ds.orbit([20.0 * i for i in range(11)], 10.0, 3.0, size=SIZE)
    sketch = ds.Sketch.random(6, generator=generator, radius=0.8, width=0.05)
    known = torch.ones(11, SIZE, SIZE, dtype=torch.bool)
    known[4:] = False
    whole = footprints(sketch, seen(bar(0.0), cameras, known))
    for a, b in zip(whole, footprints(sketch, seen(bar(0.0), cameras[:4])), strict=True):
        torch.testing.assert_close(a, b)


def test_what_shows_nothing_goes(front, generator):
    wall = bar(0.0, x=1.0, width=1.0, length=1.5)
    strokes = [wall, bar(0.0), bar(0.0, 1.0, opacity=0.0), bar(0.0, 1.0, width=0.0), bar(9.0)]
    sketch = ds.Sketch.concatenate(strokes)
    edit = density(sketch, front)(DUE, STEPS, sketch, generator)
    assert edit.kept.tolist() == [0]
    assert edit.added is None
    assert density(wall, front)(DUE, STEPS, wall, generator) is None
    # The last one stays, though it shows nothing.
    assert density(wall, front)(DUE, STEPS, bar(9.0), generator) is None


def test_the_worst_are_halved_up_to_the_limit(front, generator):
    truth = ds.Sketch.concatenate([bar(0.0, z, color=(0.0, 0.0, 1.0)) for z in (-0.8, 0.0, 0.8)])
    # Wrong by little, by much, and not at all.
    colors = [(0.0, 0.3, 1.0), (1.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    sketch = ds.Sketch.concatenate([bar(0.0, z, color=c) for z, c in zip((-0.8, 0.0, 0.8), colors, strict=True)])

    def kept(**fields):
        edit = density(truth, front, **fields)(DUE, STEPS, sketch, generator)
        assert edit.added is None or len(edit.added) == 2 * (3 - len(edit.kept))
        return edit.kept.tolist()

    assert kept(tolerance=0.04) == [2]
    assert kept(tolerance=0.4) == [0, 2]
    assert kept(most=4) == [0, 2]
    assert kept(growth=1.1) == [0, 2]
    # The right one is halved as well if there must be more strokes.
    assert kept(least=6) == []
    assert density(truth, front, most=3)(DUE, STEPS, sketch, generator) is None
    assert density(sketch, front)(DUE, STEPS, sketch, generator) is None


def test_after_the_last_step_strokes_go_and_none_is_halved(front, generator):
    """Nothing mends a new half after it; what came to show nothing since the last change would stay for good."""
    wrong, nothing = bar(0.0, color=(0.0, 1.0, 0.0)), bar(0.0, 1.0, opacity=0.0)
    sketch = ds.Sketch.concatenate([wrong, nothing])
    refine = density(bar(0.0), front, end=0.75)
    assert len(refine(DUE, STEPS, sketch, generator).added) == 2
    edit = refine(STEPS - 1, STEPS, sketch, generator)
    assert edit.kept.tolist() == [0]
    assert edit.added is None
    assert refine(STEPS - 1, STEPS, wrong, generator) is None
    assert refine(STEPS - 2, STEPS, sketch, generator) is None


def test_halves_draw_the_same(front):
    sketch = ds.Sketch(
        torch.tensor([[[0.0, -1.0, -0.5], [0.5, 0.0, 1.5], [0.0, 1.0, -0.5]], [[0, -1.0, 0], [0, 0, 0], [0, 1, 0.2]]]),
        torch.tensor([[1.0, 3.0, 1.0], [1.0, 1.0, 1.0]]),
        width=torch.tensor([0.1, 0.05]),
        color=torch.tensor([[0.9, 0.1, 0.2], [0.1, 0.5, 0.2]]),
    )
    both = halves(sketch, torch.tensor([1, 0]))
    assert len(both) == 4
    torch.testing.assert_close(both.width, torch.tensor([0.05, 0.1, 0.05, 0.1]))
    # A half ends where the other begins.
    torch.testing.assert_close(both.points[:2, -1], both.points[2:, 0])
    # At the joint the round ends of both halves cover the border's pixels: there alone the drawing changes.
    joints = both.points[:2, -1].double() @ front.projection[0, :3, :3].T + front.projection[0, :3, 3]
    grid = torch.stack(torch.meshgrid(torch.arange(SIZE), torch.arange(SIZE), indexing="xy"), -1) + 0.5
    apart = ((grid[:, :, None] - joints[:, :2] / joints[:, 2:]).norm(dim=-1) > 3).all(-1)
    assert apart.float().mean() > 0.95
    after, before = (ds.render(s, front).color[0][apart] for s in (both, sketch))
    torch.testing.assert_close(after, before, rtol=0, atol=1e-4)


def test_changes_come_at_even_shares_of_the_steps(front):
    refine = density(bar(0.0), front, start=0.15)
    due = [step + 1 for step in range(1000) if refine.due(step, 1000)]
    assert due == list(range(150, 751, 50))


def test_blurred_targets_are_met_by_blurred_drawings(front):
    observed = seen(bar(0.0), front, blur=1.5)
    assert float(footprints(bar(0.0), observed)[1]) > 1
    assert float(footprints(bar(0.0), replace(observed, blur=1.5))[1]) == pytest.approx(0, abs=1e-9)


def test_errors_are_those_of_the_step(front, generator):
    """What a coarse step cannot see is no reason to halve a stroke."""
    red, blue = bar(0.0), bar(0.0, color=(0.0, 0.0, 1.0))
    pictures = [seen(red, front), seen(blue, front)]
    refine = Density(pictures[1], lambda step: pictures[step >= 200], least=1, most=9, start=0.0)
    assert refine(DUE, STEPS, red, generator) is None
    assert refine(DUE + 200, STEPS, red, generator) is not None


def test_what_errs_most_in_the_details_comes_first(front, generator):
    """Both strokes are wrong in what the step observes, the first more so; in the details the second is."""
    sketch = ds.Sketch.concatenate([bar(0.0, 0.5), bar(0.0, -0.5)])
    much, little = (0.0, 0.0, 1.0), (0.8, 0.0, 0.0)
    coarse, fine = (
        seen(ds.Sketch.concatenate([bar(0.0, 0.5, color=a), bar(0.0, -0.5, color=b)]), front)
        for a, b in ((much, little), (little, much))
    )
    refine = Density(fine, lambda step: coarse, least=1, most=3, start=0.0)
    assert refine(DUE, STEPS, sketch, generator).kept.tolist() == [0]
    assert replace(refine, details=coarse)(DUE, STEPS, sketch, generator).kept.tolist() == [1]
    # One that the step sees nothing wrong with waits.
    right = seen(ds.Sketch.concatenate([bar(0.0, 0.5, color=much), bar(0.0, -0.5)]), front)
    assert replace(refine, observed=lambda step: right)(DUE, STEPS, sketch, generator).kept.tolist() == [1]


def test_another_way_to_draw_is_used(front, generator):
    """With the depth order turned round, the wall shows nothing and the bar behind it shows."""

    def turned(sketch, cameras):
        strokes = project(sketch, cameras)
        flipped = strokes.cubics.clone()
        flipped[..., 3] = strokes.cubics[..., 2] ** 2
        return type(strokes)(flipped, strokes.half_width, strokes.color, strokes.opacity)

    wall, behind = bar(0.0, x=1.0, width=0.3), bar(0.0, x=0.0, width=0.3, color=(0.0, 0.0, 1.0))
    sketch = ds.Sketch.concatenate([wall, behind])
    shown = footprints(sketch, seen(wall, front))[0]
    other = footprints(sketch, seen(wall, front), turned)[0]
    assert shown[0] > shown[1]
    assert other[1] > other[0]
    drawn = rasterize(turned(sketch, front), SIZE, background=0.0)
    observed = replace(seen(wall, front), targets=torch.cat([drawn.color, drawn.alpha[..., None]], -1))
    refine = Density(observed, lambda step: observed, least=1, most=9, start=0.0, project=turned)
    assert refine(DUE, STEPS, sketch, generator) is None
    assert replace(refine, project=project)(DUE, STEPS, sketch, generator) is not None
