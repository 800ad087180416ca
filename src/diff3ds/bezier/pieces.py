"""Cuts of rational curves into pieces tame enough for polynomials in the power basis."""

import math
from collections.abc import Iterator
from itertools import pairwise

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import subcurve_matrix
from diff3ds.bezier.polynomial import multiply

# With inner weights above this times the end weights (which a change of parameter makes equal), a curve hurries
# through a part of its interval too small for polynomials on the whole of it. Empirical: between 5 and 100 the
# closest points of 10^5 random curves do not change.
TAME_RATIO = 20.0
# Width of a piece in the logarithm of the odds t / (1 - t): a weight term changes by at most exp(3 * 2) over one.
PIECE_LOG_ODDS = 2.0
# Bernstein coefficients of the cubic through values at 0, 1/3, 2/3 and 1.
CUBIC_THROUGH_THIRDS = (
    torch.tensor([[6.0, 0, 0, 0], [-5, 18, -9, 2], [2, -9, 18, -5], [0, 0, 0, 6]], dtype=torch.float64) / 6
)


def standard_form(control: Float[Tensor, "*B K E"]) -> tuple[Float[Tensor, "*B K E"], Float[Tensor, "*B"]]:
    """The same curves with both end weights 1, by t / (1 - t) = c u / (1 - u); also c."""
    n = control.shape[-2] - 1
    c = (control[..., 0, -1] / control[..., -1, -1]) ** (1 / n)
    power = c[..., None] ** torch.arange(n + 1, dtype=c.dtype, device=c.device)
    return control * (power / control[..., :1, -1])[..., None], c


def from_standard(u: Tensor, c: Tensor) -> Tensor:
    """The parameter t that `standard_form` has turned into u."""
    return c * u / (1 - u + c * u)


def inner_weight(control: Float[Tensor, "*B K E"]) -> Float[Tensor, "*B"]:
    """The largest inner weight of curves in standard form, 0 for lines."""
    inner = control[..., 1:-1, -1].abs()
    return inner.amax(-1) if inner.shape[-1] else control.new_zeros(control.shape[:-2])


def tame_pieces(control: Float[Tensor, "*B K E"]) -> Iterator[tuple[Tensor, Tensor, Tensor, Tensor]]:
    """Pieces of curves in standard form, (piece in standard form, its c, start, stop), tame if the curve was not.

    The cuts have equal distances in the logarithm of the odds, in which weights act by shifts.
    """
    largest = float(inner_weight(control.detach()).max()) if control.numel() else 0.0
    cuts = torch.tensor([0.0, 1.0], dtype=control.dtype, device=control.device)
    if largest > TAME_RATIO:
        # The inner terms outweigh the ends up to odds of n times the weight.
        reach = math.log(3 * largest) + PIECE_LOG_ODDS
        count = math.ceil(2 * reach / PIECE_LOG_ODDS)
        inner = torch.linspace(-reach, reach, count + 1, dtype=control.dtype, device=control.device).sigmoid()
        cuts = torch.cat([cuts[:1], inner, cuts[1:]])
    for start, stop in pairwise(cuts):
        yield *standard_form(subcurve_matrix(start, stop, control.shape[-2] - 1) @ control), start, stop


def power_coefficients(control: Float[Tensor, "*B K E"]) -> Float[Tensor, "*B E K"]:
    """Ascending coefficients in s = 2 u - 1 of each coordinate."""
    return (_power_matrix(control.shape[-2] - 1).to(control) @ control).mT


def _power_matrix(n: int) -> Float[Tensor, "K K"]:
    """Matrix from Bernstein coefficients on [0, 1] to ascending coefficients in s = 2 u - 1."""
    matrix = torch.zeros(n + 1, n + 1, dtype=torch.float64)
    for i in range(n + 1):
        column = torch.tensor([math.comb(n, i) / 2**n], dtype=torch.float64)
        for k in range(n):
            column = multiply(column, torch.tensor([1.0, 1.0 if k < i else -1.0], dtype=torch.float64))
        matrix[:, i] = column
    return matrix


def derivative_numerator(x: Float[Tensor, "*B D K"], w: Float[Tensor, "*B 1 K"]) -> Float[Tensor, "*B D M"]:
    """Ascending coefficients of X' W - X W', degree 2 n - 2: the two terms of degree 2 n - 1 cancel."""
    order = torch.arange(1, x.shape[-1]).to(x)
    numerator = multiply(x[..., 1:] * order, w) - multiply(x, w[..., 1:] * order)
    return numerator[..., :-1]


def polynomial_cubics(part: Float[Tensor, "P 4 E"]) -> tuple[Float[Tensor, "P 4 D"], Float[Tensor, " P"]]:
    """Polynomial cubics for rational ones in standard form, with their ends and tangents, and bounds of the error.

    The velocity of such a rational cubic at its ends is 3 w1 (P1 - P0) and 3 w2 (P3 - P2). The difference N / W - Q has
    the numerator N - Q W, whose Bernstein coefficients (degree 6) over those of W, raised to degree 6 too, bound it,
    for W > 0.
    """
    origin = part[:, :1, :-1]
    weights = part[..., -1:]
    moved = part[..., :-1] - origin * weights
    end = moved[:, 3:]
    zero = torch.zeros_like(end)
    q = torch.cat([zero, moved[:, 1:2], end + moved[:, 2:3] - end * weights[:, 2:3], end], 1)
    table = _product_table().to(part)
    numerator = torch.einsum("kij,pijd->pkd", table, moved[:, None] - q[:, :, None] * weights[:, None])
    denominator = torch.einsum("kij,pjd->pkd", table, weights)
    error = torch.linalg.vector_norm(numerator / denominator, dim=-1).amax(-1)
    # A weight that is not positive gives no bound: NaN compares as too far.
    return q + origin, error


def _product_table() -> Float[Tensor, "7 4 4"]:
    """Coefficients k of the product of two cubics in Bernstein form: sum over i + j = k of table[k, i, j] a_i b_j."""
    table = torch.zeros(7, 4, 4, dtype=torch.float64)
    for i in range(4):
        for j in range(4):
            table[i + j, i, j] = math.comb(3, i) * math.comb(3, j) / math.comb(6, i + j)
    return table
