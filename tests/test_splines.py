"""Splines as chains: against scipy's B-splines, the rules that define them, and one another."""

import numpy as np
import pytest
import torch
from scipy.interpolate import BSpline

from diff3ds import Chains, Sketch, bezier
from diff3ds.bezier import evaluate


def some(count: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(count, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def along(points: torch.Tensor, weights: torch.Tensor | None, u: np.ndarray) -> np.ndarray:
    """The chain at parameters in [0, M]."""
    segment = np.minimum(np.floor(u).astype(int), len(points) - 1)
    t = torch.as_tensor(u - segment)[:, None]
    weights = None if weights is None else weights[segment]
    return evaluate(points[segment], weights, t)[:, 0].numpy()


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_nurbs_are_scipys(degree):
    points, weights = some(9), torch.rand(9, generator=torch.Generator().manual_seed(1), dtype=torch.float64) + 0.5
    inner = torch.tensor([0.2, 0.2, 0.5, 0.9, 1.4, 2.0, 2.0, 2.5][: 8 - degree])
    knots = torch.cat([torch.zeros(degree + 1), inner, 3 * torch.ones(degree + 1)]).double()
    segments, segment_weights = bezier.from_nurbs(points, weights, knots)
    control = torch.cat([points * weights[:, None], weights[:, None]], 1).numpy()
    spline = BSpline(knots.numpy(), control, degree)
    distinct = np.unique(knots.numpy())
    assert len(segments) == len(distinct) - 1
    u = np.linspace(0, len(segments) - 1e-9, 200)
    place = np.interp(u, np.arange(len(distinct)), distinct)
    value = spline(place)
    assert np.abs(along(segments, segment_weights, u) - value[:, :3] / value[:, 3:]).max() < 1e-12


@pytest.mark.parametrize("closed", [False, True])
def test_uniform_b_splines_are_scipys(closed):
    points = some(7)
    segments = bezier.b_spline(points, closed)
    assert len(segments) == (7 if closed else 4)
    nodes = torch.cat([points[-1:], points, points[:2]]) if closed else points
    knots = np.arange(len(nodes) + 4) - 3.0
    u = np.linspace(0, len(segments) - 1e-9, 100)
    assert np.abs(along(segments, None, u) - BSpline(knots, nodes.numpy(), 3)(u)).max() < 1e-12
    assert len(Sketch(segments, chains=Chains.of([len(segments)], closed))) == 1


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("alpha", [0.0, 0.5, 1.0])
def test_catmull_rom_goes_through_its_points_smoothly(closed, alpha):
    points = some(6)
    segments = bezier.catmull_rom(points, closed, alpha=alpha)
    assert len(segments) == (6 if closed else 5)
    assert torch.equal(segments[:, 0], points[: len(segments)])
    assert torch.equal(segments[:, -1], points.roll(-1, 0)[: len(segments)])
    ends, starts = Chains.of([len(segments)], closed).joints
    # Velocities with respect to the spline's parameter agree at the joints.
    span = torch.linalg.vector_norm(segments[:, -1] - segments[:, 0], dim=-1, keepdim=True) ** alpha
    out, into = (
        (segments[ends, 3] - segments[ends, 2]) / span[ends],
        (segments[starts, 1] - segments[starts, 0]) / span[starts],
    )
    assert torch.allclose(out, into, atol=1e-12)
    if alpha == 0:
        middle = (points[2] - points[0]) / 2
        assert torch.allclose(3 * (segments[1, 1] - segments[1, 0]), middle, atol=1e-12)


def test_polylines():
    points = some(4)
    assert torch.equal(bezier.polyline(points), torch.stack([points[:-1], points[1:]], 1))
    assert torch.equal(bezier.polyline(points, closed=True)[-1], points[[3, 0]])


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_chains_become_one_nurbs_and_come_back(degree):
    points = Chains.of([3]).joined(some(3 * (degree + 1)).reshape(3, degree + 1, 3))
    weights = torch.rand(3, degree + 1, generator=torch.Generator().manual_seed(2), dtype=torch.float64) + 0.5
    control, control_weights, knots = bezier.to_nurbs(points, weights)
    assert control.shape == (3 * degree + 1, 3)
    assert knots.tolist() == [0] * (degree + 1) + [1] * degree + [2] * degree + [3] * (degree + 1)
    back, back_weights = bezier.from_nurbs(control, control_weights, knots)
    assert torch.allclose(back, points, atol=1e-12)
    # The same curve and parameter: weights of a segment share a factor.
    ratio = back_weights / weights
    assert torch.allclose(ratio, ratio[:, :1].expand_as(ratio), atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: bezier.b_spline(some(3)), "at least 4 points, got \\(3, 3\\)"),
        (lambda: bezier.polyline(some(1)), "at least 2 points"),
        (lambda: bezier.catmull_rom(some(3)[[0, 0, 1]]), "points 0 and 1 coincide"),
        (lambda: bezier.catmull_rom(some(3), alpha=2.0), "alpha must be between 0 and 1, got 2"),
        (lambda: bezier.from_nurbs(some(4), None, torch.zeros(10).double()), "of degree 1 to 3, got 10"),
        (lambda: bezier.from_nurbs(some(4), None, torch.zeros(8).double()), "defined nowhere"),
        (lambda: bezier.from_nurbs(some(4), -torch.ones(4).double(), torch.arange(8.0).double()), "4 positive numbers"),
        (lambda: bezier.from_nurbs(some(4), None, torch.arange(8.0).flip(0).double()), "knots must not decrease"),
        (lambda: bezier.catmull_rom(some(3) * torch.nan), "points must be finite"),
        (lambda: bezier.to_nurbs(some(4)[None], -torch.ones(1, 4).double()), "weights must be positive"),
        (lambda: bezier.to_nurbs(some(8).reshape(2, 4, 3)), "segment 1 must begin where segment 0 ends"),
    ],
)
def test_what_is_no_spline_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
