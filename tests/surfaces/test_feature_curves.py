"""Feature lines of meshes whose edges are known: boxes, cylinders, clean_plates with round corners, spheres."""

import math

import numpy as np
import pytest
import torch

from diff3ds.curves.shapes.primitives import Kind
from diff3ds.surfaces.lines.feature_curves import feature_curves, outline_share
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

T = torch.linspace(0, 1, 33, dtype=torch.float64)


def prism(outline: np.ndarray, height: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A convex outline in the plane made solid."""
    count = len(outline)
    low = np.column_stack([outline, np.zeros(count)])
    vertices = np.concatenate([low, low + np.array([0, 0, height])])
    i, j = np.arange(count), (np.arange(count) + 1) % count
    sides = np.concatenate([np.stack([i, j, j + count], 1), np.stack([i, j + count, i + count], 1)])
    fan = np.stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)], 1)
    return vertices, np.concatenate([sides, fan[:, ::-1], fan + count])


def around(count: int, start: float = 0.0, sweep: float = 360.0, radius: float = 1.0) -> np.ndarray:
    angle = np.deg2rad(start + sweep * np.arange(count) / (count if sweep == 360 else count - 1))
    return radius * np.stack([np.cos(angle), np.sin(angle)], 1)


def curves_of(vertices: np.ndarray, faces: np.ndarray):
    return feature_curves(TriangleMesh(vertices, faces)).curves


def kinds(curves) -> list[int]:
    return sorted(curves.kind.tolist())


SQUARE = np.array([[0.0, 0], [2, 0], [2, 1], [0, 1]])


def test_a_box_has_twelve_straight_edges():
    curves = curves_of(*prism(SQUARE))
    assert kinds(curves) == [Kind.LINE] * 12
    ends = {tuple(sorted(map(tuple, pair))) for pair in curves.points[:, [0, 3]].tolist()}
    corners = {(x, y, z) for x in (0.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 1.0)}
    assert ends == {(a, b) for a in corners for b in corners if a < b and sum(p != q for p, q in zip(a, b)) == 1}
    assert len(curves.vertex.unique()) == 8


def test_repeated_vertices_are_one():
    """As STL files have them: three of each face's own."""
    vertices, faces = prism(SQUARE)
    curves = curves_of(vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))
    assert kinds(curves) == [Kind.LINE] * 12


def test_faces_wound_either_way_and_shown_from_both_sides_are_the_same_mesh():
    vertices, faces = prism(around(48))
    mixed = np.where(np.arange(len(faces))[:, None] % 2, faces, faces[:, ::-1])
    for other in (mixed, np.concatenate([faces, faces[:, ::-1]])):
        assert torch.equal(curves_of(vertices, other).points, curves_of(vertices, faces).points)


@pytest.mark.parametrize("count", [10, 48])
def test_the_rims_of_a_cylinder_are_exact_circles(count):
    curves = curves_of(*prism(around(count)))
    assert kinds(curves) == [Kind.CIRCLE] * 2
    on = curves.at(torch.linspace(0, 1, 65, dtype=T.dtype)).reshape(-1, 3)
    torch.testing.assert_close(on[:, :2].norm(dim=1), torch.ones(len(on), dtype=torch.float64), atol=1e-9, rtol=0)
    assert sorted(set(on[:, 2].round(decimals=9).tolist())) == [0.0, 1.0]
    # All around.
    angle = torch.atan2(on[:, 1], on[:, 0]).sort().values
    assert float(angle.diff().max()) < math.radians(10)


def test_the_rims_of_an_elliptic_cylinder_are_exact_ellipses():
    curves = curves_of(*prism(around(64) * np.array([1.0, 0.5])))
    assert kinds(curves) == [Kind.ELLIPSE] * 2
    on = curves.at(T).reshape(-1, 3)
    around_it = (on[:, :2] / torch.tensor([1.0, 0.5])).square().sum(1)
    torch.testing.assert_close(around_it, torch.ones(len(on), dtype=torch.float64), atol=1e-9, rtol=0)
    assert sorted(set(on[:, 2].round(decimals=9).tolist())) == [0.0, 1.0]


def test_a_prism_of_eight_sides_is_no_cylinder():
    assert kinds(curves_of(*prism(around(8)))) == [Kind.LINE] * 24


@pytest.mark.parametrize("first", [0, 3, 11])
def test_round_corners_are_arcs_between_lines(first):
    """A plate of 4 by 3 whose corners have radius .5, from any vertex on."""
    corners = [(1.5, 1.0, 0), (-1.5, 1.0, 90), (-1.5, -1.0, 180), (1.5, -1.0, 270)]
    outline = np.concatenate([around(8, start, 90, 0.5) + np.array([x, y]) for x, y, start in corners])
    curves = curves_of(*prism(np.roll(outline, first, axis=0)))
    assert kinds(curves) == [Kind.LINE] * 8 + [Kind.ARC] * 8
    on = curves.at(T)[curves.kind == Kind.ARC].reshape(-1, 3)
    away = (on[:, :2].abs() - torch.tensor([1.5, 1.0])).norm(dim=1)
    torch.testing.assert_close(away, torch.full_like(away, 0.5), atol=1e-9, rtol=0)
    straight = curves.points[curves.kind == Kind.LINE]
    assert sorted((straight[:, 3] - straight[:, 0]).norm(dim=1).tolist()) == pytest.approx([2.0] * 4 + [3.0] * 4)


