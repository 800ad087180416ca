"""Arcs between lines become exactly tangent to them, of the radius that the views show."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import arc, around, ridges_along, segment, turned

from diff3ds.curves.shapes.curve_set import Curves, sampled
from diff3ds.curves.shapes.primitives import Kind, arc_control, fit_circle, line_control
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import map_ridges
from diff3ds.edges.measure import fit_ridges
from diff3ds.edges.measure.fillets import with_fillets
from diff3ds.edges.measure.fit_ridges import fit_to_ridges
from diff3ds.render import Analytic, render

RADIUS, HALF = 0.2, 0.6
TILT = turned(1)
QUARTERS = [
    np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) for a in np.arange(4) * np.pi / 2
]
INNER = HALF - RADIUS
CENTER = np.array([INNER, INNER, 0.0])
X, Y = np.eye(3)[:2]


def rounded_square_views(scatter: float = 0.0, strays: float = 0.0, seed: int = 0):
    """Ridges of the square's outline: exact, or shifted in each view, some by up to a pixel.

    Args:
        scatter: of the shifts, pixels.
        strays: share of the views that are off by more.
    """
    side = segment((HALF, -INNER, 0), (HALF, INNER, 0))
    corner = arc(CENTER, RADIUS * X, RADIUS * Y, 0, np.pi / 2)
    lines = [line @ turn.T @ TILT.T for turn in QUARTERS for line in (side, corner)]
    rng, cameras = np.random.default_rng(seed), around(24, 160)
    ridges = [
        replace(r, points=r.points + rng.normal(0, scatter, 2) + (rng.random() < strays) * rng.uniform(-1, 1, 2))
        for r in ridges_along(cameras, lines)
    ]
    return edge_views(cameras, ridges)


VIEWS = rounded_square_views()


def rounded_square(radius: float, noise: float) -> Curves:
    """Four lines and four quarter circles around a square, tilted, their control points moved at random."""
    inner = HALF - radius
    line = line_control(np.array([HALF, -inner, 0]), np.array([HALF, inner, 0]))
    return around_square(line, arc_control(np.array([inner, inner, 0]), radius * X, radius * Y, 0, np.pi / 2), noise)


def around_square(line: np.ndarray, bow: np.ndarray, noise: float = 0.0) -> Curves:
    """A side and a corner four times, tilted."""
    rng = np.random.default_rng(1)
    pieces = [piece @ turn.T @ TILT.T for turn in QUARTERS for piece in (line, bow)]
    points = torch.from_numpy(np.array(pieces) + noise * rng.normal(size=(8, 4, 3))).float()
    vertex = torch.tensor([[i, (i + 1) % 8] for i in range(8)])
    return Curves(points, torch.tensor([int(Kind.LINE), int(Kind.ARC)] * 4), vertex)


def kinks(curves: Curves) -> torch.Tensor:
    """Angles between each curve and the next, degrees."""
    points, _ = curves.constrained(curves.points)
    out = torch.nn.functional.normalize(points[:, 3] - points[:, 2], dim=1)
    into = torch.nn.functional.normalize(points[:, 1] - points[:, 0], dim=1).roll(-1, 0)
    return torch.rad2deg((out - into).norm(dim=1))


def radii(curves: Curves) -> torch.Tensor:
    """Radii of the arcs from chord and sweep: weights (1 + 2 cos) / 3, chord 2 r sin."""
    points, weights = curves.constrained(curves.points)
    arcs = curves.kind == Kind.ARC
    cosine = (3 * weights[arcs, 1] - 1) / 2
    return (points[arcs, 3] - points[arcs, 0]).norm(dim=1) / (2 * (1 - cosine**2).sqrt())


def test_a_rounded_square_becomes_smooth():
    rough = rounded_square(RADIUS, 0.002)
    assert kinks(rough).max() > 1
    smooth = with_fillets(rough, VIEWS, 0.0)
    assert kinks(smooth).max() < 0.1
    assert radii(smooth).sub(RADIUS).abs().max() < 0.01 * RADIUS


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_the_radius_is_that_of_the_ridges(factor):
    smooth = with_fillets(rounded_square(factor * RADIUS, 0.0), VIEWS, 0.0)
    assert radii(smooth).sub(RADIUS).abs().max() < 0.002 * RADIUS
    assert kinks(smooth).max() < 0.05


@pytest.mark.parametrize("outward", [0.3, 0.9])
def test_an_offset_that_no_rim_has_changes_nothing(outward):
    smooth = with_fillets(rounded_square(1.1 * RADIUS, 0.0), VIEWS, outward)
    assert radii(smooth).sub(RADIUS).abs().max() < 0.002 * RADIUS


@pytest.mark.parametrize("seed", [0, 2])
def test_views_that_are_off_are_not_taken_for_pushed_rims(seed):
    # Half of all parts pushed by the offset would fit these ridges well: with a radius 4 % too large.
    views = rounded_square_views(0.08, 0.2, seed)
    smooth = with_fillets(rounded_square(1.03 * RADIUS, 0.0), views, 0.4)
    assert radii(smooth).sub(RADIUS).abs().max() < 0.005 * RADIUS


@pytest.mark.parametrize("longer", [-0.06, 0.04])
def test_an_arc_that_ends_elsewhere_gets_the_radius_of_the_ridges(longer):
    # Its ends lie on the lines, a fifth of the radius and more from where they should, its middle where it should.
    line = line_control(HALF * X - (INNER + longer) * Y, HALF * X + (INNER + longer) * Y)
    middle = CENTER + RADIUS * (X + Y) / np.sqrt(2)
    circle = fit_circle(np.stack([line[3], middle, line[3][[1, 0, 2]]]))
    at = [np.arctan2((x - circle.center) @ circle.v, (x - circle.center) @ circle.u) for x in (line[3], middle)]
    turn = (at[0] - at[1] + np.pi) % (2 * np.pi) - np.pi
    bow = arc_control(circle.center, circle.radius * circle.u, circle.radius * circle.v, at[1] + turn, at[1] - turn)
    rough = around_square(line, bow)
    assert radii(rough).sub(RADIUS).abs().min() > 0.04 * RADIUS
    smooth = with_fillets(rough, VIEWS, 0.0)
    assert radii(smooth).sub(RADIUS).abs().max() < 0.002 * RADIUS
    assert kinks(smooth).max() < 0.05


def test_a_free_curve_between_lines_becomes_an_arc():
    rough = rounded_square(RADIUS, 0.0)
    kind = torch.tensor([int(Kind.LINE), int(Kind.FREE)] * 4)
    smooth = with_fillets(replace(rough, kind=kind), VIEWS, 0.0)
    assert smooth.kind.tolist() == [int(Kind.LINE), int(Kind.ARC)] * 4
    assert radii(smooth).sub(RADIUS).abs().max() < 0.002 * RADIUS


def test_radii_of_one_drawing_become_equal():
    rough = rounded_square(RADIUS, 0.0005)
    assert radii(rough).std() > 1e-4 * RADIUS
    assert np.ptp(radii(with_fillets(rough, VIEWS, 0.0)).numpy()) < 1e-5 * RADIUS


def test_what_would_move_far_stays():
    rough = rounded_square(RADIUS, 0.0)
    # Of nearly straight arcs, half the corner would be left.
    rough = replace(rough, points=rough.points.clone())
    rough.points[1::2, 1:3] += 0.03 * torch.from_numpy(TILT[:, 2]).float()
    assert torch.equal(with_fillets(rough, VIEWS, 0.0).points, rough.points)


@pytest.mark.parametrize("kind", [Kind.FREE, Kind.LINE])
def test_only_arcs_between_lines_change(kind):
    curves = rounded_square(RADIUS, 0.002)
    other = Curves(curves.points, torch.full((8,), int(kind)), curves.vertex)
    assert torch.equal(with_fillets(other, VIEWS, 0.0).points, other.points)


def test_corners_drawn_in_pictures_keep_their_radius(monkeypatch):
    """Smoothing pulls ridges inwards by their curvature, which next to the lines cannot be measured."""
    cameras, true = around(24, 160), rounded_square(RADIUS, 0.0)
    # As strokes of their own: one stroke covers a pixel once, and does not add up where its sides are near.
    drawn = render(sketch_of(true, 2 / 160).segments(), cameras, antialiasing=Analytic(0.5))
    views = edge_views(cameras, [map_ridges(view.numpy()) for view in drawn.alpha])

    def errors() -> np.ndarray:
        found = sampled(fit_to_ridges(true, views, 0.0))[1::2]
        return np.array([fit_circle(arc).radius for arc in found]) / RADIUS - 1

    assert np.abs(errors()).max() < 0.004
    assert abs(errors().mean()) < 0.0015
    known = fit_ridges.circle_at
    monkeypatch.setattr(fit_ridges, "circle_at", lambda *given, **flat: known(*given[:-1], **flat))
    assert errors().mean() < -0.0035
