"""Losses of the sketch itself: known values, and gradients against differences."""

import math

import pytest
import torch

from diff3ds import Chains, Sketch, bezier, losses
from diff3ds.bezier import length


def rings() -> Sketch:
    """A closed circle of radius 2 around the origin, and an open straight stroke of two quadratics."""
    points, weights = bezier.circle((0.0, 0.0, 0.0), 2.0)
    line = torch.tensor([[[0.0, 0, 3], [1, 0, 3], [2, 0, 3]], [[2, 0, 3], [3, 0, 3], [5, 0, 3]]], dtype=torch.float64)
    chains = Chains.of([4, 2], [True, False])
    return Sketch(torch.cat([points, line]), torch.cat([weights, torch.ones(2, 3).double()]), chains=chains)


def some(chains: Chains | None = None, count: int = 3) -> Sketch:
    g = torch.Generator().manual_seed(0)
    points = torch.randn(count, 4, 3, generator=g, dtype=torch.float64)
    weights = 0.5 + torch.rand(count, 4, generator=g, dtype=torch.float64)
    return Sketch(points if chains is None else chains.joined(points), weights, chains=chains)


def test_lengths_and_bending_of_circles_and_lines():
    sketch = rings()
    assert losses.lengths(sketch).tolist() == pytest.approx([4 * math.pi, 5.0], rel=1e-9)
    assert losses.bending_energy(sketch).tolist() == pytest.approx([2 * math.pi / 2, 0.0], abs=1e-6)
    assert losses.uneven_speed(sketch)[4:].tolist() == pytest.approx([0.0, 1 / 3 / 9 * 1.0], abs=1e-9)


def test_lengths_are_those_of_the_curves():
    # A quadrature of a fixed number of nodes: curves that nearly stand still take more.
    sketch = some()
    exact = length(sketch.points, sketch.weights)
    assert torch.allclose(losses.lengths(sketch), exact, rtol=1e-3)


def test_spacing():
    two = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[0, 0.25, 0], [1, 0.25, 0]]])
    assert float(losses.crowding(Sketch(two), 0.2)) == 0
    assert float(losses.crowding(Sketch(two), 0.5)) > 0.2
    # A stroke is no neighbour of itself, whatever its segments.
    assert float(losses.crowding(Sketch(two[:1].repeat(2, 1, 1).flip(1), chains=None)[[0]], 1.0)) == 0
    assert float(losses.crowding(rings()[0], 1.0)) == 0


def test_symmetry():
    sketch = rings()[0]
    assert float(losses.asymmetry(sketch, (1.0, 0, 0))) < 1e-20
    moved = sketch.transform(torch.tensor([[1.0, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).double())
    assert 0.005 < float(losses.asymmetry(moved, (1.0, 0, 0), samples=200)) < 0.04
    assert float(losses.asymmetry(moved, (2.0, 0, 0), offset=0.1)) < 1e-12


def test_ends_that_nearly_meet():
    lines = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[1, 0.1, 0], [1, 1, 0]]])
    assert float(losses.end_gaps(Sketch(lines), 0.2)) == pytest.approx(0.01)
    assert float(losses.end_gaps(Sketch(lines), 0.05)) == 0
    assert float(losses.end_gaps(rings(), 1.0)) == 0


@pytest.mark.parametrize("chains", [pytest.param(None, marks=pytest.mark.slow), Chains.of([2, 1])])
@pytest.mark.parametrize(
    "loss",
    [
        losses.lengths,
        losses.bending_energy,
        losses.uneven_speed,
        lambda s: losses.crowding(s, 1.0, samples=5),
        lambda s: losses.asymmetry(s, (1.0, 0.5, 0.0), 0.1, samples=5),
        lambda s: losses.end_gaps(s, 3.0),
    ],
)
def test_gradients_are_differences(loss, chains):
    start = some(chains)

    def of(points: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
        return loss(Sketch(points if chains is None else chains.joined(points), weights, chains=chains))

    values = start.points.clone().requires_grad_(), start.weights.clone().requires_grad_()
    assert torch.autograd.gradcheck(of, values, rtol=1e-4, atol=1e-6)


def test_a_sketch_without_strokes_costs_nothing():
    empty = Sketch(torch.zeros(0, 4, 3))
    for value in (losses.crowding(empty, 1.0), losses.asymmetry(empty, (1.0, 0, 0)), losses.end_gaps(empty, 1.0)):
        assert float(value) == 0


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: losses.crowding(some(), 0.0), "distance must be a positive number, got 0.0"),
        (lambda: losses.crowding(some(), "wide"), "distance must be a positive number, got 'wide'"),
        (lambda: losses.crowding(some(), 1.0, samples=0), "samples must be a whole number, at least 1, got 0"),
        (lambda: losses.end_gaps(some(), -1.0), "distance must be a positive number"),
        (lambda: losses.asymmetry(some(), (0.0, 0.0, 0.0)), "normal must be three numbers with a length"),
    ],
)
def test_what_means_nothing_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