def test_what_is_no_arc_is_near_its_edges():
    """A plate with a wavy side: cubics within half of a 256th of its size, and fewer than its edges by far."""
    x = np.linspace(0, 2 * np.pi, 81)
    wave = np.stack([x, 0.6 * np.sin(x)], 1)
    vertices = np.concatenate([np.column_stack([wave, 0 * x]), np.column_stack([wave, 0 * x + 1])])
    i = np.arange(80)
    faces = np.concatenate([np.stack([i, i + 1, i + 82], 1), np.stack([i, i + 82, i + 81], 1)])
    curves = curves_of(vertices, faces)
    assert len(curves) <= 2 + 12
    on = curves.at(T).reshape(-1, 3)
    on = on[(on[:, 2] == 0) | (on[:, 2] == 1)]
    # Distance along the normal of the sine.
    off = (on[:, 1] - 0.6 * on[:, 0].sin()).abs() / (1 + (0.6 * on[:, 0].cos()) ** 2).sqrt()
    assert float(off.max()) < 0.5 * 2 * np.pi / 256 * 1.5
    assert float(on[:, 0].max() - on[:, 0].min()) == pytest.approx(2 * np.pi)


def sphere(count: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """By its convex hull."""
    from scipy.spatial import ConvexHull

    polar = [
        (math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a))
        for a in np.linspace(0, math.pi, count)[1:-1]
        for b in np.linspace(0, 2 * math.pi, 2 * count)[:-1]
    ]
    points = np.array([*polar, (0, 0, 1), (0, 0, -1)])
    hull = ConvexHull(points)
    faces, normals = hull.simplices.astype(np.int64), hull.equations[:, :3]
    a, b, c = points[faces].transpose(1, 0, 2)
    turned = (np.cross(b - a, c - a) * normals).sum(1) < 0
    faces[turned] = faces[turned][:, ::-1]
    return points, faces


def test_smooth_meshes_have_none():
    found = feature_curves(TriangleMesh(*sphere()))
    assert len(found) == found.runs == 0


def folded(folds: int) -> tuple[np.ndarray, np.ndarray]:
    """A sheet with folds like tents, 53 degrees in the middle, flat towards their ends."""
    across = 10 * folds + 1
    x, y = np.meshgrid(np.linspace(0, 12, 61), 0.2 * np.arange(across), indexing="ij")
    height = 0.5 * 0.8 * np.where(np.abs(x - 6) < 3, np.cos((x - 6) * np.pi / 6) ** 2, 0)
    z = height * np.maximum(0, 1 - np.abs(y % 2 - 1) / 0.8)
    i = (np.arange(60)[:, None] * across + np.arange(across - 1)).reshape(-1)
    near = np.stack([i, i + across, i + across + 1], 1)
    return np.stack([x, y, z], -1).reshape(-1, 3), np.concatenate([near, np.stack([i, i + across + 1, i + 1], 1)])


def test_scraps_end_nowhere_and_borders_are_known():
    """The border of four lines, and five folds."""
    found = feature_curves(TriangleMesh(*folded(5)))
    assert len(found) == found.runs == 4 + 5
    assert found.loose == 5
    straight = found.curves.points[[kind == "border" for kind in found.kinds]]
    assert len(straight) == 4
    assert sorted((straight[:, 3] - straight[:, 0]).norm(dim=1).tolist()) == pytest.approx([10, 10, 12, 12])


def test_where_a_crease_becomes_a_border_a_curve_ends():
    """Two squares that meet at a right angle along half of their sides, and go on flush beside it."""
    vertices = np.array([(x, y, 0.0) for x in (0, 1, 2) for y in (0, 1)] + [(0.0, 0, 1), (1, 0, 1)])
    faces = np.array([(0, 2, 3), (0, 3, 1), (2, 4, 5), (2, 5, 3), (0, 6, 7), (0, 7, 2)])
    found = feature_curves(TriangleMesh(vertices, faces))
    creases = found.curves.points[[kind == "crease" for kind in found.kinds]]
    assert creases[:, [0, 3]].abs().sum(1).tolist() == [[1, 0, 0]]


def test_too_many_lines_are_an_error_that_says_what_to_do():
    with pytest.raises(ValueError, match=r"12 feature lines, more than 11: 12 creases, .* take a larger angle"):
        feature_curves(TriangleMesh(*prism(SQUARE)), 11)
    apart = [np.array([(i, 0.0, 0), (i + 0.5, 0, 0), (i, 1, 0)]) for i in range(4)]
    with pytest.raises(ValueError, match=r"12 feature lines, more than 11: 12 borders, .* close its holes"):
        feature_curves(TriangleMesh.of_triangles(np.stack(apart)), 11)


