"""Lens distortion: where a lens shows the directions that a pinhole would see straight."""

import math
from dataclasses import dataclass, replace

import torch
from numpy.polynomial import Polynomial

from diff3ds._shapes import Float, Tensor

# Rounds of Newton's method, which doubles the digits that are right, and the step of its derivatives.
ROUNDS, STEP = 12, 1e-6


@dataclass(frozen=True)
class Distortion:
    """OpenCV's lens models, with those of COLMAP, nerfstudio and Metashape that are like them.

    A direction (x, y, 1) is shown at the place that a pinhole shows (x', y', 1) at. With r^2 = x^2 + y^2,

        x' = x g + 2 p1 x y + p2 (r^2 + 2 x^2) + s1 r^2,    y' = y g + p1 (r^2 + 2 y^2) + 2 p2 x y + s2 r^2,
        g = (1 + k1 r^2 + k2 r^4 + ...) / (1 + d1 r^2 + d2 r^4 + ...).

    Of a fisheye lens (x, y) is first shortened to the length of the angle: (x, y) atan(r) / r takes its place.

    Attributes:
        radial: k1, k2 and so on.
        tangential: p1, p2.
        divisor: d1, d2 and so on.
        prism: s1, s2.
        fisheye: whether the lens is one.
    """

    radial: tuple[float, ...] = ()
    tangential: tuple[float, float] = (0.0, 0.0)
    divisor: tuple[float, ...] = ()
    prism: tuple[float, float] = (0.0, 0.0)
    fisheye: bool = False

    def __bool__(self) -> bool:
        """Whether it changes anything."""
        return self.fisheye or any((*self.radial, *self.tangential, *self.divisor, *self.prism))

    def bent(self, x: Float[Tensor, "*B"], y: Float[Tensor, "*C"]) -> tuple[Float[Tensor, "*D"], Float[Tensor, "*D"]]:
        """(x', y') of directions (x, y, 1), which are broadcast."""
        if self.fisheye:
            away = (x * x + y * y).sqrt().clamp(min=1e-12)
            shorter = away.atan() / away
            x, y = x * shorter, y * shorter
        square, across = x * x + y * y, x * y
        gain = _series(self.radial, square)
        if self.divisor:
            gain = gain / _series(self.divisor, square)
        (p1, p2), (s1, s2) = self.tangential, self.prism
        return (
            x * gain + 2 * p1 * across + p2 * (square + 2 * x * x) + s1 * square,
            y * gain + p1 * (square + 2 * y * y) + 2 * p2 * across + s2 * square,
        )

    def straight(
        self, x: Float[Tensor, " M"], y: Float[Tensor, " M"]
    ) -> tuple[Float[Tensor, " M"], Float[Tensor, " M"]]:
        """Directions (x, y, 1) that are shown at these places, by Newton's method: the inverse of `bent`.

        Places that no direction is shown at get one that is shown elsewhere.
        """
        wanted = torch.stack([x, y], -1)
        found = wanted.clone()
        for _ in range(ROUNDS):
            off = wanted - torch.stack(self.bent(*found.unbind(-1)), -1)
            columns = []
            for axis in range(2):
                step = STEP * torch.eye(2, dtype=found.dtype)[axis]
                ahead, behind = (torch.stack(self.bent(*(found + s * step).unbind(-1)), -1) for s in (1, -1))
                columns.append((ahead - behind) / (2 * STEP))
            (a, c), (b, d) = (column.unbind(-1) for column in columns)
            scale = a * d - b * c
            scale = torch.where(scale.abs() < 1e-9, torch.ones_like(scale), scale)
            u, v = off.unbind(-1)
            found = found + torch.stack([(d * u - b * v) / scale, (a * v - c * u) / scale], -1)
        return found[..., 0], found[..., 1]

    def with_more_k1(self, change: float) -> "Distortion":
        """The lens with this added to k1."""
        first, rest = (self.radial[0], self.radial[1:]) if self.radial else (0.0, ())
        return replace(self, radial=(first + change, *rest)) if change else self

    def fold(self) -> float:
        """Square of the least radius r at which r g stops growing: beyond, the formula shows the same things again."""
        above, below = Polynomial([1.0, *self.radial]), Polynomial([1.0, *self.divisor])
        twice = Polynomial([0.0, 2.0])  # d(r g)/dr = g + 2 s dg/ds, with s = r^2
        slope = above * below + twice * (above.deriv() * below - above * below.deriv())
        roots = [*slope.trim().roots(), *below.trim().roots()]
        # A double root is a real one with a rounding error.
        turn = min((root.real for root in map(complex, roots) if _is_place(root)), default=math.inf)
        if not self.fisheye:
            return turn
        angle = math.sqrt(turn) if turn < (math.pi / 2) ** 2 else math.inf
        return math.tan(angle) ** 2 if angle < math.pi / 2 else math.inf


def _is_place(root: complex) -> bool:
    return root.real > 0 and abs(root.imag) < 1e-6 * abs(root)


def _series(coefficients: tuple[float, ...], square: Float[Tensor, "*B"]) -> Float[Tensor, "*B"]:
    """1 + c1 s + c2 s^2 + ..."""
    total = torch.zeros_like(square)
    for coefficient in reversed(coefficients):
        total = square * (coefficient + total)
    return 1 + total


NO_DISTORTION = Distortion()
