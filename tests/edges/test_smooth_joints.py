"""Curves as strokes: closed ones and those that go on smoothly in each other, on drawings whose strokes are known."""

import math

import numpy as np
import pytest
import torch
from edge_scenes import circular_arc, whole

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of
from diff3ds.curves.shapes.primitives import Kind, Primitive, line_control
from diff3ds.curves.shapes.smooth_joints import sketch_of, smooth_joints

WIDTH = 0.02
X, Y = np.eye(3)[:2]


def line(start, stop):
    return Primitive(Kind.LINE, line_control(np.array([*start, 0.0]), np.array([*stop, 0.0])), np.zeros(0))


def arc(center, radius, start, stop):
    """In the plane z = 0, angles in degrees."""
    return circular_arc((*center, 0.0), radius * X, radius * Y, math.radians(start), math.radians(stop))


def drawing(*primitives, seed=3) -> Curves:
    """The curves with ends that lie together as one vertex, in an order and in directions that say nothing."""
    generator = np.random.default_rng(seed)
    order = generator.permutation(len(primitives))
    curves = curves_of([primitives[i] for i in order])
    flip = torch.from_numpy(generator.random(len(curves)) < 0.5)
    points = torch.where(flip[:, None, None], curves.points.flip(1), curves.points)
    ends = (points[:, [0, 3]].reshape(-1, 3) * 1e4).round()
    _, vertex = torch.unique(ends, dim=0, return_inverse=True)
    return Curves(points, curves.kind, vertex.reshape(-1, 2))


def made_of(curves: Curves) -> list[tuple[int, bool]]:
    """Segments of each stroke of the sketch, and whether it is closed."""
    sketch = sketch_of(curves, WIDTH)
    chains = sketch.chains or ds.Chains.plain(len(sketch))
    return sorted(zip(chains.counts.tolist(), chains.closed.tolist(), strict=True))


def rounded_rectangle(width=1.2, height=0.8, radius=0.2):
    """Four lines and four quarters of circles."""
    w, h = width / 2, height / 2
    corners = [(w - radius, h - radius, 0), (radius - w, h - radius, 90), (radius - w, radius - h, 180)]
    corners.append((w - radius, radius - h, 270))
    arcs = [arc((x, y), radius, turn, turn + 90) for x, y, turn in corners]
    ends = [(a.control[3, :2], b.control[0, :2]) for a, b in zip(arcs, [*arcs[1:], arcs[0]], strict=True)]
    return [*arcs, *(line(*pair) for pair in ends)]


SLOT = [line((-0.5, -0.2), (0.5, -0.2)), arc((0.5, 0), 0.2, -90, 90), line((0.5, 0.2), (-0.5, 0.2))]
SLOT.append(arc((-0.5, 0), 0.2, 90, 270))


@pytest.mark.parametrize(
    ("primitives", "expected"),
    [
        (SLOT, [(4, True)]),
        (rounded_rectangle(), [(8, True)]),
        # Without one of its lines it is open, and so is a fillet between lines.
        (rounded_rectangle()[:-1], [(7, False)]),
        ([line((1, 0), (0.3, 0)), arc((0.3, 0.3), 0.3, 180, 270), line((0, 0.3), (0, 1))], [(3, False)]),
        # Two halves of a circle that came as arcs.
        ([arc((0, 0), 1, 0, 170), arc((0, 0), 1, 170, 360)], [(2, True)]),
        # Corners stay apart: of a square, and the one of a drop.
        ([line((0, 0), (1, 0)), line((1, 0), (1, 1)), line((1, 1), (0, 1)), line((0, 1), (0, 0))], [(1, False)] * 4),
        ([arc((0, 0), 1, 0, 180), line((1, 0), (0, -1.5)), line((0, -1.5), (-1, 0))], [(1, False)] * 3),
        # A stroke may begin and end in one corner.
        ([arc((0, 1), 1, 180, 360), arc((0, 1), 1, 0, 90), line((0, 2), (-1, 1))], [(1, False), (2, False)]),
        # They meet, but turn back.
        ([arc((1, 0), 1, 90, 180), arc((-1, 0), 1, 0, 90)], [(1, False)] * 2),
        ([line((0, 0), (1, 0)), line((2, 0), (3, 0))], [(1, False)] * 2),
        ([], []),
    ],
)
def test_what_meets_smoothly_is_one_stroke(primitives, expected):
    assert made_of(drawing(*primitives)) == expected


