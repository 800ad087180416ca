"""Ridges of images against lines, circles and steps whose places are known."""

import numpy as np
import pytest
import torch
from edge_scenes import project

import diff3ds as ds
from diff3ds.edges.evidence.ridges import (
    BORDER,
    COLOR_SIGMA,
    Ridges,
    color_ridges,
    color_tops,
    find_ridges,
    map_ridges,
    narrowed,
    strongest,
    unshrunk,
    within,
    without_faint,
)

SIZE = 96
FRONT = ds.look_at(torch.tensor([[3.0, 0.0, 0.0]]), fov=60, size=SIZE)
# Pixels a unit at the origin, and a line of two pixels.
SCALE = float(FRONT.intrinsics[0, 0, 0]) / 3
WIDTH = 2 / SIZE


def drawn(points, weights=None):
    """A drawing on black, two pixels wide."""
    return ds.render(ds.Sketch(points, weights, width=WIDTH), FRONT).alpha[0].numpy()


@pytest.mark.parametrize("angle", [0.0, 7.0, 30.0, 45.0, 73.0, 90.0])
@pytest.mark.parametrize("offset", [0.0, 0.31, 0.5])
def test_a_straight_line_is_found_between_pixels(angle, offset):
    a = np.deg2rad(angle)
    along, across = np.array([0, np.cos(a), np.sin(a)]), np.array([0, -np.sin(a), np.cos(a)])
    ends = np.stack([-4 * along, 4 * along]) + across * offset / SCALE
    found = map_ridges(drawn(torch.tensor(ends[None], dtype=torch.float32)))
    (start, stop), _ = (v[0] for v in project(FRONT, ends))
    heading = (stop - start) / np.linalg.norm(stop - start)
    normal = np.array([heading[1], -heading[0]])
    off = (found.points - start) @ normal
    # Steger's own figure for single points; along oblique lines the pixels' phases average out.
    assert np.abs(off).max() < 0.2
    assert abs(off.mean()) < (0.05 if angle % 90 == 0 else 0.02)
    assert np.abs(found.normals @ normal).min() > 0.999
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, rtol=0, atol=1e-12)
    # No gaps, not even where the line runs right between two pixels.
    along = np.sort((found.points - start) @ heading)
    assert np.diff(along).max() < 1.5
    assert np.ptp(along) > SIZE - 15


@pytest.mark.parametrize("offset", np.linspace(0, 1, 8, endpoint=False))
def test_wide_lines_that_are_cut_off_at_white_have_no_gaps(offset):
    # White over 2.4 pixels, half as bright over 4.9.
    y = np.mgrid[:48, :400][0] + 0.5
    ink = np.minimum(1, 1.25 * np.exp(-0.5 * ((y - 24 - offset) / 1.8) ** 2))
    ink = np.clip(ink + 0.03 * np.random.default_rng(0).normal(size=ink.shape), 0, 1)
    found = map_ridges(ink.astype(np.float32))
    columns = np.unique(np.floor(found.points[:, 0]))
    assert len(columns) > 0.98 * (400 - 2 * BORDER)
    assert np.abs(found.points[:, 1] - 24 - offset).max() < 0.5
    # White cuts the noise off on one side.
    assert abs(found.points[:, 1].mean() - 24 - offset) < 0.1


def test_dots_are_no_lines():
    """Their tops fall off alike to all sides, on the grid exactly so: they have no direction."""
    y, x = np.mgrid[:48, :48]
    square = ((np.abs(x - 24) <= 1) & (np.abs(y - 24) <= 1)).astype(np.float32)
    disc = (np.hypot(x - 24, y - 24) < 9).astype(np.float32)
    for image in (square, disc, square + np.roll(disc, 12)):
        found = map_ridges(np.minimum(image, 1))
        np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, rtol=0, atol=1e-12)


@pytest.mark.parametrize("radius", [5.0, 8.0, 20.0])
def test_a_small_circle_keeps_its_radius(radius):
    center = np.array([0.0, 0.3, -0.2]) / SCALE
    points, weights = ds.bezier.circle(center.tolist(), radius / SCALE, (1, 0, 0), dtype=torch.float32)
    found = map_ridges(drawn(points, weights))
    middle = project(FRONT, center[None])[0][0, 0]
    away = np.linalg.norm(found.points - middle, axis=1)
    # Smoothing by one pixel alone moves it in by 1 / (2 radius).
    assert away.mean() == pytest.approx(radius, abs=0.03)
    # Nothing on its flanks.
    assert np.abs(away - radius).max() < 0.25
    angle = np.sort(np.arctan2(*(found.points - middle).T))
    assert np.diff(angle).max() * radius < 2


def covered(angle, offset, samples=16):
    """Share of every pixel on one side of a line, with the line's normal and place."""
    fine = (np.arange(SIZE * samples) + 0.5) / samples - SIZE / 2
    normal = np.array([np.cos(angle), np.sin(angle)])
    side = fine[None] * normal[0] + fine[:, None] * normal[1] > offset
    return side.reshape(SIZE, samples, SIZE, samples).mean((1, 3)).astype(np.float32), normal


