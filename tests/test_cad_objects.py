"""The generator of CAD-like objects (benchmarks/cad_objects.py): exact edges, hidden lines, biased edge maps."""

import importlib.metadata
import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("OCP", reason="the CAD kernel is needed: pip install 'diff3ds[cad]'")
sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from cad.boundary import AmbiguousEdgeError, Edge, edge_curve, edges_and_faces, joined_edges, mesh, sharp_and_smooth
from cad.detector import CLEAN, edge_map
from cad.lines import SHARP, contours, pieces_of_edges, visible
from cad.part import random_part
from cad.raster import rasterise, shade
from cad.solids import (
    arc,
    box,
    chamfer,
    common,
    cut,
    cylinder,
    extrude,
    fillet,
    fuse,
    line,
    outline,
    polygon,
    revolve,
    similar,
)
from cad.views import CENTRE, FOCAL, SIZE, View, random_views
from cad_objects import FROZEN, digest, generate

GREY = np.full((100, 3), 0.8)


def view_from(direction, distance=4.0):
    """A view of the middle of the cube."""
    away = np.array(direction) / np.linalg.norm(direction)
    right = np.cross(-away, (0, 0, 1))
    right /= np.linalg.norm(right)
    return View(CENTRE + distance * away, np.array([right, np.cross(-away, right), -away]))


def ball(radius):
    """A ball in the middle of the cube, its axis upright."""
    ends = [np.array([0.0, 0.0, -radius]), np.array([0.0, 0.0, radius])]
    solid = revolve(outline([arc(ends[0], (radius, 0.0, 0.0), ends[1]), line(ends[1], ends[0])]))
    return similar(solid, np.eye(3), 1.0, CENTRE)


# Exact edges


def test_a_drilled_box_has_twelve_lines_and_two_circles():
    sharp, smooth = sharp_and_smooth(cut(box((0, 0, 0), (1, 0.6, 0.3)), cylinder((0.5, 0.3, -1), 0.1, 3)))
    assert sorted(round(e.length, 9) for e in sharp if e.type == "line") == [0.3] * 4 + [0.6] * 4 + [1.0] * 4
    circles = [e for e in sharp if e.type == "circle"]
    assert len(sharp) == 14
    assert not smooth
    assert sorted(e.center[2] for e in circles) == pytest.approx([0, 0.3], abs=1e-12)
    for e in circles:
        assert (e.radius, e.angle) == pytest.approx((0.1, 2 * math.pi))
        assert e.normal == pytest.approx([0, 0, 1])
        assert np.linalg.norm(e.points - e.center, axis=1) == pytest.approx(np.full(len(e.points), 0.1))


def test_a_rolled_edge_leaves_two_smooth_borders_and_two_arcs():
    solid = box((0, 0, 0), (1, 0.6, 0.3))
    edge = next(e for e, _ in edges_and_faces(solid) if edge_curve(e).length > 0.9)
    sharp, smooth = sharp_and_smooth(fillet(solid, [edge], 0.1))
    assert [e.length for e in smooth] == pytest.approx([1, 1])
    arcs = [e for e in sharp if e.type == "circle"]
    assert len(sharp) == 8 + 3 + 2  # eight untouched, three long ones, two arcs: the rolled edge and its ends are gone
    assert [(e.radius, e.angle) for e in arcs] == [pytest.approx((0.1, math.pi / 2))] * 2


def test_an_arc_split_in_two_is_one_curve():
    """Two half cylinders make one whole rim at each end."""
    halves = [cut(cylinder((0, 0, 0), 0.4, 1), box((x, -1, -1), (2, 2, 3))) for x in (0, -2)]
    sharp, _ = sharp_and_smooth(fuse(*halves))
    assert [(e.type, e.radius, e.angle) for e in sharp] == [
        ("circle", pytest.approx(0.4), pytest.approx(2 * math.pi))
    ] * 2


def test_arcs_of_one_circle_join_where_no_third_edge_meets_them():
    def piece(start, stop):
        t = np.linspace(start, stop, 50)
        points = np.column_stack([np.cos(t), np.sin(t), np.zeros(50)])
        return Edge("circle", points, 1.0, np.zeros(3), np.array([0.0, 0.0, 1.0]))

    halves = [piece(0, 2), piece(4, 2)]  # they meet at 2, the second the other way round
    (whole,) = joined_edges(halves)
    assert (whole.type, whole.angle) == ("circle", pytest.approx(4))
    branch = Edge("line", np.linspace(halves[0].points[-1], np.zeros(3), 5))
    assert len(joined_edges([*halves, branch])) == 3


