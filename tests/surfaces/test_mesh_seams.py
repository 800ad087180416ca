"""Where pieces of a mesh go through each other: seams as lines of a view, what is seen of them, and contours there."""

import numpy as np
import pytest
import torch
from solids import box, icosphere, lathe, together

import diff3ds as ds
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.surfaces.lines.feature_curves import feature_curves
from diff3ds.surfaces.shape.intersections import Seams

NOTHING = ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))
T = torch.linspace(0, 1, 9, dtype=torch.float64)
MIDDLE, RADIUS = np.array([0.9, 0.2, 0.3]), 0.8


def balls() -> ds.TriangleMesh:
    """The unit ball and another that goes through it."""
    points, faces = icosphere(4)
    return ds.TriangleMesh(*together((points, faces), (RADIUS * points + MIDDLE, faces)))


def circle() -> tuple[np.ndarray, np.ndarray]:
    """Points of the circle in which the two balls meet, and its middle."""
    reach = np.linalg.norm(MIDDLE)
    axis = MIDDLE / reach
    height = (1 - RADIUS**2 + reach**2) / (2 * reach)
    aside = np.linalg.svd(axis[None])[2][1:]
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    ring = np.cos(angle)[:, None] * aside[0] + np.sin(angle)[:, None] * aside[1]
    return height * axis + (1 - height**2) ** 0.5 * ring, height * axis


def length(sketch: ds.Sketch) -> float:
    return float(ds.bezier.length(sketch.points.detach(), sketch.weights).sum()) if len(sketch) else 0.0


def test_the_seam_of_two_balls_is_one_circle_and_seen_where_both_are():
    mesh = balls()
    found = feature_curves(mesh)
    assert [Kind(int(kind)) for kind in found.curves.kind] == [Kind.CIRCLE]
    fitted = sketch_of(found.curves, 0.006)
    points, middle = circle()
    radius = float(np.linalg.norm(points[0] - middle))
    whole = 2 * np.pi * radius
    cameras = ds.orbit([0.0, 60.0, 120.0, 240.0], 20.0, 4.5, size=300).to(torch.float64)
    own = ds.visible_lines(NOTHING, cameras, mesh)
    given = ds.visible_lines(fitted, cameras, mesh, kinds=["given"])
    for view in range(4):
        sight = cameras.centers[view].numpy() - points
        seen = (np.einsum("pi,pi->p", points, sight) > 0) & (np.einsum("pi,pi->p", points - MIDDLE, sight) > 0)
        # Edges of the mesh are a 60th of the circle long.
        for lines, kind in ((own[view], "intersection"), (given[view], "given")):
            assert length(lines.strokes(True, kind)) == pytest.approx(seen.mean() * whole, abs=0.02 * whole)
            assert length(lines.strokes(False, kind)) == pytest.approx((~seen).mean() * whole, abs=0.02 * whole)
        # What a sketch draws is not drawn again.
        assert set(own[view].kinds) == {"contour", "intersection"}
        assert set(given[view].kinds) == {"contour", "given"}
        on = ds.bezier.evaluate(own[view].sketch.points, own[view].sketch.weights, T)
        seam = torch.tensor([kind == "intersection" for kind in own[view].kinds])
        away = (on[seam[own[view].sketch.chains.stroke]] - torch.from_numpy(middle)).norm(dim=-1)
        assert float((away - radius).abs().max()) < 0.01


def test_a_crease_is_seen_up_to_where_it_goes_into_another_piece():
    """Which is another share of it in the picture than in space, and so little that it could be taken for noise."""
    points, faces = icosphere(4)
    mesh = ds.TriangleMesh(*together(box((-0.8, -0.8, -0.8), (0.6, 0.6, 0.6)), (0.9 * points + [0.4, 0.2, 0.3], faces)))
    cameras = ds.orbit(240.0, 20.0, 4.5, size=300).to(torch.float64)
    (lines,) = ds.visible_lines(NOTHING, cameras, mesh)
    seen = lines.strokes(True, "contour").points
    # The edge from (.6, .6, .6) to (.6, -.8, .6), of which the last eighth is outside of the ball.
    (stroke,) = [p for p in seen if torch.allclose(p[:, [0, 2]], torch.tensor(0.6).double(), atol=1e-4)]
    enters = 0.2 - (0.81 - 0.04 - 0.09) ** 0.5
    assert stroke[:, 1].tolist()[0] == pytest.approx(enters, abs=0.003)
    assert stroke[:, 1].tolist()[-1] == pytest.approx(-0.8, abs=1e-6)


def test_seams_are_no_lines_where_contours_are_none_and_none_in_one_piece():
    cameras = ds.orbit(60.0, 20.0, 4.5, size=100)
    (lines,) = ds.visible_lines(NOTHING, cameras, balls(), contours=False)
    assert len(lines.sketch) == 0
    (lines,) = ds.visible_lines(NOTHING, cameras, ds.TriangleMesh(*icosphere(3)))
    assert set(lines.kinds) == {"contour"}


def pipe(radius: float, reach: float, around: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed cylinder along z, of so many sides."""
    return lathe(np.array([0, radius, radius, 0]), np.array([-reach, -reach, reach, reach]), around)


@pytest.mark.parametrize(("radius", "seams"), [(1.0, 0), (1.2, 2)])
def test_pieces_that_touch_have_no_seam_and_those_that_go_through_each_other_have(radius, seams):
    """A shaft in a bore: their facets cut each other a hundred times, of which none is a line."""
    bore = np.array([1.0, 2, 2, 1, 1]), np.array([-1.0, -1, 1, 1, -1])
    mesh = ds.TriangleMesh(*together(pipe(radius, 2.0, 40), lathe(*bore, 56)))
    found = feature_curves(mesh)
    assert found.kinds.count("intersection") == seams
    # Rims of the shaft and of the ring.
    assert found.kinds.count("crease") == 6


@pytest.mark.parametrize("around", [60, 61])
def test_equal_pipes_have_their_whole_seam_though_they_touch_where_it_crosses_itself(around):
    points, faces = pipe(1.0, 3.0, around)
    seam = Seams.of(ds.TriangleMesh(*together((points, faces), (points[:, [1, 2, 0]], faces))))
    ends = seam.points[seam.steps]
    # Two ellipses, half as long again as they are wide.
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(2 * 7.6404, rel=0.01)
