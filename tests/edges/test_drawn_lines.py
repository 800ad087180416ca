"""Lines as people draw them: chance told from evidence, gaps closed, ends brought to lines, scraps left out."""

import math

import numpy as np
import pytest
import torch
from edge_scenes import (
    around,
    both,
    distance_to_segment,
    image_line,
    lines_between,
    ridges_along,
    segment,
    texture,
    views_of,
)

from diff3ds.curves.shapes.curve_set import concatenated, sampled
from diff3ds.curves.shapes.smooth_joints import sketch_of, smooth_joints
from diff3ds.edges.clean.simplify import Gaps, joined
from diff3ds.edges.drawn.gaps import contradicted
from diff3ds.edges.drawn.junctions import with_junctions
from diff3ds.edges.drawn.whole_lines import likely, without_scraps
from diff3ds.edges.evidence.chance import LEAST, Chance, chance_near, told
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.first import carve as carve_module

CAMERAS = around()


def test_the_chance_is_the_share_of_places_whose_ridges_run_that_way():
    """Level lines 20 pixels apart: 5 of 20 rows lie within 2.5 pixels of one; lines across are never confirmed."""
    rows = np.arange(10, 128, 20.0)
    lines = [image_line(np.stack([np.linspace(0, 128, 300), np.full(300, row)], 1), CAMERAS.size) for row in rows]
    points, normals = (np.concatenate([p[k] for p in lines]) for k in (0, 1))
    views = edge_views(CAMERAS[[0]], [Ridges.sharp(points, normals, np.ones(len(points)))])
    chance = Chance.of(views)
    middle = np.full((1, 1, 2), 64.0)
    assert chance.at(middle, np.array([[[1.0, 0.0]]])).item() == pytest.approx(0.25, abs=0.06)
    assert chance.at(middle, np.array([[[-1.0, 0.0]]])).item() == pytest.approx(0.25, abs=0.06)
    assert chance.at(middle, np.array([[[0.0, 1.0]]])).item() == pytest.approx(LEAST)
    # So near, whatever the direction.
    assert chance_near(views, 0, 2.5)[64, 64] == pytest.approx(0.25, abs=0.06)


def test_what_chance_shows_as_often_is_evidence_of_nothing():
    shown = np.arange(40)[:, None] < 20
    asked = np.ones((40, 1), bool)
    often, rare = (told(shown, np.full((40, 1), share), 0.35, asked) for share in (0.5, 0.05))
    # Closed forms: p = .35 * .85 + .65 c, 20 times log p/c and 20 times log (1 - p)/(1 - c).
    for share, found in ((0.5, often), (0.05, rare)):
        p = 0.35 * 0.85 + 0.65 * share
        assert found.item() == pytest.approx(20 * math.log(p / share) + 20 * math.log((1 - p) / (1 - share)))
    assert often.item() < 0 < 20 < rare.item()
    assert told(shown, np.full((40, 1), 0.05), 0.35, ~asked).item() == 0


def test_edges_before_texture_stay_and_what_texture_makes_up_goes():
    """Views with nothing but texture confirm chance lines as often as any; a line that is there they show all."""
    real = segment((-0.5, 0.1, 0.0), (0.5, 0.1, 0.1))
    views = edge_views(CAMERAS, both(texture(CAMERAS, 0), ridges_along(CAMERAS, [real])))
    rng = np.random.default_rng(3)
    made_up = [
        (a, a + 0.3 * b / np.linalg.norm(b))
        for a, b in zip(rng.uniform(-0.4, 0.4, (30, 3)), rng.normal(size=(30, 3)), strict=True)
    ]
    curves = concatenated(lines_between(((-0.5, 0.1, 0.0), (0.5, 0.1, 0.1))), lines_between(*made_up))
    found = likely(curves, Chance.of(views))
    assert len(found) <= 3
    assert torch.equal(found.points[0], curves.points[0])


def test_gaps_are_closed_but_where_pictures_show_that_nothing_is_there():
    """The pictures show all of the line, or only both of its pieces."""
    pieces = lines_between(((-0.6, 0, 0), (-0.15, 0, 0)), ((0.15, 0, 0), (0.6, 0, 0)))
    whole = Chance.of(views_of(CAMERAS, [segment((-0.6, 0, 0), (0.6, 0, 0))]))
    apart = Chance.of(views_of(CAMERAS, [segment((-0.6, 0, 0), (-0.15, 0, 0)), segment((0.15, 0, 0), (0.6, 0, 0))]))
    ends = np.array([-0.15, 0, 0]), np.array([0.15, 0, 0])
    assert not contradicted(whole, *ends)
    assert contradicted(apart, *ends)
    for chance, count in ((whole, 1), (apart, 2)):
        gaps = Gaps(30.0, 1.0, lambda one, other, chance=chance: not contradicted(chance, one, other))
        assert len(joined(pieces, chance.views.pixel, gaps=gaps)) == count
    # What is not asked for is not closed.
    assert len(joined(pieces, whole.views.pixel)) == 2


