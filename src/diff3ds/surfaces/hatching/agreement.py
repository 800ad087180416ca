"""Numbers at the fans of a surface that agree with their neighbours: least squares along its edges."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Index, Int

Complex = NDArray[np.complex128]
# From numbers that are wanted to those that agree.
Solve = Callable[[Complex], Complex]


# Pieces of so few are not divided any more: speed only.
FEW = 64
# Of the weights: so little that nothing is levelled by it.
LEVEL = 1e-9


def agreeing(
    points: Float[Array, "N 3"],
    ends: Int[Index, "E 2"],
    turn: Float[Array, " E"],
    weight: Float[Array, " E"],
    held: Float[Array, " N"],
    sign: Float[Array, " E"] | None = None,
) -> Solve:
    """What finds z with the least sum of weight |z'_b - exp(i turn) z_a|² and held |z - wanted|².

    Args:
        points: where each is: neighbours lie close together.
        ends: a and b of each edge.
        turn: radians.
        weight: of each edge.
        held: of each number; positive.
        sign: z' is z, or where this is negative its conjugate; by default z.
    """
    from scipy.sparse import coo_matrix, diags

    count = len(held)
    a, b = ends.T
    # In real and imaginary parts: conjugates are not linear, and for complex matrices SuperLU takes longer.
    c, s, flip = weight * np.cos(turn), weight * np.sin(turn), 1.0 if sign is None else sign
    rows, columns = np.concatenate([b, b, b + count, b + count]), np.concatenate([a, a + count, a, a + count])
    links = coo_matrix((np.concatenate([-c, s, -flip * s, -flip * c]), (rows, columns)), shape=(2 * count, 2 * count))
    total = np.bincount(ends.ravel(), np.repeat(weight, 2), count) + held
    order = _dissected(points, ends)
    rows = np.stack([order, order + count], 1).ravel()
    factored = _factored(links + links.T + diags(np.tile(total, 2)), rows)

    def solve(wanted: Complex) -> Complex:
        real, imaginary = factored(np.concatenate([held * wanted.real, held * wanted.imag])).reshape(2, count)
        return real + 1j * imaginary

    return solve


def levelling(
    points: Float[Array, "N 3"],
    ends: Int[Index, "E 2"],
    weight: Float[Array, " E"],
    sign: Float[Array, " E"],
) -> Callable[[Array], Array]:
    """What finds, for changes along edges that are wanted, those nearest to them that some heights of fans have.

    The least sum of weight (sign height_b - height_a - wanted)²; arguments are those of `agreeing`.
    """
    from scipy.sparse import coo_matrix, diags

    count = len(points)
    a, b = ends.T
    links = coo_matrix((-weight * sign, (b, a)), shape=(count, count))
    total = np.bincount(ends.ravel(), np.repeat(weight, 2), count)
    # Heights may all be higher: a little more holds them.
    factored = _factored(links + links.T + diags(total + LEVEL * weight.mean()), _dissected(points, ends))

    def changes(wanted: Array) -> Array:
        pull = weight * wanted
        forth, back = (np.asarray(np.bincount(*ways, count), np.float64) for ways in ((b, sign * pull), (a, pull)))
        height = factored(forth - back)
        return np.asarray(sign * height[b] - height[a])

    return changes


def _factored(matrix: Any, order: Int[Index, " N"]) -> Callable[[Array], Array]:
    """What solves equations of a sparse, positive definite matrix, whose unknowns are eliminated in an order."""
    from scipy.sparse.linalg import splu

    ordered = matrix.tocsr()[order][:, order].tocsc()
    factors = splu(ordered, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def solve(right: Array) -> Array:
        found = np.empty(len(right))
        found[order] = factors.solve(right[order])
        return found

    return solve


def _dissected(points: Float[Array, "N 3"], ends: Int[Index, "E 2"]) -> Int[Index, " N"]:
    """An order in which elimination fills little: halves first, then what lies between them (George 1973).

    SuperLU's own orders take up to twenty times as long as all the rest.
    """
    from scipy.sparse import coo_matrix

    count = len(points)
    links = coo_matrix((np.ones(len(ends)), ends.T), shape=(count, count))
    links = (links + links.T).tocsr()

    def divided(rows: Int[Index, " R"]) -> list[Index]:
        values = points[rows, np.ptp(points[rows], axis=0).argmax()] if len(rows) > FEW else np.zeros(0)
        low = values <= np.median(values) if len(values) else np.ones(0, bool)
        if low.all():
            return [rows]
        inside = np.zeros(count)
        inside[rows[low]] = 1
        high = rows[~low]
        between = links[high] @ inside > 0
        return [*divided(rows[low]), *divided(high[~between]), high[between]]

    return np.concatenate(divided(np.arange(count)))
