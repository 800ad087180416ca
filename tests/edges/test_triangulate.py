"""Carving and triangulation against segments in space with exact ridges."""

import numpy as np
import pytest
from edge_scenes import around, distance_to_segment, ridges_along, segment, views_of
from scipy.spatial import cKDTree

from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.first.carve import CELLS_A_PLACE, HALF_DIAGONAL, carve, most_cells
from diff3ds.edges.first.triangulate import EdgePoints, thinned, triangulate
from diff3ds.render.backends import available_backends, set_num_threads

CAMERAS = around(24, 96)
ENDS = [
    ((-0.6, -0.5, 0.3), (0.5, 0.6, -0.4)),
    ((0.2, -0.6, -0.6), (-0.3, 0.4, 0.7)),
    ((0.5, 0.5, 0.5), (0.5, -0.5, 0.6)),
]
ENDS = [np.array(pair) for pair in ENDS]
LINES = [segment(*pair) for pair in ENDS]
REACH, CELL = 1.0, 1.7


def found_in(views, min_views):
    """What carving and triangulation find, and the cells."""
    cells = carve(views, REACH, CELL * views.pixel, min_views)
    return triangulate(views, cells, 0.9 * min_views), cells


@pytest.fixture(scope="module", params=[1.0, 0.5], ids=["seen by all", "hidden in half of the views"])
def scene(request):
    shown = np.random.default_rng(3).permuted(np.arange(24 * 3).reshape(24, 3) % 2 < 2 * request.param - 0.5, axis=0)
    if request.param == 1:
        shown[:] = True
    return views_of(CAMERAS, LINES, shown), 12 if request.param == 1 else 7


def test_cells_hold_the_edges(scene):
    views, min_views = scene
    cells = carve(views, REACH, CELL * views.pixel, min_views)
    # No point of an edge is farther from a cell's centre than its half diagonal.
    assert cKDTree(cells).query(np.concatenate(LINES))[0].max() <= HALF_DIAGONAL * CELL * views.pixel
    # Cells are those of a grid, and each comes once.
    grid = (cells + REACH) / (CELL * views.pixel) - 0.5
    np.testing.assert_allclose(grid, grid.round(), rtol=0, atol=1e-6)
    assert len(np.unique(grid.round(), axis=0)) == len(cells)
    # Most of space is carved away.
    assert len(cells) < 0.05 * (2 * REACH / (CELL * views.pixel)) ** 3


def test_points_lie_on_the_edges_and_run_along_them(scene):
    views, min_views = scene
    found, _ = found_in(views, min_views)
    away = np.stack([distance_to_segment(found.points, *pair) for pair in ENDS], 1)
    on = away.min(1) < 0.2 * views.pixel
    # At the ends planes go on for a little; nothing else is found.
    assert on.mean() > 0.95
    assert away.min(1).max() < 4 * views.pixel
    headings = np.stack([(b - a) / np.linalg.norm(b - a) for a, b in ENDS])[away.argmin(1)]
    assert np.abs((headings * found.directions).sum(1))[on].min() > 0.99
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1, rtol=0, atol=1e-9)
    # All of the edges are found.
    assert (cKDTree(found.points).query(np.concatenate(LINES))[0] < 1.2 * views.pixel).mean() > 0.98


def test_any_number_of_copies_of_the_process_finds_the_same(scene):
    views, min_views = scene
    found = []
    try:
        for threads in (1, 3):
            set_num_threads(threads)
            points, cells = found_in(views, min_views)
            found.append((cells, points.points, points.directions, points.scores))
    finally:
        set_num_threads(None)
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without the compiled kernels")
@pytest.mark.parametrize("most", [None, 300])
def test_cells_that_the_kernel_keeps_are_those_of_numpy(scene, most, monkeypatch):
    views, min_views = scene
    if most:
        monkeypatch.setattr("diff3ds.edges.first.carve.most_cells", lambda *_: most)
    found = carve(views, REACH, CELL * views.pixel, min_views)
    monkeypatch.setattr("diff3ds.edges.first.carve.kernels", lambda: None)
    assert len(found) == (most or len(found)) > 0
    np.testing.assert_array_equal(carve(views, REACH, CELL * views.pixel, min_views), found)


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without the compiled kernels")
def test_points_that_the_kernel_moves_lie_where_numpy_moves_them(scene, monkeypatch):
    views, min_views = scene
    found = [found_in(views, min_views)[0]]
    # As without the kernels, from the same cells.
    monkeypatch.setattr("diff3ds.edges.first.triangulate.kernels", lambda: None)
    found.append(found_in(views, min_views)[0])
    one, other = found
    assert len(one) == len(other) > 100
    np.testing.assert_allclose(one.points, other.points, rtol=0, atol=1e-9)
    np.testing.assert_allclose(one.scores, other.scores, rtol=0, atol=1e-7)
    np.testing.assert_allclose(np.abs((one.directions * other.directions).sum(1)), 1, rtol=0, atol=1e-9)


