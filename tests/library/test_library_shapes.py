"""The strokes that the library's categories are made from, against what geometry says of them."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff3ds.bezier import evaluate
from diff3ds.library import shapes

T = torch.linspace(0, 1, 21, dtype=torch.float64)
ANGLES = st.floats(-720, 720)


def on(strokes):
    """Points along the strokes, (N, 21, 3)."""
    strokes = strokes.strokes
    return evaluate(strokes[..., :3] / strokes[..., 3:], strokes[..., 3].contiguous(), T)


def ends(strokes):
    """Start and end points, (N, 2, 3)."""
    strokes = strokes.strokes
    points = strokes[..., :3] / strokes[..., 3:]
    return points[:, [0, 3]]


@given(start=ANGLES, span=st.floats(1, 360), radius=st.floats(0.01, 100))
def test_arcs_of_circles_are_exact(start, span, radius):
    arc = shapes.ring((0.5, -1.0, 2.0), radius, "z", start, start + span)
    assert len(arc) == math.ceil((start + span - start) / 180)
    assert bool((arc.strokes[..., 3] > 0).all())
    center = torch.tensor([0.5, -1.0, 2.0], dtype=torch.float64)
    torch.testing.assert_close(
        (on(arc) - center).norm(dim=-1), torch.full((len(arc), 21), radius, dtype=torch.float64), rtol=1e-12, atol=1e-12
    )
    for at, angle in ((ends(arc)[0, 0], start), (ends(arc)[-1, 1], start + span)):
        turned = torch.tensor([math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0], dtype=torch.float64)
        torch.testing.assert_close(at, center + radius * turned, rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(ends(arc)[1:, 0], ends(arc)[:-1, 1])


@pytest.mark.parametrize(
    ("axis", "zero", "ninety"), [("x", (0, 1, 0), (0, 0, 1)), ("y", (1, 0, 0), (0, 0, 1)), ("z", (1, 0, 0), (0, 1, 0))]
)
def test_angles_and_turns_have_one_sense(axis, zero, ninety):
    arc = ends(shapes.ring((0, 0, 0), 1.0, axis, 0, 90))[0]
    torch.testing.assert_close(arc, torch.tensor([zero, ninety], dtype=torch.float64))
    turned = shapes.turn(shapes.line((0, 0, 0), zero), 90, axis)
    torch.testing.assert_close(ends(turned)[0, 1], torch.tensor(ninety, dtype=torch.float64))


def test_a_turn_about_a_point_leaves_the_point():
    turned = shapes.turn(shapes.line((1, 2, 3), (2, 2, 3)), 180, "z", (1, 2, 3))
    torch.testing.assert_close(ends(turned)[0], torch.tensor([[1, 2, 3], [0, 2, 3]], dtype=torch.float64))


def test_an_ellipse_satisfies_its_equation():
    points = on(shapes.ellipse((1, 0, 0), (3, 0, 0), (0, 0, 0.5)))
    equation = ((points[..., 0] - 1) / 3) ** 2 + (points[..., 2] / 0.5) ** 2
    torch.testing.assert_close(equation, torch.ones_like(equation), rtol=0, atol=1e-12)
    assert float(points[..., 1].abs().max()) == 0


def test_lines_are_straight_and_of_constant_speed():
    points = on(shapes.line((0, 0, 0), (2, -4, 6)))[0]
    torch.testing.assert_close(points, T[:, None] * torch.tensor([2, -4, 6], dtype=torch.float64))


def test_a_box_has_twelve_edges_along_its_sides():
    box = shapes.box((1, 2, 3), (2, 4, 6))
    assert len(box) == 12
    sides = (ends(box)[:, 1] - ends(box)[:, 0]).abs()
    for axis, length in enumerate((2, 4, 6)):
        along = sides[:, axis] > 1e-9
        assert int(along.sum()) == 4
        torch.testing.assert_close(sides[along].sum(1), torch.full((4,), length).double())
    corners = ends(box).reshape(-1, 3)
    torch.testing.assert_close(corners.amin(0), torch.tensor([0, 0, 0]).double())
    torch.testing.assert_close(corners.amax(0), torch.tensor([2, 4, 6]).double())


@pytest.mark.parametrize("closed", [False, True])
def test_smooth_passes_through_its_points_without_a_kink(closed):
    through = torch.tensor([[0, 0, 0], [1, 1, 0], [2, 0, 1], [1, -1, 0.5]], dtype=torch.float64)
    strokes = shapes.smooth(*through.tolist(), closed=closed)
    assert len(strokes) == (4 if closed else 3)
    torch.testing.assert_close(ends(strokes)[:, 0], through[: len(strokes)])
    points = strokes.strokes[..., :3]
    leaving, arriving = points[:, 1] - points[:, 0], points[:, 3] - points[:, 2]
    torch.testing.assert_close(leaving[1:], arriving[:-1])
    if closed:
        torch.testing.assert_close(leaving[0], arriving[-1])


def test_extruded_outlines_join_corner_to_corner():
    prism = shapes.extrude(shapes.polyline((0, 0, 0), (1, 0, 0), (0, 1, 0), closed=True), (0, 0, 5))
    assert len(prism) == 9
    posts = ends(prism[6:])
    torch.testing.assert_close(posts[:, 1] - posts[:, 0], torch.tensor([[0, 0, 5]] * 3).double())


def test_a_lathe_turns_its_profile_evenly():
    cylinder = shapes.lathe(shapes.line((2, 0, 0), (2, 0, 3)), [(2, 0), (2, 3)], meridians=3, start=30)
    assert len(cylinder) == 3 + 4
    torch.testing.assert_close(on(cylinder)[..., :2].norm(dim=-1), torch.full((7, 21), 2).double())
    feet = ends(cylinder)[:3, 0]
    angles = torch.rad2deg(torch.atan2(feet[:, 1], feet[:, 0]))
    torch.testing.assert_close(angles, torch.tensor([30, 150, -90]).double())


def test_mirrors_in_two_planes_make_four():
    legs = shapes.mirror(shapes.line((1, 2, 0), (1, 2, 3)), "x", "y")
    feet = {tuple(p) for p in ends(legs)[:, 0].tolist()}
    assert feet == {(1, 2, 0), (-1, 2, 0), (1, -2, 0), (-1, -2, 0)}


def test_circles_stay_exact_when_stretched_and_moved():
    strokes = shapes.move(shapes.stretch(shapes.ring((0, 0, 0), 1.0), (2, 1, 1)), (0, 0, 4))
    points = on(strokes)
    equation = (points[..., 0] / 2) ** 2 + points[..., 1] ** 2
    torch.testing.assert_close(equation, torch.ones_like(equation), rtol=0, atol=1e-12)
    torch.testing.assert_close(points[..., 2], torch.full((2, 21), 4).double())


def volume(part):
    """What the faces enclose: negative if they are clockwise seen from outside."""
    a, b, c = part.faces.unbind(1)
    return float((a * torch.linalg.cross(b, c)).sum() / 6)


def test_boxes_lathes_and_prisms_are_solid_and_wires_are_not():
    square = shapes.rectangle((0, 0, 0), (2, 3))
    assert volume(shapes.box((1, 2, 3), (2, 4, 6))) == pytest.approx(48)
    assert volume(shapes.extrude(square, (0, 0, 5))) == pytest.approx(30)
    cylinder = shapes.lathe(shapes.line((2, 0, 0), (2, 0, 3)), [(2, 0), (2, 3)])
    # A polygon of 48 sides instead of a circle.
    assert volume(cylinder) == pytest.approx(48 / 2 * math.sin(math.tau / 48) * 4 * 3)
    cone = shapes.lathe(shapes.join(shapes.line((2, 0, 0), (1, 0, 1)), shapes.line((1, 0, 1), (0, 0, 2))), [])
    assert volume(cone) == pytest.approx(48 / 2 * math.sin(math.tau / 48) * (7 / 3 + 1 / 3), rel=1e-12)
    assert volume(shapes.ball((1, 0, 0), (1, 2, 3))) == pytest.approx(8 * math.pi, rel=0.01)
    for wire in (square, shapes.polyline((0, 0, 0), (1, 0, 0)), shapes.ring((0, 0, 0), 1.0)):
        assert not len(wire.faces)


def test_open_lathes_have_no_lids():
    wall = shapes.line((2, 0, 0), (2, 0, 3))
    closed, looked_into = shapes.lathe(wall, []), shapes.lathe(wall, [], open=True)
    assert len(closed.faces) - len(looked_into.faces) == 2 * 48
    assert bool((looked_into.faces[..., :2].norm(dim=-1) > 1.9).all())


def test_faces_go_where_strokes_go_and_stay_turned_outwards():
    box = shapes.box((1, 2, 3), (2, 4, 6))
    for moved, size in (
        (shapes.move(box, (5, 0, 0)), 48),
        (shapes.stretch(box, (2, 1, 0.5)), 48),
        (shapes.stretch(box, (2, 3, 1)), 288),
        (shapes.turn(box, 33, "x", (1, 0, 0)), 48),
        (shapes.reflect(box), 48),
        (shapes.mirror(box, "x", "y"), 192),
        (shapes.around(box, 3), 144),
    ):
        assert volume(moved) == pytest.approx(size)
        corners = ends(moved).reshape(-1, 3)
        torch.testing.assert_close(moved.faces.reshape(-1, 3).amin(0), corners.amin(0))
        torch.testing.assert_close(moved.faces.reshape(-1, 3).amax(0), corners.amax(0))
    assert not len(box[:4].faces)


@pytest.mark.parametrize("turned", [0, 40, 90])
def test_outlines_that_are_not_convex_are_filled(turned):
    """An L of area 3 in any plane, in either sense."""
    corners = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
    for points in (corners, corners[::-1]):
        face = shapes.turn(shapes.filled(shapes.polyline(*points, closed=True)), turned, "x").faces
        a, b, c = face.unbind(1)
        assert float(torch.linalg.cross(b - a, c - a).norm(dim=1).sum() / 2) == pytest.approx(3)
        assert len(face) == 4


def test_flesh_reaches_from_one_side_to_the_other():
    """Between two parallel lines, as wide as they are apart: a cylinder."""
    body = shapes.flesh(shapes.line((0, 0, 1), (5, 0, 1)), shapes.line((0, 0, -1), (5, 0, -1)), 1.0)
    assert volume(body) == pytest.approx(48 / 2 * math.sin(math.tau / 48) * 5)
    thin = shapes.flesh(shapes.line((0, 0, 1), (5, 0, 1)), shapes.line((0, 0, -1), (5, 0, -1)), 0.5, 0.5)
    assert volume(thin) == pytest.approx(volume(body) / 2)
    assert not len(body)


def test_a_body_is_as_wide_as_its_sections_say():
    """Between parallel lines; sections in any order, between which the width changes evenly."""
    sides = shapes.line((0, 0, 1), (6, 0, 1)), shapes.line((0, 0, -1), (6, 0, -1))
    body = shapes.body(*sides, ((6, 0, 0), 2.0), ((0, 0, 0), 0.5), ((3, 0, 0), 0.5))
    points = body.faces.reshape(-1, 3)
    for x, half in ((0, 0.5), (1.5, 0.5), (3, 0.5), (4.5, 1.25), (6, 2.0)):
        assert float(points[(points[:, 0] - x).abs() < 1e-6, 1].abs().max()) == pytest.approx(half)
    assert volume(body) == pytest.approx(48 / 2 * math.sin(math.tau / 48) * (3 * 0.5 + 3 * 1.25))
    assert not len(body)


def test_a_sheet_lies_between_two_chains():
    a, b, c = shapes.sheet(shapes.line((0, 0, 0), (2, 0, 0)), shapes.line((0, 3, 0), (4, 3, 0))).faces.unbind(1)
    assert float(torch.linalg.cross(b - a, c - a).norm(dim=1).sum() / 2) == pytest.approx(9)
    assert not len(shapes.sheet(shapes.line((0, 0, 0), (2, 0, 0)), shapes.line((0, 3, 0), (4, 3, 0))))