def test_ends_meet_the_lines_that_they_nearly_meet():
    """A T whose foot ends 3 pixels before the bar, an L whose legs do, and a line that passes far away."""
    chance = Chance.of(views_of(CAMERAS, [segment((-0.6, 0, 0), (0.6, 0, 0)), segment((0.1, 0, 0), (0.1, 0.5, 0))]))
    pixel = chance.views.pixel
    bar, foot = ((-0.6, 0, 0), (0.6, 0, 0)), ((0.1, 3 * pixel, 0.5 * pixel), (0.1, 0.5, 0))
    found = with_junctions(lines_between(bar, foot), chance)
    assert np.allclose(sampled(found)[1, 0], (0.1, 0, 0), atol=pixel / 3)
    assert np.allclose(sampled(found)[0, [0, -1]], bar, atol=1e-6)

    leg = ((0.6 + 3 * pixel, 3 * pixel, 0), (0.6 + 3 * pixel, 0.5, 0))
    found = with_junctions(lines_between(bar, leg), chance)
    ends = sampled(found)[:, [0, -1]]
    assert np.allclose(ends[0, 1], ends[1, 0], atol=1e-6)
    assert np.allclose(ends[0, 1], (0.6 + 3 * pixel, 0, 0), atol=pixel)
    assert int(found.vertex[0, 1]) == int(found.vertex[1, 0])

    # Of long lines an end reaches 40 pixels, the 30 before the bar, which nothing contradicts, but not 45.
    for off, reached in ((30, True), (45, False)):
        foot = ((0.1, off * pixel, 0), (0.1, off * pixel + 1.6, 0))
        found = with_junctions(lines_between(bar, foot), chance)
        assert np.allclose(sampled(found)[1, 0], (0.1, 0 if reached else off * pixel, 0), atol=pixel / 3)

    far = ((0.1, 0.5, 0), (0.1, 0.9, 0))
    assert torch.equal(with_junctions(lines_between(bar, far), chance).points, lines_between(bar, far).points)


def test_short_lines_that_hang_free_go_and_what_they_held_as_well():
    chance = Chance.of(views_of(CAMERAS, [segment((-0.6, 0, 0), (0.6, 0, 0))]))
    bar = ((-0.6, 0, 0), (0.6, 0, 0))
    held = ((0.6, 0, 0), (0.6, 0.04, 0))
    scrap, twig = ((0, 0.5, 0), (0.06, 0.5, 0)), ((0.06, 0.5, 0), (0.06, 0.53, 0))
    curves = lines_between(bar, held, scrap, twig)
    found = without_scraps(curves, chance)
    assert torch.equal(found.points, curves.points[:2])


def test_a_line_goes_on_through_a_junction_where_it_is_straight():
    curves = lines_between(((-1, 0, 0), (0, 0, 0)), ((0, 0, 0), (1, 0.05, 0)), ((0, 0, 0), (0, 1, 0)))
    curves = type(curves)(curves.points, curves.kind, torch.tensor([[0, 1], [1, 2], [1, 3]]))
    assert len(smooth_joints(curves)) == 0
    assert smooth_joints(curves, through=True).tolist() == [[1, 2]]
    assert len(sketch_of(curves, 0.01)) == 3
    assert len(sketch_of(curves, 0.01, through=True)) == 2


def test_of_too_many_cells_those_stay_that_are_least_likely_chance(monkeypatch):
    """A line before texture: more views confirm cells of nothing than of the line, but no more than chance would."""
    real = segment((-0.5, 0.1, 0.0), (0.5, 0.1, 0.1))
    views = edge_views(CAMERAS, both(texture(CAMERAS, 0, 90), ridges_along(CAMERAS, [real])))
    shares = []
    for bound in (1e9, 1.5):
        monkeypatch.setattr(carve_module, "CELLS_A_PLACE", bound)
        cells = carve_module.carve(views, 1.0, 1.7 * views.pixel, 5.0)
        shares.append((distance_to_segment(cells, real[0], real[-1]) < 2 * views.pixel).mean())
    assert shares[1] > 4 * shares[0]