def lathe(profile: np.ndarray, count: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """A profile of (radius, height) turned about z."""
    rows, (i, k) = len(profile), np.meshgrid(np.arange(count), np.arange(len(profile) - 1), indexing="ij")
    ring = around(count)
    vertices = np.stack([profile[:, 0, None] * ring[:, 0, None].T, profile[:, 0, None] * ring[:, 1, None].T], -1)
    vertices = np.concatenate([vertices, np.broadcast_to(profile[:, 1, None, None], (rows, count, 1))], -1).reshape(
        -1, 3
    )
    a, b = (k * count + i).ravel(), (k * count + (i + 1) % count).ravel()
    return vertices, np.concatenate([np.stack([a, b, b + count], 1), np.stack([a, b + count, a + count], 1)])


def test_share_of_the_outlines_that_lines_draw():
    """Of a box all; of a sphere cut open its rim only; of a cylinder known by its measures."""
    assert outline_share(TriangleMesh(*prism(SQUARE))) == 1
    angle = np.linspace(0, math.pi - 0.2, 40)
    ball = np.stack([np.sin(angle), np.cos(angle)], 1)
    assert outline_share(TriangleMesh(*lathe(ball))) < 0.2
    # Radius 1, height h, seen from an angle t off the axis: both rims' half (the hidden too) and two sides of h sin t.
    # The half of a rim whose face beside it is turned away alike is no outline: of each rim one half is.
    for height in (1.0, 4.0):
        found = outline_share(TriangleMesh(*prism(around(256), height)))
        t = np.arccos(1 - 2 * (np.arange(32) + 0.5) / 32)
        turn = np.linspace(0, math.pi, 2001)
        step = np.sqrt(np.sin(turn) ** 2 + (np.cos(turn)[:, None] * np.cos(t)).T ** 2)
        rims = 2 * step.mean(1) * math.pi
        sides = 2 * height * np.sin(t)
        assert found == pytest.approx(rims.sum() / (rims + sides).sum(), abs=0.02)


def moved(mesh: tuple[np.ndarray, np.ndarray], offset) -> tuple[np.ndarray, np.ndarray]:
    return mesh[0] + np.array(offset, float), mesh[1]


def together(*meshes: tuple[np.ndarray, np.ndarray]) -> TriangleMesh:
    before = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, before)]
    return TriangleMesh(np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces))


def of_kind(found, kind: str):
    return found.curves[torch.tensor([k == kind for k in found.kinds])]


def test_where_a_rod_goes_through_a_box_there_are_two_circles():
    rod = moved(prism(0.3 * around(48), 4.0), (1, 0.5, -1.5))
    found = feature_curves(together(prism(SQUARE), rod))
    seams = of_kind(found, "intersection")
    assert kinds(seams) == [Kind.CIRCLE] * 2
    on = seams.at(T)
    assert torch.allclose((on[..., :2] - torch.tensor([1.0, 0.5])).norm(dim=-1), torch.tensor(0.3).double(), atol=1e-3)
    assert sorted(on[..., 2].mean(1).round(decimals=6).tolist()) == [0, 1]
    assert float((on[..., 2] - on[..., 2].mean(1, keepdim=True)).abs().max()) < 1e-6
    assert len(of_kind(found, "crease")) == 12 + 2


def test_where_boxes_stand_in_each_other_the_seam_is_straight_lines():
    """Also where they have planes, edges and corners in common."""
    upper = moved(prism(SQUARE * 0.5), (0.5, 0.25, 0.5))
    found = feature_curves(together(prism(SQUARE), upper))
    seams = of_kind(found, "intersection")
    assert kinds(seams) == [Kind.LINE] * 4
    length = (seams.points[:, 3] - seams.points[:, 0]).norm(dim=1)
    assert sorted(length.tolist()) == pytest.approx([0.5, 0.5, 1, 1])
    assert torch.allclose(seams.points[..., 2], torch.ones(4, 4).double())


def test_two_balls_meet_in_a_circle_and_balls_apart_in_none():
    ball = sphere(40)
    found = feature_curves(together(ball, moved(ball, (1.2, 0.05, 0.03))))
    seams = of_kind(found, "intersection")
    on = seams.at(T).reshape(-1, 3)
    # In the middle between them, with radius sqrt(1 - d² / 4), to the height of a facet.
    axis = torch.tensor([1.2, 0.05, 0.03]).double()
    across = on - axis / 2
    assert float((across @ axis / axis.norm()).abs().max()) < 0.01
    radius = (1 - float(axis.square().sum()) / 4) ** 0.5
    assert float((across.norm(dim=1) - radius).abs().max()) < 0.02
    assert set(found.kinds) == {"intersection"}
    assert not len(feature_curves(together(ball, moved(ball, (2.1, 0, 0)))))
