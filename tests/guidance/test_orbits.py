"""Cameras drawn around an object."""

import pytest
import torch

from diff3ds.guidance.orbits import Orbits
from diff3ds.guidance.poses import spherical


def drawn(orbits: Orbits, steps: int):
    generator = torch.Generator().manual_seed(0)
    return [spherical(orbits(step, generator)) for step in range(steps)]


def test_the_range_of_the_paper_is_filled():
    azimuth, elevation, distance = (torch.stack(x) for x in zip(*drawn(Orbits(), 400), strict=True))
    for values, low, high in ((azimuth, -180, 180), (elevation, 0, 30), (distance, 1.8, 2.0)):
        margin = 0.01 * (high - low)
        assert low - 1e-3 <= float(values.min()) < low + margin
        assert high - margin < float(values.max()) <= high + 1e-3
    # Views are independent of each other.
    assert abs(float(torch.corrcoef(elevation.T)[0, 1])) < 0.15


def test_views_of_a_group_are_evenly_spaced_and_alike():
    for azimuth, elevation, distance in drawn(Orbits(batch=8, group=4), 20):
        for rows in (slice(0, 4), slice(4, 8)):
            assert torch.allclose(azimuth[rows].diff() % 360, torch.full((3,), 90.0, dtype=azimuth.dtype), atol=1e-3)
            assert float(elevation[rows].std()) < 1e-3
            assert float(distance[rows].std()) < 1e-5
        assert abs(float(elevation[0] - elevation[4])) > 1e-3


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"batch": 6, "group": 4}, "batch must be a multiple of 4, the views of this prior, got 6"),
        ({"batch": 0}, "batch must be a multiple"),
        ({"distance": (2.0, 1.0)}, "distance must be"),
        ({"distance": (0.0, 1.0)}, "distance must be positive"),
        ({"elevation": (0.0, 90.0)}, "elevation in"),
    ],
)
def test_ranges_that_make_no_sense(wrong, message):
    with pytest.raises(ValueError, match=message):
        Orbits(**wrong)
