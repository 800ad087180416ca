"""Bottoms of pockets that only views from above show, each a part of them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import around, lines_between, ridges_along, turned, whole

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.curves.shapes.simplest import simplest
from diff3ds.edges.clean.simplify import joined
from diff3ds.edges.complete.hypothesis import NARROW
from diff3ds.edges.complete.pockets import with_pockets
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.library import member

CAMERAS = around(40, 160)
TILT = turned(6)
HALF, DEPTH = 0.4, 0.25
CORNERS = HALF * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
DOWN = np.array([0, 0, -DEPTH])
EYES = CAMERAS.centers.double().numpy() @ TILT


def square(height=0.0):
    """Four lines around the pocket."""
    corners = CORNERS + np.array([0, 0, height])
    lines = lines_between(*((corners[k] @ TILT.T, corners[(k + 1) % 4] @ TILT.T) for k in range(4)))
    return replace(lines, vertex=torch.tensor([[k, (k + 1) % 4] for k in range(4)]))


def rim_of(height, corners=200):
    """A polyline around the square, one for each side."""
    share = np.linspace(0, 1, corners)[:, None]
    return [a + share * (b - a) + [0, 0, height] for a, b in zip(CORNERS, np.roll(CORNERS, -1, 0), strict=True)]


def circle(height, radius=HALF):
    angle = np.linspace(0, 2 * np.pi, 400)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(400, height)])


def looked_into(rims, bottoms, inside, middles=None):
    """Ridges of rims, which all views show, and of those parts of bottoms that are seen through them.

    Args:
        inside: whether points of the plane of the rims lie within them.
        middles: a point within each bottom, by default the origin.
    """
    middles = np.zeros((len(bottoms), 3)) if middles is None else middles
    lines = []
    for eye in EYES:
        own = [rim @ TILT.T for rim in rims]
        for k, bottom in enumerate(bottoms):
            # From below nothing is seen; from above, what lies beside the bottom's edge by a hundredth.
            beside = bottom + 0.01 * (middles[k] - bottom) * [1, 1, 0]
            share = eye[2] / (eye[2] - beside[:, 2:])
            seen = (eye[2] > 0) & inside(eye + share * (beside - eye))
            runs = np.split(np.arange(len(bottom)), np.nonzero(np.diff(seen.astype(int)))[0] + 1)
            own += [bottom[run] @ TILT.T for run in runs if seen[run[0]] and len(run) > 3]
        lines.append(own)
    return edge_views(CAMERAS, ridges_along(CAMERAS, lines))


def in_square(x):
    return (np.abs(x[:, :2]) < HALF).all(1)


def in_circle(x):
    return np.hypot(x[:, 0], x[:, 1]) < HALF


def test_the_bottom_of_a_square_pocket_is_found():
    views = looked_into(rim_of(0), rim_of(-DEPTH), in_square)
    found = with_pockets(square(), views, 0.0)
    assert len(found) == 8
    assert torch.allclose(found.points[:4], square().points, atol=1e-6)
    assert np.abs(sampled(found)[4:] @ TILT - sampled(square()) @ TILT - DOWN).max() < 0.003


def test_of_photographs_a_bottom_has_to_be_likelier_than_chance_where_views_look_to_it():
    views = looked_into(rim_of(0), rim_of(-DEPTH), in_square)
    found = with_pockets(square(), views, 0.0, chance=Chance.of(views, NARROW))
    assert np.abs(sampled(found)[4:] @ TILT - sampled(square()) @ TILT - DOWN).max() < 0.003
    # Three sides of a bottom are enough where edges are sure, and too few where they are faint.
    three = looked_into(rim_of(0), rim_of(-DEPTH)[:3], in_square)
    assert len(with_pockets(square(), three, 0.0)) == 8
    assert len(with_pockets(square(), three, 0.0, chance=Chance.of(three, NARROW))) == 4


@pytest.mark.slow
def test_of_photographs_nothing_is_a_bottom_where_anything_may_be_chance():
    many = looked_into(rim_of(0), [side for depth in range(1, 31) for side in rim_of(-0.02 * depth)], in_square)
    assert len(with_pockets(square(), many, 0.0)) == 8
    assert len(with_pockets(square(), many, 0.0, chance=Chance.of(many, NARROW))) == 4
    bare = looked_into(rim_of(0), [], in_square)
    assert len(with_pockets(square(), bare, 0.0, chance=Chance.of(bare, NARROW))) == 4


def test_the_bottom_of_a_round_pocket_is_found():
    rim = curves_of([whole(np.zeros(3), HALF * TILT[:, 0], HALF * TILT[:, 1])])
    views = looked_into([circle(0)], [circle(-DEPTH)], in_circle)
    found = with_pockets(rim, views, 0.0)
    assert found.kind.tolist() == [Kind.CIRCLE] * 2
    x = sampled(found)[1:].reshape(-1, 3) @ TILT
    assert np.abs(np.hypot(x[:, 0], x[:, 1]) - HALF).max() < 1e-4
    assert np.abs(x[:, 2] + DEPTH).max() < 0.003


def test_a_hole_without_an_end_stays():
    views = looked_into(rim_of(0), [], in_square)
    curves = square()
    assert with_pockets(curves, views, 0.0) is curves


def test_a_smaller_square_below_is_no_bottom():
    lower = [line * [0.7, 0.7, 1] for line in rim_of(-DEPTH)]
    curves = square()
    assert with_pockets(curves, looked_into(rim_of(0), lower, in_square), 0.0) is curves


def test_a_bottom_that_is_there_stays():
    views = looked_into(rim_of(0), rim_of(-DEPTH), in_square)
    curves = concatenated(square(), square(-DEPTH))
    assert with_pockets(curves, views, 0.0) is curves


def test_pieces_of_a_bottom_go_and_upright_edges_end_there():
    views = looked_into(rim_of(0), rim_of(-DEPTH), in_square)
    uprights = lines_between(*((c @ TILT.T, (c + DOWN) @ TILT.T) for c in CORNERS))
    uprights = replace(uprights, vertex=torch.tensor([[k, 4 + k] for k in range(4)]))
    piece = lines_between(((CORNERS[0] + DOWN) @ TILT.T, (0.4 * CORNERS[0] + 0.6 * CORNERS[1] + DOWN) @ TILT.T))
    vertex = torch.cat([square().vertex, uprights.vertex, torch.tensor([[4, 8]])])
    curves = replace(concatenated(concatenated(square(), uprights), piece), vertex=vertex)
    found = with_pockets(curves, views, 0.0)
    assert len(found) == 12
    names, members = torch.unique(found.vertex, return_counts=True)
    assert len(names) == 8
    assert (members == 3).all()


def test_no_short_curve_gets_both_its_ends_into_one():
    """An edge ends between the two ends of the shortest side, nearest to both."""
    views = looked_into(rim_of(0), rim_of(-DEPTH), in_square)
    cut = 2 * views.pixel
    corners = np.concatenate([CORNERS[:2], CORNERS[2] - [[0, cut, 0], [cut, 0, 0]], CORNERS[3:]])
    rim = lines_between(*((corners[k] @ TILT.T, corners[(k + 1) % 5] @ TILT.T) for k in range(5)))
    middle = (CORNERS[2] - [cut / 2, cut / 2, 0]) @ TILT.T
    upright = lines_between((middle + 0.4 * TILT[:, 0], middle + DOWN @ TILT.T))
    curves = concatenated(replace(rim, vertex=torch.tensor([[k, (k + 1) % 5] for k in range(5)])), upright)
    found = with_pockets(curves, views, 0.0)
    assert len(found) == 11
    assert (found.vertex[:, 0] != found.vertex[:, 1]).all()
    assert np.linalg.norm(sampled(found)[:, -1] - sampled(found)[:, 0], axis=1).min() > cut / 2


@pytest.mark.slow
def test_two_pockets_side_by_side():
    """What goes of one of them stands before the curves of the other."""
    sides = [np.array([x, 0, 0]) for x in (-0.45, 0.45)]
    rims = [[line * [0.8, 1, 1] + side for line in rim_of(0)] for side in sides]
    bottoms = [line + DOWN for rim in rims for line in rim]
    views = looked_into(
        [line for rim in rims for line in rim],
        bottoms,
        lambda x: (np.abs(np.abs(x[:, 0]) - 0.45) < 0.8 * HALF) & (np.abs(x[:, 1]) < HALF),
        np.repeat(sides, 4, axis=0),
    )
    piece = lines_between((bottoms[0][0] @ TILT.T, bottoms[0][120] @ TILT.T))
    curves = piece
    for rim in rims:
        lines = lines_between(*((line[0] @ TILT.T, line[-1] @ TILT.T) for line in rim))
        curves = concatenated(curves, replace(lines, vertex=torch.tensor([[k, (k + 1) % 4] for k in range(4)])))
    found = with_pockets(curves, views, 0.0)
    assert len(found) == 16
    x = sampled(found) @ TILT
    assert np.abs(x[:8] - sampled(curves)[1:] @ TILT).max() < 1e-6
    assert np.abs(x[8:] - x[:8] - DOWN).max() < 0.004


@pytest.mark.parametrize("outward", [0.0, 0.5])
def test_nothing_to_look_into(outward):
    views = looked_into(rim_of(0), [], in_square)
    assert len(with_pockets(lines_between(), views, outward)) == 0


def test_rings_that_views_in_a_ring_see_through_each_other_are_no_bottoms():
    """A mug of wire, from a turntable: what lies between its rings falls on them, in the same way in all views."""
    cameras = ds.orbit(torch.arange(24) * 30.0, [20.0] * 12 + [50.0] * 12, 3.0, size=160)
    mug = member("mug", torch.Generator().manual_seed(0)).sketch
    lines = list(ds.bezier.evaluate(mug.points, mug.weights, torch.linspace(0, 1, 200)).double().numpy())
    views = edge_views(cameras, ridges_along(cameras, lines))
    found = joined(curves_of([fitted for line in lines for fitted in simplest(line, views.pixel)]), views.pixel)
    assert int(found.closed.sum()) == 3
    assert with_pockets(found, views, 0.0) is found
