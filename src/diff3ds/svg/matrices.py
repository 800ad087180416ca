"""Transforms of SVG elements."""

import math
import re
from collections.abc import Callable

from diff3ds.svg.path_data import numbers

# (a, b, c, d, e, f): x' = a x + c y + e, y' = b x + d y + f.
Matrix = tuple[float, float, float, float, float, float]
IDENTITY: Matrix = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)


def parse_transform(text: str) -> Matrix:
    """The product of the transforms of an attribute.

    Raises:
        ValueError: something else.
    """
    matrix = IDENTITY
    rest = text
    for found in re.finditer(r"(\w+)\s*\(([^)]*)\)\s*,?", text):
        rest = rest.replace(found[0], "", 1)
        known = _TRANSFORMS.get(found[1])
        values = numbers(found[2])
        if known is None or len(values) not in known[0]:
            raise ValueError(f"cannot read the transform {found[0]!r}")
        matrix = product(matrix, known[1](*values))
    if rest.strip():
        raise ValueError(f"cannot read the transform {text[:80]!r}")
    return matrix


def _rotation(degrees: float, x: float = 0.0, y: float = 0.0) -> Matrix:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return c, s, -s, c, x - c * x + s * y, y - s * x - c * y


_TRANSFORMS: dict[str, tuple[tuple[int, ...], Callable[..., Matrix]]] = {
    "matrix": ((6,), lambda *v: v),
    "translate": ((1, 2), lambda x, y=0.0: (1.0, 0.0, 0.0, 1.0, x, y)),
    "scale": ((1, 2), lambda x, y=None: (x, 0.0, 0.0, x if y is None else y, 0.0, 0.0)),
    "rotate": ((1, 3), _rotation),
    "skewX": ((1,), lambda a: (1.0, 0.0, math.tan(math.radians(a)), 1.0, 0.0, 0.0)),
    "skewY": ((1,), lambda a: (1.0, math.tan(math.radians(a)), 0.0, 1.0, 0.0, 0.0)),
}


def product(m: Matrix, n: Matrix) -> Matrix:
    """First n, then m."""
    a, b, c, d, e, f = m
    return (
        a * n[0] + c * n[1], b * n[0] + d * n[1],
        a * n[2] + c * n[3], b * n[2] + d * n[3],
        a * n[4] + c * n[5] + e, b * n[4] + d * n[5] + f,
    )  # fmt: skip
