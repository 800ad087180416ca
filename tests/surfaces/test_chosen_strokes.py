"""Which strokes of a surface are taken first: on boxes, whose edges are known."""

import numpy as np
import torch

import diff3ds as ds
from diff3ds.surfaces.chosen_strokes import choose_strokes
from diff3ds.surfaces.line_drawings import sides_and_corners
from diff3ds.surfaces.lines.feature_curves import feature_curves


def box(size) -> ds.TriangleMesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * size
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return ds.TriangleMesh(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def edges(mesh: ds.TriangleMesh) -> ds.Sketch:
    return ds.Sketch(feature_curves(mesh).curves.points)


def test_the_long_edges_of_a_beam_come_first():
    mesh = box((5.0, 1.0, 1.0))
    chosen = choose_strokes(mesh, edges(mesh), ["crease"] * 12, 4, False)
    span = (chosen.sketch.points[:, -1] - chosen.sketch.points[:, 0]).abs()
    assert span.tolist() == [[5, 0, 0]] * 4
    assert chosen.kinds == ("crease",) * 4
    assert list(chosen.shown) == sorted(chosen.shown)
    assert 0.5 < chosen.shown[-1] < 0.95


def test_all_edges_show_all_and_no_more_are_taken():
    mesh = box((3.0, 2.0, 1.0))
    chosen = choose_strokes(mesh, edges(mesh), ["crease"] * 12, 50, False)
    assert len(chosen.sketch) == 12
    assert chosen.shown[-1] > 0.999


def test_features_that_are_kept_come_first_and_do_not_count():
    mesh = box((3.0, 2.0, 1.0))
    whole = edges(mesh)
    chosen = choose_strokes(mesh, whole, ["crease"] * 12, 3, True)
    assert torch.equal(chosen.sketch.points, whole.points)


def test_the_directions_see_all_of_it():
    mesh = box((3.0, 2.0, 1.0))
    cameras = sides_and_corners(mesh)
    assert len(cameras) == 14
    corners = torch.from_numpy(mesh.vertices)
    homogeneous = torch.cat([corners, torch.ones(len(corners), 1)], 1)
    pixels, depth = cameras.seen(torch.einsum("vij,nj->vni", cameras.projection, homogeneous.double()))
    assert bool((depth > 0).all())
    assert float(pixels.min()) > 0
    assert float(pixels.max()) < cameras.size[0]
    # The six sides first: two of the box's three dimensions each.
    spread = (pixels.amax(1) - pixels.amin(1))[:6].sort(dim=1).values
    scale = cameras.size[0] / (1.1 * 14**0.5)
    assert sorted((spread / scale).round().int().tolist()) == [[1, 2], [1, 2], [1, 3], [1, 3], [2, 3], [2, 3]]