def test_scores_count_the_views_that_agree(scene):
    views, min_views = scene
    found, _ = found_in(views, min_views)
    shows = 24 if min_views == 12 else 12
    assert found.scores.min() >= 0.9 * min_views
    # A view that agrees counts up to 1; other lines pass by in a view or two.
    assert 0.7 * shows < np.median(found.scores) < 1.1 * shows


def test_random_ridges_agree_on_nothing():
    rng = np.random.default_rng(0)
    ridges = []
    for _ in range(24):
        lines = [rng.uniform(8, 88, (2, 2)) for _ in range(4)]
        points = np.concatenate([np.linspace(a, b, 60) for a, b in lines])
        normals = np.repeat([[(b - a)[1], -(b - a)[0]] / np.linalg.norm(b - a) for a, b in lines], 60, axis=0)
        ridges.append(Ridges.sharp(points, normals, np.ones(len(points))))
    found, _ = found_in(edge_views(CAMERAS, ridges), 12)
    assert len(found) == 0


def test_nothing_to_start_from():
    views = views_of(CAMERAS, LINES)
    assert len(triangulate(views, np.zeros((0, 3)), 3.0)) == 0
    assert len(carve(views, REACH, CELL * views.pixel, 25)) == 0


def points_along(line, direction, scores):
    return EdgePoints(line, np.tile(np.asarray(direction, float), (len(line), 1)), np.asarray(scores, float))


def test_thinned_keeps_the_best_of_neighbours_and_no_flank():
    along = np.stack([np.arange(0, 10, 0.25), np.zeros(40), np.zeros(40)], 1)
    edge = points_along(along, (1, 0, 0), 10 + np.arange(40) % 4)
    flank = points_along(along + np.array([0, 0.8, 0]), (1, 0, 0), np.full(40, 9.0))
    crossing = points_along(along[:, [1, 0, 2]] + np.array([4.3, 2, 0]), (0, 1, 0), np.full(40, 9.0))
    every = EdgePoints(*(np.concatenate([getattr(p, n) for p in (edge, flank, crossing)]) for n in vars(edge)))
    kept = thinned(every, 0.5, 1.2)
    gaps = cKDTree(kept.points).query(kept.points, k=2)[0][:, 1]
    assert gaps.min() > 0.5
    # The best of every four points of the edge stay, and what is beside it goes, but not the crossing line.
    assert sorted(kept.points[kept.scores == 13][:, 0]) == (0.75 + np.arange(10)).tolist()
    assert not (kept.points[:, 1] == 0.8).any()
    assert (kept.points[:, 1] >= 2).sum() >= 13
    assert (np.diff(kept.scores) <= 0).all()
    assert len(thinned(every[np.zeros(120, bool)], 0.5, 1.2)) == 0


def test_work_grows_with_the_ridges():
    """Of random lines, twice as many have twice the cells to look at, however many places chance confirms."""
    rng = np.random.default_rng(5)
    looked_at, capped = [], []
    for count in (100, 200, 400):
        ridges = [_random_lines(rng, count) for _ in range(24)]
        views = edge_views(CAMERAS, ridges)
        cells = carve(views, REACH, CELL * views.pixel, 8, capped=lambda *about: capped.append(about))
        assert len(cells) <= most_cells(views, 8) == int(CELLS_A_PLACE * count * 24 / 8)
        looked_at.append(len(cells))
    # At last there are more than the ridges account for, and it is said.
    assert capped[-1][:2] == ("cells of space", looked_at[-1])
    assert capped[-1][2] > looked_at[-1]


def _random_lines(rng, count):
    turn = rng.uniform(0, np.pi, count)
    return Ridges.sharp(rng.uniform(6, 90, (count, 2)), np.stack([np.cos(turn), np.sin(turn)], 1), np.ones(count))


def test_the_best_confirmed_cells_are_kept():
    """Where more stay than the ridges account for, those with most views do: of an edge among noise, the edge's."""
    rng = np.random.default_rng(6)
    clean = ridges_along(CAMERAS, LINES[:1])
    noisy = [
        Ridges.sharp(*(np.concatenate(pair) for pair in zip(_parts(a), _parts(b), strict=True)))
        for a, b in zip(clean, [_random_lines(rng, 400) for _ in clean], strict=True)
    ]
    views = edge_views(CAMERAS, noisy)
    told = []
    cells = carve(views, REACH, CELL * views.pixel, 8, capped=lambda *about: told.append(about))
    assert told
    assert cKDTree(cells).query(LINES[0])[0].max() <= HALF_DIAGONAL * CELL * views.pixel


def _parts(ridges):
    return ridges.points, ridges.normals, ridges.values