@pytest.mark.parametrize("angle", [0.0, 0.4, 0.785, 2.1])
@pytest.mark.parametrize("alpha", [False, True])
def test_the_edge_between_colours_or_of_the_outline_is_found(angle, alpha):
    share, normal = covered(angle, 0.37)
    image = np.ones((SIZE, SIZE, 4), np.float32)
    if alpha:
        image[..., :3], image[..., 3] = 0, share
    else:
        image[..., :3] = np.array([0.2, 0.5, 0.4]) + share[..., None] * np.array([0.3, -0.1, 0.2])
    found = color_ridges(image)
    assert len(found) > SIZE - 20
    off = (found.points - SIZE / 2) @ normal - 0.37
    assert np.abs(off).max() < 0.25
    # An upright outline is found in the columns on both sides of it, in every row alike: half of a column's share off.
    assert abs(off.mean()) < (0.125 if alpha and angle == 0 else 0.02)
    assert np.abs(found.normals @ normal).min() > 0.99
    along = np.sort((found.points - SIZE / 2) @ [-normal[1], normal[0]])
    assert np.diff(along).max() < 1.5
    assert np.ptp(along) > SIZE - 15


def test_an_even_picture_has_no_ridges():
    assert len(map_ridges(np.full((32, 32), 0.5, np.float32))) == 0
    assert len(color_ridges(np.full((32, 32, 4), 0.5, np.float32))) == 0


def test_values_and_the_least_of_them():
    image = drawn(torch.tensor([[[0.0, -4, 0], [0, 4, 0]]]))
    strong, weak = find_ridges(image, 1.0, 0.0), find_ridges(0.5 * image, 1.0, 0.0)
    np.testing.assert_allclose(weak.points, strong.points, rtol=0, atol=1e-5)
    np.testing.assert_allclose(weak.values, 0.5 * strong.values, rtol=1e-5)
    assert len(find_ridges(0.5 * image, 1.0, float(strong.values.min()))) == 0


def test_within_keeps_what_is_far_from_the_unknown():
    found = map_ridges(drawn(torch.tensor([[[0.0, -4, 0.0], [0, 4, 0.0]]])))
    known = np.ones((SIZE, SIZE), bool)
    known[:, :40] = False
    kept = within(found, known)
    right = found.points[:, 0]
    assert right[np.isin(right, kept.points[:, 0])].min() > 41
    assert (right > 50).sum() == (kept.points[:, 0] > 50).sum()
    assert len(within(found, np.ones((SIZE, SIZE), bool))) == len(found)


def test_faint_ridges_go_whatever_view_they_are_in():
    def ridges(*values):
        count = len(values)
        return Ridges.sharp(np.arange(2.0 * count).reshape(-1, 2), np.tile([1.0, 0.0], (count, 1)), np.array(values))

    kept = without_faint([ridges(1.0, 0.9, 0.1), ridges(0.05), ridges(0.8, 1.0), ridges()])
    assert [r.values.tolist() for r in kept] == [[1.0, 0.9], [], [0.8, 1.0], []]
    assert [len(r) for r in without_faint([ridges(), ridges()])] == [0, 0]


def test_the_strongest_are_kept_by_one_bound_for_all_views():
    values = [np.array([5.0, 1.0, 4.0]), np.array([2.0, 0.5]), np.zeros(0)]
    ridges = [Ridges.sharp(np.zeros((len(v), 2)), np.zeros((len(v), 2)), v) for v in values]
    assert [r.values.tolist() for r in strongest(ridges, 3)] == [[5, 4], [2], []]
    assert [len(r) for r in strongest(ridges, 5)] == [3, 2, 0]


def test_broad_lines_are_narrowed_about_their_middles():
    """Two soft lines of HED's breadth, one of them faint, have no ridges as they are; thin lines stay as they are."""
    x = np.arange(SIZE) + 0.5
    profile = np.exp(-((x - 30.3) ** 2) / 50) + 0.6 * np.exp(-((x - 66.1) ** 2) / 50)
    ink = np.tile(profile.astype(np.float32), (SIZE, 1))
    assert len(map_ridges(ink)) == 0
    found = map_ridges(narrowed(ink, 12.5))
    first = found.points[:, 0] < SIZE / 2
    np.testing.assert_allclose(found.points[first, 0], 30.3, atol=0.1)
    np.testing.assert_allclose(found.points[~first, 0], 66.1, atol=0.1)
    np.testing.assert_allclose(np.median(found.values[first]) / np.median(found.values[~first]), 1 / 0.6, rtol=0.02)
    assert narrowed(ink, 4.0) is ink


def test_of_the_strongest_alone_the_pull_is_what_it_is_among_all():
    rgba = np.ones((64, 64, 4), np.float32)
    column, row = np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5)
    rgba[..., :3] = np.where(np.hypot(column - 30, row - 33) < 17, 0.2, 0.9)[..., None]
    rgba[20:40, 40:60, 1] = 0.5
    tops, ridges = color_tops(rgba), color_ridges(rgba)
    strong = strongest([tops], len(tops) // 2)[0]
    found, expected = unshrunk(strong, COLOR_SIGMA, tops), ridges[np.isin(tops.values, strong.values)]
    assert np.array_equal(found.points, expected.points)
    assert np.array_equal(found.pulls, expected.pulls)
    assert np.abs(found.pulls).max() > 0
