"""Chains followed through unordered edge points."""

import numpy as np
import pytest
from edge_scenes import arc, segment

from diff3ds.curves.shapes.straight_lines import polyline_length
from diff3ds.edges.first.ridge_chains import follow_chains
from diff3ds.edges.first.triangulate import EdgePoints


def edge_points(*lines, scatter=0.0):
    """The points of polylines in random order, with the directions of the lines, of random sign."""
    rng = np.random.default_rng(0)
    points = np.concatenate(lines)
    tangents = np.concatenate([np.gradient(line, axis=0) for line in lines])
    tangents *= rng.choice([-1, 1], len(points))[:, None] / np.linalg.norm(tangents, axis=1, keepdims=True)
    order = rng.permutation(len(points))
    found = EdgePoints(points + scatter * rng.normal(size=points.shape), tangents, rng.uniform(10, 20, len(points)))
    return found[order]


def ends(chain):
    return sorted(np.round(chain[[0, -1]], 6).tolist())


def test_a_line_and_an_arc_far_apart_are_two_chains():
    line = segment((0, 0, 0), (30, 0, 0), 31)
    bow = arc((0, 0, 20), (15, 0, 0), (0, 15, 0), 0, 3, 46)
    chains = sorted(follow_chains(edge_points(line, bow), 1.0, 5.0), key=len)
    assert [len(c) for c in chains] == [31, 46]
    for chain, true in zip(chains, (line, bow), strict=True):
        assert ends(chain) == ends(true)
        # In order along the edge.
        assert polyline_length(chain) == pytest.approx(polyline_length(true), rel=1e-9)


def test_scattered_points_are_one_chain():
    line = segment((0, 0, 0), (40, 10, 5), 60)
    chains = follow_chains(edge_points(line, scatter=0.15), 1.0, 5.0)
    assert len(chains) == 1
    assert np.linalg.norm(chains[0][-1] - chains[0][0]) > 40


def test_lines_that_cross_stay_two():
    chains = follow_chains(
        edge_points(segment((-15, 0.2, 0), (15, 0.2, 0), 31), segment((0.1, -15, 0), (0.1, 15, 0), 31)), 1.0, 5.0
    )
    assert len(chains) == 2
    for chain in chains:
        assert np.ptp(chain, axis=0).min() == 0
        assert np.sort(np.ptp(chain, axis=0))[1] < 1
        assert np.ptp(chain, axis=0).max() == 30


def test_chains_end_at_corners():
    chains = follow_chains(edge_points(segment((0, 0, 0), (20, 0, 0), 21), segment((20, 1, 0), (20, 20, 0), 20)), 1, 5)
    assert len(chains) == 2
    assert all(np.sort(np.ptp(c, axis=0))[1] < 1.5 for c in chains)


def test_short_chains_go():
    short, long = segment((0, 0, 0), (8, 0, 0), 9), segment((0, 20, 0), (12, 20, 0), 13)
    assert len(follow_chains(edge_points(short, long), 1.0, 7.0)) == 2
    assert len(follow_chains(edge_points(short, long), 1.0, 9.0)) == 1
    assert follow_chains(edge_points(short)[np.zeros(9, bool)], 1.0, 5.0) == []