@pytest.mark.parametrize("seed", range(6))
def test_where_three_meet_all_stay_apart(seed):
    """Also the two that go straight on, in whatever order they come."""
    rays = [line((-1, 0), (0, 0)), line((0, 0), (1, 0)), line((0, 0), (0, 1))]
    assert made_of(drawing(*rays, seed=seed)) == [(1, False)] * 3


@pytest.mark.parametrize(("turn", "strokes"), [(0, 1), (15, 1), (25, 2), (90, 2), (175, 2)])
def test_lines_join_up_to_twenty_degrees(turn, strokes):
    a = math.radians(turn)
    curves = drawing(line((-1, 0), (0, 0)), line((0, 0), (math.cos(a), math.sin(a))))
    assert len(sketch_of(curves, WIDTH)) == strokes
    assert len(smooth_joints(curves)) == 2 - strokes


def test_a_stroke_of_several_curves_keeps_each_of_them():
    curves = drawing(*rounded_rectangle())
    sketch = sketch_of(curves, WIDTH)
    assert (sketch.width == WIDTH).all()
    assert (sketch.color == 0).all()
    given, weights = curves.segments(curves.points)
    for points, weight in zip(sketch.points, sketch.weights, strict=True):
        same = ((given - points).abs().amax((1, 2)) < 1e-6) | ((given - points.flip(0)).abs().amax((1, 2)) < 1e-6)
        assert same.sum() == 1
        torch.testing.assert_close(weight, weights[same][0])
    # The first curve keeps its direction, and the joints are the same points to the bit.
    assert torch.equal(sketch.points[0], given[0])
    assert torch.equal(sketch.points[:, 3], sketch.points[:, 0].roll(-1, 0))


@pytest.mark.parametrize(("kind", "b"), [(Kind.CIRCLE, 1.0), (Kind.ELLIPSE, 0.6)])
def test_a_closed_curve_is_one_closed_stroke_and_draws_the_same(kind, b):
    closed = curves_of([whole((0.1, -0.2, 0.3), 0.5 * X, 0.5 * b * Y, kind)])
    curves = concatenated(closed, drawing(line((-1, 0.8), (1, 0.9))))
    sketch = sketch_of(curves, WIDTH)
    assert (len(sketch), sketch.chains.counts.tolist(), sketch.chains.closed.tolist()) == (2, [2, 1], [True, False])
    cameras = ds.orbit([20, 140], 40, 3, size=96)
    exact = sketch.to(torch.float64)
    one, two = (ds.render(drawn, cameras).alpha for drawn in (exact, exact.segments()))
    # The two ends of the halves are caps on one another: only there pixels are covered twice.
    seams = ds.project(ds.Sketch(sketch.points[:2, [0, 0]], width=4 * WIDTH), cameras)
    near = torch.zeros_like(one, dtype=torch.bool)
    y, x = torch.meshgrid(torch.arange(96) + 0.5, torch.arange(96) + 0.5, indexing="ij")
    for view, dots in enumerate(seams.cubics):
        for dot in dots:
            u, v = (dot[0, :2] / dot[0, 2]).tolist()
            near[view] |= torch.hypot(x - u, y - v) < 4
    assert near.float().mean() < 0.02
    torch.testing.assert_close(one[~near], two[~near], rtol=0, atol=1e-6)
    assert one.sum() > 100


def test_both_joints_of_a_circle_are_the_same_point_to_the_bit():
    """Its second half is a reflection, which rounding leaves a little off."""
    places = np.random.default_rng(0).normal(size=(20, 3))
    halves = sketch_of(curves_of([whole(place, X, Y) for place in places]), WIDTH).points.reshape(20, 2, 4, 3)
    assert torch.equal(halves[:, 0, 3], halves[:, 1, 0])
    assert torch.equal(halves[:, 1, 3], halves[:, 0, 0])


def test_curves_that_close_on_themselves():
    control = torch.tensor([[0.0, 0, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 0]])
    teardrop = Curves(control[None], torch.tensor([int(Kind.FREE)]), torch.zeros(1, 2, dtype=torch.int64))
    assert made_of(teardrop) == [(1, False)]
    control = torch.tensor([[0.0, 0, 0], [1, 0, 0], [-1, 0.05, 0], [0, 0, 0]])
    loop = Curves(control[None], torch.tensor([int(Kind.FREE)]), torch.zeros(1, 2, dtype=torch.int64))
    assert made_of(loop) == [(1, True)]
