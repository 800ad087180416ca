"""Cameras that are lost: looked for again by the curves of the others, and known by how little they agree with."""

import numpy as np
import pytest
import torch
from edge_scenes import around, lines_between, ridges_along, segment

from diff3ds.edges.cameras.coarse_to_fine import Refined
from diff3ds.edges.cameras.find_again import agreement, found_again
from diff3ds.edges.cameras.lens_effect import LensEffect
from diff3ds.edges.cameras.posed import NUMBERS, Posed
from diff3ds.edges.evidence.edge_views import edge_views

CORNERS = 0.55 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
ENDS = [(a, b) for i, a in enumerate(CORNERS) for b in CORNERS[i + 1 :] if (a != b).sum() == 1]
ENDS += [((-0.55, -0.2, 0.55), (0.2, -0.55, 0.55)), ((0.55, 0.1, -0.3), (0.55, -0.4, 0.2))]
OTHERS = [((-0.3, -0.7, 0.2), (0.1, 0.4, 0.6)), ((0.6, 0.1, -0.6), (-0.2, 0.5, 0.1)), ((0, 0.7, 0), (0.3, -0.6, 0.4))]
WRONG, STRANGE = [2, 9, 17], 5


@pytest.fixture(scope="module")
def scene():
    """Right cameras, the views of a box, of which one shows another thing, and cameras of which three are turned."""
    cameras = around(views=24, size=256)
    ridges = ridges_along(cameras, [segment(*ends) for ends in ENDS])
    ridges[STRANGE] = ridges_along(cameras[[STRANGE]], [segment(*ends) for ends in OTHERS])[0]
    views, truth = edge_views(cameras, ridges), Posed.of(cameras)
    # About 12 pixels to the side, and some about the axis of sight.
    turns = np.zeros((len(cameras), 6))
    turns[WRONG, :3] = [0.02, -0.035, 0.01]
    return (
        truth,
        truth.stepped(turns, np.zeros(NUMBERS)),
        views,
        LensEffect.fixed(np.zeros(len(views.points))),
        lines_between(*ENDS),
    )


def project(posed, x):
    local = x @ posed.rotation.transpose(0, 2, 1) + posed.shift[:, None]
    return posed.focals[:, None] * local[..., :2] / local[..., 2:] + posed.principal[:, None]


def lost_of(posed, views, effect, curves):
    count = len(views)
    agrees = agreement(posed, views, effect, curves)
    return np.nonzero(Refined(torch.zeros(count, 4, 4), torch.zeros(count, 3, 3), agrees).lost)[0].tolist()


def test_lost_cameras_are_found_again_and_the_others_stay(scene):
    truth, wrong, views, effect, curves = scene
    back = found_again(wrong, wrong, views, effect, curves)
    seen = [project(posed, CORNERS)[WRONG] for posed in (wrong, back, truth)]
    assert np.linalg.norm(seen[0] - seen[2], axis=-1).min() > 8
    assert np.linalg.norm(seen[1] - seen[2], axis=-1).mean() < 1.0
    right = [view for view in range(len(views)) if view not in (*WRONG, STRANGE)]
    np.testing.assert_array_equal(back.rotation[right], truth.rotation[right])
    np.testing.assert_array_equal(back.shift[right], truth.shift[right])


def test_lost_cameras_agree_with_no_more_than_chance(scene):
    truth, wrong, views, effect, curves = scene
    assert lost_of(wrong, views, effect, curves) == [2, STRANGE, 9, 17]
    right = agreement(truth, views, effect, curves)
    assert np.delete(right, STRANGE).min() > 3
    assert right[STRANGE] < 2


@pytest.mark.slow
def test_what_shows_another_thing_stays_lost(scene):
    _, wrong, views, effect, curves = scene
    back = found_again(wrong, wrong, views, effect, curves)
    assert lost_of(back, views, effect, curves) == [STRANGE]
