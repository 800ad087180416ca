"""Of curves that the same ridges show one stays, and so many at most, those that show most."""

import numpy as np
import pytest
import torch
from edge_scenes import around, box_edges, lines_between, segment, turned, views_of

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import concatenated
from diff3ds.edges.clean.own_ridges import with_own_ridges
from diff3ds.edges.drawn.whole_lines import likelier
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.watch import not_said

CAMERAS = around(24, 128)
BOX = box_edges([0.5, 0.4, 0.6], turned())
EDGES = lines_between(*((line[0], line[-1]) for line in BOX))


def test_all_edges_of_a_box_stay_in_their_order():
    views = views_of(CAMERAS, BOX)
    assert torch.equal(with_own_ridges(EDGES, views, 99, not_said).points, EDGES.points)


def test_doubles_and_pieces_of_an_edge_go():
    views = views_of(CAMERAS, BOX)
    doubles = lines_between(*((line[20], line[150] + 0.3 * views.pixel) for line in BOX))
    found = with_own_ridges(concatenated(doubles, EDGES), views, 99, not_said)
    assert torch.equal(found.points, EDGES.points)


def test_of_a_line_at_every_depth_one_stays():
    """Cameras in one plane with a line cannot say how far away it is."""
    cameras = ds.look_at(torch.tensor([[0.3 * k, 3.0, 0.0] for k in range(-4, 5)]), fov=45, size=128)
    views = views_of(cameras, [segment((-0.5, 0, 0), (0.5, 0, 0))])
    bundle = lines_between(*(((-0.4 * s, y, 0), (0.4 * s, y, 0)) for y in np.linspace(-0.2, 0.2, 9) for s in (1, 0.8)))
    assert len(with_own_ridges(bundle, views, 99, not_said)) == 1


@pytest.mark.parametrize("most", [1, 4])
def test_so_many_at_most_those_that_show_most(most):
    views, said = views_of(CAMERAS, BOX), []
    found = with_own_ridges(EDGES, views, most, lambda *what: said.append(what))
    assert said == [("curves", most, 12)]
    # The four longest edges.
    assert torch.allclose((found.points[:, 3] - found.points[:, 0]).norm(dim=1), torch.full((most,), 1.2))


def test_of_nothing_nothing_is_left():
    views = views_of(CAMERAS, BOX)
    assert len(with_own_ridges(EDGES[torch.zeros(12, dtype=torch.bool)], views, 5, not_said)) == 0
    away = lines_between(((5, 5, 5), (6, 6, 6)))
    assert len(with_own_ridges(away, views, 5, not_said)) == 0


def test_curves_that_are_moved_off_their_edges_return():
    chance = Chance.of(views_of(CAMERAS, BOX))
    shift = torch.zeros(12, 1, 1)
    shift[[2, 7]] = 6 * chance.views.pixel
    moved = EDGES.moved(EDGES.points + shift)
    assert torch.allclose(likelier(EDGES, moved, chance).points, EDGES.points, atol=1e-6)
    assert torch.allclose(likelier(moved, EDGES, chance).points, EDGES.points, atol=1e-6)
