"""Real roots of polynomials in Bernstein form on [0, 1], of any degree, many at once.

Coefficients that all have one sign have no root between them; one change of sign is one root. Intervals are halved
until it is one or the other (de Casteljau), roots then found by bisection and regula falsi in turn.
"""

import math
from functools import cache

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int

# Halvings after which two roots are taken for one: they are 2^-30 apart.
MOST_HALVINGS = 30
# Steps of a bracketed root: bisections alone would reach the last bit with 53.
STEPS = 60
# Coefficients of which all are smaller than this, as a share of what they are sums of, are zero: rounding.
ROUNDING = 1e-12


def bernstein_roots(coefficients: Float[Array, "N C"]) -> tuple[Int[Index, " R"], Float[Array, " R"]]:
    """Rows and roots, in no order; polynomials that are zero have none, double roots come once or twice."""
    scale = np.abs(coefficients).max(1, initial=0.0)
    row = np.flatnonzero(scale > 0)
    part = coefficients[row] / scale[row, None]
    low, high = np.zeros(len(row)), np.ones(len(row))
    rows, places = [np.zeros(0, np.int64)], [np.zeros(0)]
    for halving in range(MOST_HALVINGS + 1):
        sign = np.sign(part)
        changes = _changes(sign)
        # A root at an end is no change of sign: the end is listed by itself.
        for k, end in ((0, low), (-1, high)):
            at_end = (sign[:, k] == 0) & (np.abs(sign).max(1, initial=0.0) > 0)
            rows.append(row[at_end])
            places.append(end[at_end])
        single = changes == 1
        rows.append(row[single])
        share = _bracketed(part[single])
        places.append(low[single] + share * (high[single] - low[single]))
        rest = changes > 1
        row, part, low, high = row[rest], part[rest], low[rest], high[rest]
        if not len(row) or halving == MOST_HALVINGS:
            rows.append(row)
            places.append((low + high) / 2)
            break
        left, right = _halves(part)
        middle = (low + high) / 2
        row, part = np.concatenate([row, row]), np.concatenate([left, right])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return np.concatenate(rows), np.concatenate(places)


def _changes(sign: Float[Array, "N C"]) -> Int[Index, " N"]:
    """How often signs change along the coefficients, zeros left out."""
    held = sign.copy()
    for k in range(1, held.shape[1]):
        held[:, k] = np.where(held[:, k] == 0, held[:, k - 1], held[:, k])
    return (held[:, 1:] * held[:, :-1] < 0).sum(1)


def _halves(part: Float[Array, "N C"]) -> tuple[Float[Array, "N C"], Float[Array, "N C"]]:
    left, right = [part[:, 0]], [part[:, -1]]
    while part.shape[1] > 1:
        part = (part[:, 1:] + part[:, :-1]) / 2
        left.append(part[:, 0])
        right.append(part[:, -1])
    return np.stack(left, 1), np.stack(right[::-1], 1)


def _bracketed(part: Float[Array, "N C"]) -> Float[Array, " N"]:
    """The root of each polynomial that has one."""
    low, high = np.zeros(len(part)), np.ones(len(part))
    rising = np.sign(_first_sign(part[:, ::-1]))
    found = low.copy()
    active = np.arange(len(part))
    for step in range(STEPS):
        if not len(active):
            break
        p, a, b = part[active], low[active], high[active]
        if step % 2:
            at_a, at_b = value(p, a), value(p, b)
            gap = at_b - at_a
            t = np.where(gap == 0, (a + b) / 2, a - at_a * (b - a) / np.where(gap == 0, 1, gap))
            t = np.clip(t, a + 1e-3 * (b - a), b - 1e-3 * (b - a))
        else:
            t = (a + b) / 2
        above = value(p, t) * rising[active] > 0
        low[active], high[active] = np.where(above, a, t), np.where(above, t, b)
        found[active] = (low[active] + high[active]) / 2
        active = active[high[active] - low[active] > 4e-16]
    return found


def _first_sign(part: Float[Array, "N C"]) -> Float[Array, " N"]:
    """The first coefficient that is not zero."""
    place = (part != 0).argmax(1)
    return part[np.arange(len(part)), place]


def value(part: Float[Array, "N C"], t: Float[Array, " N"]) -> Float[Array, " N"]:
    """Of each polynomial at a place of its own."""
    while part.shape[1] > 1:
        part = part[:, :-1] * (1 - t)[:, None] + part[:, 1:] * t[:, None]
    return part[:, 0]


def quadratic_form(control: Float[Array, "N K 4"], form: Float[Array, "N 4 4"]) -> Float[Array, "N C"]:
    """Coefficients of p(t)ᵀ form p(t), of twice the degree of the homogeneous curve p; zero where rounding is all."""
    terms = np.einsum("nia,nab,njb->nij", control, form, control)
    most = np.einsum("nia,nab,njb->n", np.abs(control), np.abs(form), np.abs(control))
    coefficients = np.einsum("cij,nij->nc", _product_table(control.shape[1] - 1), terms)
    return np.where(np.abs(coefficients).max(1, keepdims=True) > ROUNDING * most[:, None], coefficients, 0.0)


@cache
def _product_table(degree: int) -> Float[Array, "C K K"]:
    table = np.zeros((2 * degree + 1, degree + 1, degree + 1))
    for i in range(degree + 1):
        for j in range(degree + 1):
            table[i + j, i, j] = math.comb(degree, i) * math.comb(degree, j) / math.comb(2 * degree, i + j)
    return table