def test_an_oblique_cut_leaves_an_ellipse():
    keep = np.array([[-1, -1, -1], [1, -1, -1], [1, -1, 1.0], [-1, -1, 0.5]])
    whole = cylinder((0, 0, 0), 0.2, 2)
    sharp, _ = sharp_and_smooth(common(whole, extrude(polygon(keep), (0, 2, 0))))
    ellipse = next(e for e in sharp if e.type == "ellipse")
    assert sorted(e.type for e in sharp) == ["circle", "ellipse"]
    assert ellipse.center == pytest.approx([0, 0, 0.75])
    assert np.ptp(ellipse.points[:, 0]) == pytest.approx(0.4, abs=1e-4)
    assert ellipse.points[:, 2] == pytest.approx(0.75 + 0.25 * ellipse.points[:, 0])


def test_an_edge_that_is_hardly_one_is_refused():
    profile = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.5, 1.05, 0], [0, 1, 0]])
    with pytest.raises(AmbiguousEdgeError, match="11 degrees"):
        sharp_and_smooth(extrude(polygon(profile), (0, 0, 1)))


def test_a_bevel_is_five_more_edges():
    """The bevelled edge goes; two come for it, and one at each of its ends."""
    solid = box((0, 0, 0), (1, 1, 1))
    edge, _ = edges_and_faces(solid)[0]
    sharp, _ = sharp_and_smooth(chamfer(solid, [edge], 0.2))
    assert len(sharp) == 15
    assert sum(e.length == pytest.approx(0.2 * math.sqrt(2)) for e in sharp) == 2


# Pictures


def test_the_silhouette_of_a_box_has_the_area_of_its_projected_corners():
    from scipy.spatial import ConvexHull

    net, view = mesh(box((0.2, 0.3, 0.1), (0.6, 0.4, 0.8))), view_from((1, 2, 0.7))
    covered = shade(rasterise(net, view), net, view, GREY)[..., 3].sum()
    assert covered == pytest.approx(ConvexHull(view.project(net.vertices)[0]).volume, rel=2e-3)


def test_the_contour_of_a_ball_is_the_circle_of_its_tangent_cone():
    net, view = mesh(ball(0.4)), view_from((1, 1, 1))
    middle = view.project(contours(net, view).ends.mean(1))[0] - SIZE / 2
    exact = FOCAL * 0.4 / math.sqrt(4**2 - 0.4**2)
    # The mesh is within 3e-4 of the ball, .04 px.
    assert np.hypot(*middle.T) == pytest.approx(np.full(len(middle), exact), abs=0.06)
    angles = np.sort(np.arctan2(*middle.T))
    assert np.diff(angles).max() < 0.1  # all the way round
    # Where the mesh's chords fall just outside of all four samples a piece may be lost.
    assert visible(contours(net, view), rasterise(net, view), view).mean() > 0.99


@pytest.mark.parametrize(
    "seed",
    [
        0,
        pytest.param(1, marks=pytest.mark.slow),
        2,
        pytest.param(8, marks=pytest.mark.slow),
        pytest.param(29, marks=pytest.mark.slow),
    ],
)
def test_hidden_lines_are_those_that_exact_rays_meet_a_face_before(seed):
    from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
    from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector

    part = random_part(seed)
    caster = IntCurvesFace_ShapeIntersector()
    caster.Load(part.solid, 1e-7)
    pieces = pieces_of_edges(part.sharp, SHARP)
    rng = np.random.default_rng(seed)
    pieces = pieces.choose(rng.choice(len(pieces.edge), min(150, len(pieces.edge)), replace=False))
    wrong = []
    for view in random_views(rng, 4):
        seen = visible(pieces, rasterise(part.mesh, view), view)
        for point, shown in zip(pieces.ends.mean(1), seen, strict=True):
            way = view.eye - point
            # Chords of a curved edge may lie within the solid, by up to 1e-4; beyond 3e-3 nothing is the edge's own.
            caster.Perform(gp_Lin(gp_Pnt(*point), gp_Dir(*way)), 3e-3, float(np.linalg.norm(way)))
            wrong.append(shown == (caster.NbPnt() > 0))
    assert np.mean(wrong) < 0.02


