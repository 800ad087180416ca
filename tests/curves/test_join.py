"""Strokes that go on in each other become one: on drawings whose strokes are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.curves.join import join_ends, join_smooth


def joined_smooth(sketch: ds.Sketch) -> ds.Sketch:
    return join_smooth(sketch).sketch


def lines(*ends) -> ds.Sketch:
    return ds.Sketch(torch.tensor([[[*map(float, a)], [*map(float, b)]] for a, b in ends]))


def made_of(sketch: ds.Sketch) -> list[tuple[int, bool]]:
    """Segments of each stroke, and whether it is closed."""
    chains = sketch.chains or ds.Chains.plain(len(sketch))
    return sorted(zip(chains.counts.tolist(), chains.closed.tolist(), strict=True))


def half_circles() -> ds.Sketch:
    """Both from (1, 0, 0) to (-1, 0, 0): the second runs against the first."""
    points = torch.tensor([[1.0, 0, 0], [1, 2, 0], [-1, 2, 0], [-1, 0, 0]])
    mirrored = points * torch.tensor([1.0, -1, 1])
    return ds.Sketch(torch.stack([points, mirrored]), torch.tensor([[1, 1 / 3, 1 / 3, 1]] * 2))


def test_two_half_circles_are_a_circle():
    circle = joined_smooth(half_circles())
    assert made_of(circle) == [(2, True)]
    radius = ds.bezier.evaluate(circle.points, circle.weights, torch.linspace(0, 1, 9)).norm(dim=-1)
    assert torch.allclose(radius, torch.ones_like(radius))
    # All around, in one sense.
    assert torch.equal(circle.points[0, -1], circle.points[1, 0])


def shuffled(sketch: ds.Sketch, seed: int) -> ds.Sketch:
    """The segments as strokes of their own, in any order and direction."""
    plain, generator = sketch.segments(), torch.Generator().manual_seed(seed)
    plain = plain[torch.randperm(len(plain), generator=generator)]
    flip = torch.rand(len(plain), generator=generator) < 0.5
    points = torch.where(flip[:, None, None], plain.points.flip(1), plain.points)
    weights = torch.where(flip[:, None], plain.weights.flip(1), plain.weights)
    width = plain.width
    if width.ndim == 2:
        width = torch.where(flip[:, None], width.flip(1), width)
    return replace(plain, points=points, weights=weights, width=width)


def wave(along: bool) -> ds.Sketch:
    """A smooth open curve of seven cubics."""
    t = torch.linspace(0, 5, 8)
    points = ds.bezier.catmull_rom(torch.stack([t - 2.5, t.sin(), 0.3 * (2 * t).cos()], 1))
    width = torch.linspace(0.01, 0.04, 3 * len(points) + 1).unfold(0, 4, 3) if along else 0.02
    return ds.Sketch(points, width=width, chains=ds.Chains.of([len(points)]))


@pytest.mark.parametrize("along", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_the_pieces_of_a_curve_are_put_together_again(along, seed):
    whole = wave(along)
    joined = joined_smooth(shuffled(whole, seed))
    assert made_of(joined) == [(7, False)]
    camera = ds.orbit(70.0, 30.0, 6.0, size=96)
    assert torch.allclose(ds.render(joined, camera).color, ds.render(whole, camera).color, atol=1e-5)


def test_the_two_that_turn_least_go_on_and_corners_stay():
    origin = (0, 0, 0)
    cross = lines(((-1, 0, 0), origin), (origin, (0, 1, 0)), ((1, 0, 0), origin))
    joined = joined_smooth(cross)
    assert made_of(joined) == [(1, False), (2, False)]
    assert joined.points[:2].reshape(-1, 3)[[0, -1]].tolist() == [[-1, 0, 0], [1, 0, 0]]
    fork = lines(((-1, 0, 0), origin), (origin, (1, 0.3, 0)), (origin, (1, 0.05, 0)))
    assert joined_smooth(fork).points[1, 1].tolist() == pytest.approx([1, 0.05, 0])
    assert made_of(joined_smooth(lines(((-1, 0, 0), origin), (origin, (1, 1, 0))))) == [(1, False)] * 2


def test_what_looks_different_or_does_not_meet_stays_apart():
    straight = lines(((-1, 0, 0), (0, 0, 0)), ((0, 0, 0), (1, 0, 0)))
    assert made_of(joined_smooth(straight)) == [(2, False)]
    red = torch.tensor([[1.0, 0, 0], [0, 0, 0]])
    changes = [{"color": red}, {"opacity": torch.tensor([1, 0.5])}, {"width": torch.tensor([0.01, 0.02])}]
    changes.append({"width": torch.tensor([[0.01, 0.02], [0.03, 0.02]])})
    for change in changes:
        assert made_of(joined_smooth(replace(straight, **change))) == [(1, False)] * 2
    gap = lines(((-1, 0, 0), (-0.001, 0, 0)), ((0, 0, 0), (1, 0, 0)))
    assert made_of(joined_smooth(gap)) == [(1, False)] * 2


def test_strokes_of_several_segments_and_closed_ones_are_joined_as_wholes():
    whole = wave(True)
    first, second = whole.segments()[:3], whole.segments()[3:]
    halves = [ds.Sketch(part.points, width=part.width, chains=ds.Chains.of([len(part)])) for part in (first, second)]
    assert made_of(joined_smooth(ds.Sketch.concatenate(halves))) == [(7, False)]
    circle = joined_smooth(half_circles())
    assert made_of(joined_smooth(circle)) == [(2, True)]
    empty = lines(((0, 0, 0), (1, 0, 0)))[:0]
    assert len(joined_smooth(empty)) == 0


def test_ends_are_joined_where_one_says():
    corner = lines(((0, 1, 0), (0, 0, 0)), ((1, 0, 0), (0, 0, 0)))
    joined = join_ends(corner, np.array([[1, 3]])).sketch
    assert made_of(joined) == [(2, False)]
    assert joined.points.tolist() == [[[0, 1, 0], [0, 0, 0]], [[0, 0, 0], [1, 0, 0]]]


@pytest.mark.parametrize("turned", [0, 1])
def test_strokes_of_several_segments_that_run_against_each_other_are_joined(turned):
    whole = wave(False)
    parts = [whole.segments().points[:3], whole.segments().points[3:]]
    parts[turned] = parts[turned].flip(0, 1)
    halves = [ds.Sketch(points, width=0.02, chains=ds.Chains.of([len(points)])) for points in parts]
    joined = joined_smooth(ds.Sketch.concatenate(halves))
    assert made_of(joined) == [(7, False)]
    expected = whole.points if turned else whole.points.flip(0, 1)
    assert torch.allclose(joined.points, expected)


def test_what_each_stroke_is_made_of_comes_in_its_order():
    t = [[0.0, -1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]]
    sketch = ds.Sketch(torch.tensor([[t[0], t[1]], [t[2], t[1]], [t[1], t[3]]]))
    one, made = join_smooth(sketch)
    # The second one is turned round; the third leaves at a right angle.
    assert made == [[0, 1], [2]]
    assert torch.equal(one.points, torch.tensor([[t[0], t[1]], [t[1], t[2]], [t[1], t[3]]]))


def test_gaps_and_turns_are_what_the_caller_says():
    apart = lines(((0, 0, 0), (1, 0, 0)), ((1.001, 0, 0), (2, 0.5, 0)))
    assert len(join_smooth(apart, turn=math.radians(30), gap=0.002).strokes) == 1
    assert len(join_smooth(apart, turn=math.radians(30), gap=0.0005).strokes) == 2
    assert len(join_smooth(apart, turn=math.radians(25), gap=0.002).strokes) == 2
    # Both ends of a speck are near to each other: it is no closed stroke.
    speck = ds.Sketch(torch.tensor([[[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]]))
    assert join_smooth(speck, gap=4e-4).sketch.chains is None


def test_arcs_that_close_are_one_closed_stroke():
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 0.5)
    one, made = join_smooth(ds.Sketch(points, weights))
    assert [len(numbers) for numbers in made] == [len(points)]
    assert one.chains.closed.tolist() == [True]


def test_marks_of_strokes_that_stay_are_kept():
    pieces = wave(True).segments()
    fixed = torch.arange(7) < 3
    joined = join_smooth(replace(pieces, fixed=fixed)).sketch
    assert made_of(joined) == [(3, False), (4, False)]
    assert joined.fixed.tolist() == [True, False]


def test_a_gradient_along_a_row_is_kept_and_rounding_is_none():
    """Neighbours in steps of an eighth of what a display of 8 bits shows, one end to the other of ten."""
    count = 81
    x = torch.linspace(0, 1, count + 1)
    ends = torch.stack([torch.stack([x[k], torch.zeros(()), torch.zeros(())]) for k in range(count + 1)])
    rows = torch.stack([ends[:-1], ends[1:]], 1)
    steps = torch.arange(count)[:, None] / (8 * 255)
    looks = [{"color": 0.5 + steps.expand(-1, 3)}, {"opacity": 0.5 + steps[:, 0]}, {"width": 0.01 * (1 + steps[:, 0])}]
    for look in looks:
        assert len(joined_smooth(ds.Sketch(rows, **look))) == count
    rounded = 0.5 + torch.finfo(torch.float32).eps * (torch.arange(count) % 2)
    assert made_of(joined_smooth(ds.Sketch(rows, color=rounded[:, None].expand(-1, 3)))) == [(count, False)]
