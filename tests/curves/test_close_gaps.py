"""Gaps between ends of strokes."""

import pytest
import torch

import diff3ds as ds
from diff3ds.curves.close_gaps import close_gaps


def lines(*ends) -> ds.Sketch:
    """Straight cubics between pairs of points."""
    pairs = torch.tensor(ends, dtype=torch.float32)
    share = torch.linspace(0, 1, 4)[:, None]
    return ds.Sketch(pairs[:, :1] * (1 - share) + pairs[:, 1:] * share)


@pytest.mark.slow
def test_ends_that_nearly_meet_meet_half_way():
    found = close_gaps(lines([(0, 0, 0), (1, 0, 0)], [(1.04, 0, 0.02), (2, 0, 0)]), 0.05).points
    middle = torch.tensor([1.02, 0, 0.01])
    torch.testing.assert_close(found[0, -1], middle)
    torch.testing.assert_close(found[1, 0], middle)
    # Straight strokes stay straight, and far ends where they were.
    torch.testing.assert_close(found[0], torch.linspace(0, 1, 4)[:, None] * middle)
    torch.testing.assert_close(found[1, -1], torch.tensor([2.0, 0, 0]))


def test_an_end_near_a_stroke_lands_on_it():
    found = close_gaps(lines([(0, 0, 0), (2, 0, 0)], [(0.7, 0.04, 0), (0.7, 1, 0)]), 0.05).points
    torch.testing.assert_close(found[1, 0], torch.tensor([0.7, 0, 0]), rtol=0, atol=1e-6)
    torch.testing.assert_close(found[0], lines([(0, 0, 0), (2, 0, 0)]).points[0])


def test_three_ends_become_one_and_a_loop_closes():
    corner = close_gaps(
        lines([(0.02, 0, 0), (1, 0, 0)], [(0, 0.02, 0), (0, 1, 0)], [(0, 0, 0.02), (0, 0, 1)]), 0.05
    ).points[:, 0]
    torch.testing.assert_close(corner, torch.full((3, 3), 0.02 / 3))
    loop = ds.Sketch(
        torch.tensor(
            [[[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0.03, 0, 0]], [[5.0, 0, 0], [6, 0, 0], [7, 0, 0], [8, 0, 0]]]
        )
    )
    closed = close_gaps(loop, 0.05).points[0]
    torch.testing.assert_close(closed[0], closed[-1])


def test_a_stroke_that_goes_on_may_be_twice_as_far():
    found = close_gaps(lines([(0, 0, 0), (1, 0, 0)], [(1.08, 0.01, 0), (2, 0, 0)]), 0.05).points
    torch.testing.assert_close(found[0, -1], torch.tensor([1.04, 0.005, 0]))
    torch.testing.assert_close(found[1, 0], torch.tensor([1.04, 0.005, 0]))
    # Parallel lines side by side, and a corner, are none.
    for other in ([(0, 0.08, 0), (1, 0.08, 0)], [(1, 0.08, 0), (1, 1, 0)]):
        sketch = lines([(0, 0, 0), (1, 0, 0)], other)
        assert torch.equal(close_gaps(sketch, 0.05).points, sketch.points)


def test_what_is_farther_apart_stays():
    sketch = lines([(0, 0, 0), (1, 0, 0)], [(1.11, 0, 0), (2, 0, 0)], [(0.5, 0.06, 0), (0.5, 1, 0)])
    assert torch.equal(close_gaps(sketch, 0.05).points, sketch.points)
    assert torch.equal(close_gaps(sketch[:1], 0.05).points, sketch[:1].points)
