"""Radii that are equal as far as one can tell become equal."""

import numpy as np
import torch
from edge_scenes import circular_arc, turned, whole
from hypothesis import given
from hypothesis import strategies as st

from diff3ds.curves.shapes.curve_set import curves_of, sampled
from diff3ds.curves.shapes.primitives import fit_circle
from diff3ds.edges.measure.equal_radii import SCATTER, agreed, with_equal_circles

PIXEL = 0.01
U, V, _ = turned(2)


def circles(*radii):
    """Whole circles of these radii beside each other."""
    return curves_of([whole(np.array([i, 0, 0.0]), r * U, r * V) for i, r in enumerate(radii)])


def fits(curves):
    """The circle through the points of each curve."""
    return [fit_circle(points) for points in sampled(curves)]


def test_a_series_gets_its_median_and_others_stay():
    np.testing.assert_allclose(agreed([1.01, 5.0, 1.1, 0.9], 0.06), [1.01, 5.0, 1.01, 1.01])
    assert agreed([], 0.1) == []


def test_a_long_slope_is_no_series():
    slope = [0.1 * i for i in range(12)]
    assert np.ptp(agreed(slope, 0.05)) > 0.6


def test_two_series_stay_two_though_the_last_of_one_is_near_the_first_of_the_other():
    """Medians of many are known better than a single radius is."""
    many, few = [15.24, 15.26, 15.32, 15.34, 15.35, 15.4, 15.41, 15.48], [15.58, 15.62]
    found = agreed([*few, *many], 0.1)
    np.testing.assert_allclose(found, [15.6] * 2 + [15.345] * 8)
    # The same distance between single radii says nothing.
    np.testing.assert_allclose(agreed([15.35, 15.6], 0.1), [15.475] * 2)


def test_one_radius_that_is_off_does_not_move_its_series():
    np.testing.assert_allclose(agreed([9.98, 10.0, 10.01, 10.02, 10.35], 0.15), [10.01] * 5)


@given(st.lists(st.floats(0.01, 10), max_size=12), st.floats(1e-3, 1))
def test_series_keep_order_and_median_and_leave_distant_radii(radii, scatter):
    found = agreed(radii, scatter)
    assert len(found) == len(radii)
    for radius in set(found):
        np.testing.assert_allclose(radius, np.median([r for r, f in zip(radii, found, strict=True) if f == radius]))
    pairs = [(i, k) for i in range(len(radii)) for k in range(len(radii)) if radii[i] < radii[k]]
    assert all(found[i] <= found[k] + 1e-12 for i, k in pairs)
    for i, radius in enumerate(radii):
        if all(abs(radius - other) > 30 * scatter for k, other in enumerate(radii) if k != i):
            assert found[i] == radius


def test_circles_keep_their_centres_and_planes():
    wide = SCATTER * PIXEL
    curves = circles(0.2 - wide, 0.2, 0.2 + wide, 0.3)
    before, after = fits(curves), fits(with_equal_circles(curves, PIXEL))
    np.testing.assert_allclose([c.radius for c in after], [0.2, 0.2, 0.2, 0.3], rtol=1e-5)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(one.center, other.center, rtol=0, atol=1e-5)
        assert abs(np.cross(one.u, one.v) @ np.cross(other.u, other.v)) > 1 - 1e-6
        assert other.distances.max() < 1e-6


def test_arcs_and_single_circles_stay():
    one = circles(0.2)
    assert with_equal_circles(one, PIXEL) is one
    arcs = curves_of([circular_arc(np.zeros(3), r * U, r * V, 0, 2) for r in (0.2, 0.2005)])
    assert torch.equal(with_equal_circles(arcs, PIXEL).points, arcs.points)
