"""How far analytic coverage is from the area that a stroke covers of a pixel: what documents promise."""

import math

import pytest
import torch

from diff3ds.project import Strokes2D
from diff3ds.render import rasterize

SIZE, FINER = 32, 16
LINE = [[0, 10], [0, 3], [0, -3], [0, -10]]


def cusp(spread: float) -> list[list[float]]:
    return [[-spread, 10], [spread, -10], [-spread, -10], [spread, 10]]


def hairpin(gap: float) -> list[list[float]]:
    return [[-gap / 2, 10], [-gap / 2, -12], [gap / 2, -12], [gap / 2, 10]]


def errors(shape: list[list[float]], width: float, count: int = 12) -> torch.Tensor:
    """Absolute errors of coverage over an image each for strokes of a shape at random angles and places."""
    g = torch.Generator().manual_seed(0)
    angle = 2 * math.pi * torch.rand(count, generator=g, dtype=torch.float64)
    turn = torch.stack([angle.cos(), angle.sin(), -angle.sin(), angle.cos()], -1).reshape(count, 2, 2)
    offset = torch.rand(count, 1, 2, generator=g, dtype=torch.float64)
    points = torch.tensor(shape, dtype=torch.float64) @ turn + SIZE / 2 + offset
    return torch.stack([(_alpha(p, width, 1) - _alpha(p, width, FINER)).abs() for p in points])


def _alpha(points: torch.Tensor, width: float, finer: int) -> torch.Tensor:
    """Coverage; drawn so much finer, and averaged."""
    cubic = torch.ones(1, 1, 4, 4, dtype=torch.float64)
    cubic[0, 0, :, :2] = finer * points
    row = torch.full((1, 1), finer * width / 2, dtype=torch.float64)
    strokes = Strokes2D(cubic, row, torch.zeros(1, 3, dtype=torch.float64), torch.ones(1, dtype=torch.float64))
    alpha = rasterize(strokes, finer * SIZE).alpha[0]
    return alpha.reshape(SIZE, finer, SIZE, finer).mean((1, 3))


def middle(errors: torch.Tensor) -> torch.Tensor:
    """Without the ends of the lines, which are 10 px from the image's centre."""
    return errors[:, 10:22, 10:22]


def test_along_a_line():
    """Within .09, at any angle and width."""
    worst = {width: middle(errors(LINE, width)).max() for width in (0.25, 0.5, 1.0, 1.5, 2.0, 4.0)}
    assert all(error < 0.09 for error in worst.values())
    assert max(worst.values()) > 0.07
    assert worst[4.0] < 0.05


@pytest.mark.parametrize(("width", "promised"), [(0.5, 0.26), (1.0, 0.16), (2.0, 0.09)])
def test_round_ends(width, promised):
    """Of strokes thinner than some two pixels they come out too dark."""
    assert promised - 0.03 < errors(LINE, width).max() < promised


def test_where_two_parts_of_a_stroke_share_a_pixel():
    """A stroke counts once, by its closest point: in cusps and hairpins up to half a pixel is missing."""
    worst = max(errors(shape(x), width).max() for shape in (cusp, hairpin) for width in (1.0, 3.0) for x in (1, 3))
    assert 0.4 < worst < 0.5
    # Legs that are farther apart than the width and a pixel's diagonal are lines like others.
    assert middle(errors(hairpin(12.0), 3.0)).max() < 0.09
