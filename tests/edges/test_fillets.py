"""Arcs between lines become exactly tangent to them."""

import numpy as np
import pytest
import torch

from diff3ds.edges.curves import Curves
from diff3ds.edges.fillets import with_fillets
from diff3ds.edges.primitives import Kind, arc_control, line_control

PIXEL = 0.01


def rounded_square(radius: float, noise: float) -> Curves:
    """Four lines and four quarter circles around the square [-1, 1]², tilted, their vertices moved at random."""
    rng = np.random.default_rng(1)
    tilt = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pieces, kinds = [], []
    for k in range(4):
        turn = np.array(
            [
                [np.cos(k * np.pi / 2), -np.sin(k * np.pi / 2), 0],
                [np.sin(k * np.pi / 2), np.cos(k * np.pi / 2), 0],
                [0, 0, 1],
            ]
        )
        inner = 1 - radius
        line = line_control(np.array([1.0, -inner, 0]), np.array([1.0, inner, 0]))
        arc = arc_control(np.array([inner, inner, 0]), np.array([radius, 0, 0]), np.array([0, radius, 0]), 0, np.pi / 2)
        pieces += [line @ turn.T @ tilt.T, arc @ turn.T @ tilt.T]
        kinds += [Kind.LINE, Kind.ARC]
    points = torch.from_numpy(np.array(pieces) + noise * rng.normal(size=(8, 4, 3))).float()
    vertex = torch.tensor([[i, (i + 1) % 8] for i in range(8)])
    return Curves(points, torch.tensor([int(k) for k in kinds]), vertex, torch.full((8,), -1))


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
    rough = rounded_square(0.3, 0.004)
    assert kinks(rough).max() > 1
    smooth = with_fillets(rough, PIXEL)
    assert kinks(smooth).max() < 0.1
    # The corners' errors, in opposite directions, do not add up in the radius.
    assert radii(smooth).sub(0.3).abs().max() < 0.01


def test_what_is_tangent_stays():
    exact = rounded_square(0.3, 0.0)
    assert torch.allclose(with_fillets(exact, PIXEL).points, exact.points, atol=1e-6)


def test_what_would_move_far_stays():
    rough = rounded_square(0.3, 0.004)
    assert torch.equal(with_fillets(rough, PIXEL / 100).points, rough.points)


@pytest.mark.parametrize("kind", [Kind.FREE, Kind.LINE])
def test_only_arcs_between_lines_change(kind):
    curves = rounded_square(0.3, 0.004)
    other = Curves(curves.points, torch.full((8,), int(kind)), curves.vertex, curves.other)
    assert torch.equal(with_fillets(other, PIXEL).points, other.points)
