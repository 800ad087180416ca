"""Lines that grow at loose ends: as far as an edge that is known there, and not into texture."""

import numpy as np
import pytest
import torch
from edge_scenes import around, both, lines_between, ridges_along, segment, texture

from diff3ds.edges.drawn.grown import against_chance, grown
from diff3ds.edges.drawn.whole_lines import whole_lines
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.unexplained import unexplained

CAMERAS = around()
LEFT, MIDDLE, RIGHT, TOP = (-0.6, 0, 0), (0, 0, 0), (0.6, 0, 0), (0.6, 0.5, 0)
# Three lines that say which way is up.
UPRIGHTS = [((x, -0.7, 0.3), (x, -0.3, 0.3)) for x in (-0.4, 0.0, 0.4)]
# [px] A line ends where no ridge is within 2.5 pixels in most views, and some ridge of texture, 9 long, may be there.
BEYOND = 5


def scene(*edges, seed=1, cameras=CAMERAS, shown=None):
    """What the views show by chance of these edges before texture, and what curves leave of it."""
    ridges = both(texture(cameras, seed, 60), ridges_along(cameras, [segment(*edge) for edge in edges], shown))
    views = edge_views(cameras, ridges)
    return Chance.of(views), lambda curves: edge_views(cameras, unexplained(views, ridges, curves))


def ends_of(curves):
    return curves.points.double().numpy()[:, [0, 3]]


def test_a_line_goes_on_as_far_as_its_edge_does():
    chance, rest = scene((LEFT, RIGHT), *UPRIGHTS)
    known = lines_between((LEFT, MIDDLE), *UPRIGHTS)
    loose = np.zeros((4, 2), bool)
    loose[0] = True
    (found,) = ends_of(grown(known, loose, chance, rest(known), 2.0))
    assert found[0] == pytest.approx(MIDDLE, abs=1e-6)
    assert found[1] == pytest.approx(RIGHT, abs=BEYOND * chance.views.pixel)
    # Ends that meet something do not grow.
    loose[0] = False
    assert len(grown(known, loose, chance, rest(known), 2.0)) == 0


def test_a_line_turns_into_a_direction_that_others_share():
    chance, rest = scene((LEFT, RIGHT), (RIGHT, TOP), *UPRIGHTS)
    known = lines_between((LEFT, RIGHT), *UPRIGHTS)
    loose = np.zeros((4, 2), bool)
    loose[0] = True
    (found,) = ends_of(grown(known, loose, chance, rest(known), 2.0))
    assert found[0] == pytest.approx(RIGHT, abs=1e-6)
    assert found[1] == pytest.approx(TOP, abs=BEYOND * chance.views.pixel)
    # Two lines share nothing yet.
    known = lines_between((LEFT, RIGHT), *UPRIGHTS[:2])
    assert len(grown(known, loose[:3], chance, rest(known), 2.0)) == 0


@pytest.mark.parametrize("seed", range(3))
def test_nothing_grows_into_texture(seed):
    """Nor hardly anything where less than chance is enough: as much grows aside, but for the best by luck."""
    chance, rest = scene((LEFT, RIGHT), *UPRIGHTS, seed=seed)
    known = lines_between((LEFT, RIGHT), *UPRIGHTS)
    assert len(grown(known, np.ones((4, 2), bool), chance, rest(known), 2.0)) == 0
    assert len(grown(known, np.ones((4, 2), bool), chance, rest(known), -1.0)) <= 2


def test_nothing_grows_where_nothing_is_left_to_explain():
    """Of clean pictures curves explain all edges; and a line that is a point runs nowhere."""
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [segment(LEFT, RIGHT)]))
    known = lines_between((LEFT, RIGHT), (TOP, TOP))
    nothing = edge_views(CAMERAS, [Ridges.sharp(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)) for _ in CAMERAS])
    assert len(grown(known, np.ones((2, 2), bool), Chance.of(views), nothing, 2.0)) == 0
    assert len(grown(known[torch.tensor([1])], np.ones((1, 2), bool), Chance.of(views), views, 2.0)) == 0


def test_lines_are_drawn_with_what_grows_at_them():
    """Half of a frame's lower side is known, and of its right side nothing: both are whole in the drawing."""
    chance, rest = scene((LEFT, RIGHT), (RIGHT, TOP), *UPRIGHTS)
    known = lines_between((LEFT, MIDDLE), *UPRIGHTS)
    drawn = ends_of(whole_lines(known, chance, lambda curves: curves, rest)).reshape(-1, 3)
    for corner in (LEFT, RIGHT, TOP):
        assert np.linalg.norm(drawn - corner, axis=1).min() < 3 * chance.views.pixel


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("views", "grows"), [(6, True), (4, False)])
def test_of_few_views_not_all_have_to_show_what_grows(seed, views, grows):
    """The second half of a line is seen in some of ten views, which is less than a line of its own has to have."""
    shown = np.ones((10, 5), bool)
    shown[views:, 1] = False
    edges = ((LEFT, MIDDLE), (MIDDLE, RIGHT), *UPRIGHTS)
    chance, rest = scene(*edges, seed=seed, cameras=around(views=10), shown=shown)
    known = lines_between((LEFT, MIDDLE), *UPRIGHTS)
    drawn = ends_of(whole_lines(known, chance, lambda curves: curves, rest)).reshape(-1, 3)
    assert (np.linalg.norm(drawn - RIGHT, axis=1).min() < 3 * chance.views.pixel) == grows


def test_three_grow_for_each_that_chance_makes():
    """Scores of 9 to 1, and of the same moved to two sides, half of which chance makes at one place."""
    score = np.arange(9.0, 0, -1)
    by_chance = np.zeros((2, 9))
    # Two at 4.5 are one by chance, for which three above are enough; four more at 2.5 are three, for which nine are.
    by_chance[:, 0] = 4.5
    assert against_chance(score, by_chance).sum() == 9
    by_chance[:, 1:3] = 2.5
    assert against_chance(score, by_chance).sum() == 9
    # A fourth: of those above 2.5 seven grow, all nine are fewer than three times four.
    by_chance[:, 3] = 2.5
    assert against_chance(score, by_chance).sum() == 7
    by_chance[:, :4] = 8.5
    assert against_chance(score, by_chance).sum() == 1
    assert against_chance(score, np.full((2, 9), 10.0)).sum() == 0
    assert against_chance(-score, np.full((2, 9), -10.0)).sum() == 0
