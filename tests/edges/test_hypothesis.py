"""Proposed curves against views of which it is known what they show."""

import numpy as np
import pytest
from edge_scenes import around, ridges_along, segment, turned

from diff3ds.edges.complete.hypothesis import Hypothesis, fraction_shown, pieces_of
from diff3ds.edges.evidence.edge_views import edge_views

CAMERAS = around(12, 160)
U, V, _ = turned(3)
START, STOP = -0.6 * U, 0.6 * U


@pytest.fixture(scope="module")
def views():
    """All twelve views show the first half of a segment, five of them the second half too."""
    halves = [segment(START, 0 * U), segment(0 * U, STOP)]
    return edge_views(CAMERAS, ridges_along(CAMERAS, halves, np.stack([np.ones(12, bool), np.arange(12) < 5], 1)))


def test_the_views_that_show_a_curve_are_counted_at_its_sample_points(views):
    x = segment(START, STOP, 40)
    # Along the edge, 1.5 pixels beside it, and across it: one call for all three.
    aside = x + 1.5 * views.pixel * V
    across = segment(-0.6 * V, 0.6 * V, 40)
    three = Hypothesis.through(np.stack([x, aside, across]))
    shown = three.shown(views)
    assert shown.shape == (12, 3, 40)
    # Away from where the halves meet and end.
    inner = np.abs(np.abs(x @ U) - 0.35) < 0.15
    first, second = inner & (x @ U < 0), inner & (x @ U > 0)
    assert (shown.sum(0)[0, first] == 12).all()
    assert (shown.sum(0)[0, second] == 5).all()
    assert fraction_shown(shown, 4)[0] > 0.95
    assert fraction_shown(shown, 8)[0] == pytest.approx(0.5, abs=0.06)
    assert fraction_shown(shown, 13)[0] == 0
    assert fraction_shown(shown, 4)[2] < 0.2
    # As many views are asked at each sample point as can show it.
    assert fraction_shown(shown[:, 0], np.where(x @ U < 0, 10.0, 4.0)) > 0.95
    # What lies 1.5 pixels beside the ridges is told from it by a narrower bound.
    near = three.shown(views, 1.0)
    assert fraction_shown(near, 4)[0] > 0.95
    assert fraction_shown(shown, 4)[1] > 0.95
    assert fraction_shown(near, 4)[1] < 0.5


def test_curves_along_a_path_are_pieces_of_it():
    path = segment(START, STOP, 400)
    within = segment(0.1 * U, 0.4 * U, 50)
    # Sticking out by 10 and by 40 % of its length, beside the path, and across it.
    tenth, much = segment(0.4 * U, 0.62 * U, 50), segment(0.3 * U, 0.8 * U, 50)
    samples = np.stack([within, tenth, much, within + 0.014 * V, within + 0.016 * V, segment(-0.2 * V, 0.2 * V, 50)])
    assert pieces_of(path, samples, 0.01).tolist() == [True, True, False, True, False, False]
    assert pieces_of(path, samples, 0.01, within=1.0).tolist() == [True, True, False, False, False, False]
    assert pieces_of(path, samples, 0.01, fraction=1.0).tolist() == [True, False, False, True, False, False]
