"""Lines in space against lines through known points."""

import numpy as np

from diff3ds.curves.shapes.straight_lines import (
    meeting,
    nearest_to_lines,
    pairs_by_ends,
    polyline_length,
    resampled,
    unit,
)

PLACE = np.array([0.3, -0.2, 0.5])
WAYS = unit(np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 0.2], [-0.3, 0.1, 1.0]]))


def test_lines_through_one_point_meet_there():
    far, near = ([PLACE + t * way for way in WAYS[:2]] for t in (2.0, 0.7))
    np.testing.assert_allclose(meeting(far, near), PLACE, rtol=0, atol=1e-12)
    # Lines that pass each other at a distance of 0.2: the middle of it.
    across = 0.1 * unit(np.cross(*WAYS[:2]))
    skew = [[p + across, q - across] for p, q in (far, near)]
    np.testing.assert_allclose(meeting(*skew), PLACE, rtol=0, atol=1e-12)
    assert meeting(*skew, 0.21) is not None
    assert meeting(*skew, 0.19) is None
    assert meeting([PLACE, far[0]], [PLACE + WAYS[2], far[0] + WAYS[2]]) is None


def test_the_point_nearest_to_lines_and_to_an_anchor():
    through = PLACE + np.array([[0.5], [-2.0], [1.0]]) * WAYS
    np.testing.assert_allclose(nearest_to_lines(through, WAYS, np.zeros(3), 1e-9), PLACE, rtol=0, atol=1e-8)
    # Of one line: the foot of the anchor, and with a pull of 1 half the way to it.
    anchor = np.array([1.0, 2.0, 0.0])
    axis = np.array([[1.0, 0.0, 0.0]])
    found = nearest_to_lines(np.zeros((1, 3)), axis, anchor, 1.0)
    np.testing.assert_allclose(found, [1.0, 1.0, 0.0], rtol=0, atol=1e-12)


def test_pairs_by_ends():
    ends = np.array(
        [[[0.0, 0, 0], [1, 0, 0]], [[1.05, 0, 0], [2, 0, 0]], [[5, 0, 0], [5.01, 0, 0]], [[2, 0, 0.2], [0, 0, 0.1]]]
    )
    assert pairs_by_ends(ends, 0.15).tolist() == [[0, 1], [0, 3]]
    assert pairs_by_ends(ends, 0.25).tolist() == [[0, 1], [0, 3], [1, 3]]
    assert pairs_by_ends(ends[:0], 1.0).shape == (0, 2)


def test_resampled_lines_keep_their_ends_and_have_even_steps():
    line = np.array([[0, 0, 0], [3, 0, 0], [3, 4, 0.0]])
    even = resampled(line, 0.5)
    assert polyline_length(line) == 7
    assert len(even) == 15
    np.testing.assert_allclose(even[[0, -1]], line[[0, -1]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(np.diff(even, axis=0), axis=1), 0.5, rtol=1e-9)
    np.testing.assert_allclose(resampled(line, 100.0), line[[0, -1]], rtol=0, atol=0)
