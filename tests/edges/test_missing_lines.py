"""Lines between vertices that the first look missed, and lines with a gap."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import around, lines_between, ridges_along, segment, turned, views_of

from diff3ds.curves.shapes.primitives import Kind
from diff3ds.edges.complete.missing_lines import bridged
from diff3ds.edges.reconstruct import confirming

CAMERAS = around(24, 160)
MIN_VIEWS = confirming(len(CAMERAS))
TILT = turned(5)
CORNERS = 0.4 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) @ TILT.T
EDGES = [(i, k) for i in range(8) for k in range(i) if bin(i ^ k).count("1") == 1]


def cube(edges, share=((0.0, 1.0),)):
    """Lines along edges of the cube, or the given parts of the first one; the corners are vertices 0 to 7."""
    a, b = (CORNERS[i] for i in edges[0])
    parts = [(a + s * (b - a), a + t * (b - a)) for s, t in share]
    curves = lines_between(*parts, *((CORNERS[i], CORNERS[k]) for i, k in edges[1:]))
    vertex = torch.tensor([[100 + 2 * n, 101 + 2 * n] for n in range(len(parts))] + [list(e) for e in edges[1:]])
    vertex[0, 0], vertex[len(parts) - 1, 1] = edges[0][0], edges[0][1]
    return replace(curves, vertex=vertex)


def looked_at(shown=None):
    """The ridges of the whole cube, and the views of them."""
    lines = [segment(CORNERS[i], CORNERS[k]) for i, k in EDGES]
    return ridges_along(CAMERAS, lines, shown), views_of(CAMERAS, lines, shown)


def ends_of(curves):
    """Pairs of vertices."""
    return {tuple(sorted(pair)) for pair in curves.vertex.tolist()}


@pytest.mark.parametrize("missing", [0, pytest.param(5, marks=pytest.mark.slow), 11])
def test_an_edge_between_known_corners_is_found(missing):
    ridges, views = looked_at()
    curves = cube([edge for n, edge in enumerate(EDGES) if n != missing])
    found = bridged(curves, CAMERAS, views, ridges, MIN_VIEWS)
    assert ends_of(found) == {tuple(sorted(edge)) for edge in EDGES}
    assert (found.kind == Kind.LINE).all()
    assert torch.equal(found.points[:11], curves.points)


@pytest.mark.parametrize(("hidden", "count"), [(0.15, 12), (0.24, 11)])
def test_a_line_may_be_hidden_for_a_part(hidden, count):
    """Between the few points that are looked at first."""
    lines = [segment(CORNERS[i], CORNERS[k]) for i, k in EDGES]
    missing = lines.pop()
    start, stop = 0.5 - hidden / 2, 0.5 + hidden / 2
    at = np.linspace(0, 1, len(missing))
    lines += [missing[at < start], missing[at > stop]]
    ridges, views = ridges_along(CAMERAS, lines), views_of(CAMERAS, lines)
    assert len(bridged(cube(EDGES[:-1]), CAMERAS, views, ridges, MIN_VIEWS)) == count


def test_a_line_with_a_gap_becomes_one():
    ridges, views = looked_at()
    found = bridged(cube(EDGES, ((0.0, 0.4), (0.55, 1.0))), CAMERAS, views, ridges, MIN_VIEWS)
    assert len(found) == 12
    assert ends_of(found) == {tuple(sorted(edge)) for edge in EDGES}


def test_what_too_few_views_show_is_no_edge():
    shown = np.ones((len(CAMERAS), 12), bool)
    shown[4:, 3] = False
    ridges, views = looked_at(shown)
    curves = cube([edge for n, edge in enumerate(EDGES) if n != 3])
    assert bridged(curves, CAMERAS, views, ridges, MIN_VIEWS) is curves


def test_a_complete_drawing_stays():
    ridges, views = looked_at()
    curves = cube(EDGES)
    assert bridged(curves, CAMERAS, views, ridges, MIN_VIEWS) is curves


@pytest.mark.parametrize(("turn", "count"), [(0.0, 4), (1.0, 5)])
def test_no_line_starts_where_two_curves_meet_smoothly(turn, count):
    """An outline of a rounded edge runs between such places."""
    ridges, views = looked_at()
    across, up = TILT @ [0, 0.2, 0], TILT @ [0, 0, 0.2 * turn]
    lines = [part for c in CORNERS[[0, 4]] for part in ((c - across, c), (c, c + across + up))]
    curves = replace(lines_between(*lines), vertex=torch.tensor([[20, 0], [0, 21], [22, 4], [4, 23]]))
    assert len(bridged(curves, CAMERAS, views, ridges, MIN_VIEWS)) == count


def test_nothing_to_join():
    ridges, views = looked_at()
    assert len(bridged(lines_between(), CAMERAS, views, ridges, MIN_VIEWS)) == 0