def test_clean_maps_show_the_outline_of_the_picture_and_every_visible_edge(tmp_path):
    about = generate(0, tmp_path, clean=True, views=3)
    truth = json.loads((tmp_path / "ground_truth.json").read_text())["curves"]
    assert about["curves"] == len(truth) == 28
    assert set(about["detector"]) == set(vars(CLEAN))
    frames = json.loads((tmp_path / "transforms_edges.json").read_text())["frames"]
    for frame in frames:
        ink = np.array(Image.open(tmp_path / frame["file_path"])) / 255
        alpha = np.array(Image.open(tmp_path / frame["file_path"].replace("edges", "color")))[..., 3] / 255
        border = (alpha > 0.1) & (alpha < 0.9)
        assert ink[border].min() > 0.5
        # Projected anew, from the file: OpenGL's camera looks along -z, and y points up.
        inverse = np.linalg.inv(frame["transform_matrix"])
        points = np.concatenate([curve["points"] for curve in truth]) @ inverse[:3, :3].T + inverse[:3, 3]
        pixel = np.floor(SIZE / 2 + FOCAL * points[:, :2] / -points[:, 2:] * [1, -1]).astype(int)
        on_ink = np.zeros_like(ink, bool)
        on_ink[pixel[:, 1], pixel[:, 0]] = True
        # All ink is near an edge, since this part has hardly a curved face; and most edges are on ink.
        near = sum(np.roll(on_ink, (i, j), (0, 1)) for i in range(-3, 4) for j in range(-3, 4)) > 0
        assert ((ink > 0.1) & ~near).sum() < 0.02 * (ink > 0.1).sum()
        assert (ink[pixel[:, 1], pixel[:, 0]] > 0.5).mean() > 0.5


def radius_of_ink(detector):
    """Mean distance of a ball's drawn contour from (200, 200), and the mean position of its ink."""
    net, view = mesh(ball(0.4)), view_from((1, 1, 1))
    color = shade(rasterise(net, view), net, view, GREY)
    ink = edge_map(np.random.default_rng(0), detector, contours(net, view), view, color)
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    return (ink * np.hypot(x, y)).sum() / ink.sum(), np.array([(ink * x).sum(), (ink * y).sum()]) / ink.sum()


@pytest.mark.slow
def test_the_bias_moves_outlines_by_what_it_says():
    exact = FOCAL * 0.4 / math.sqrt(4**2 - 0.4**2)
    for outward in (0.0, 0.9):
        radius, middle = radius_of_ink(replace(CLEAN, outward=outward))
        assert radius == pytest.approx(exact + outward, abs=0.05)
        assert middle == pytest.approx([0, 0], abs=0.05)
    _, middle = radius_of_ink(replace(CLEAN, shift=np.array([-0.3, 0.4])))
    assert middle == pytest.approx([-0.3, 0.4], abs=0.05)


# The generator


@pytest.mark.slow
def test_the_same_seed_writes_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        generate(3, tmp_path / name, views=2)
    files = sorted(p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*.*"))
    assert len(files) == 4 + 4  # four JSON files, two pictures of each kind
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


@pytest.mark.slow
def test_clean_maps_have_the_cameras_and_the_truth_of_biased_ones(tmp_path):
    for name in ("clean", "biased"):
        generate(9, tmp_path / name, clean=name == "clean", views=2)
    for file in ("ground_truth.json", "transforms_color.json", "color/001.png"):
        assert (tmp_path / "clean" / file).read_bytes() == (tmp_path / "biased" / file).read_bytes()
    assert (tmp_path / "clean/edges/001.png").read_bytes() != (tmp_path / "biased/edges/001.png").read_bytes()


@pytest.mark.parametrize("seed", [4, 37])
def test_parts_fill_the_unit_cube(seed):
    points = random_part(seed).mesh.vertices
    low, high = points.min(0), points.max(0)
    assert (high - low).max() == pytest.approx(1, abs=1e-3)
    assert (low + high) / 2 == pytest.approx(CENTRE, abs=1e-3)


@pytest.mark.parametrize("seed", [7, 42])
def test_the_frozen_objects_are_made_again(seed):
    frozen = json.loads(FROZEN.read_text())
    version = importlib.metadata.version("cadquery-ocp-novtk")
    if version != frozen["cadquery-ocp-novtk"]:
        pytest.skip(
            f"the objects were frozen with cadquery-ocp-novtk {frozen['cadquery-ocp-novtk']}, this is {version}"
        )
    assert digest(range(seed, seed + 1)) == frozen["seeds"][str(seed)]
