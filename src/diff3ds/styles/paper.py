"""Paper: a ground with fibres and specks, as vector paths, drawn by seed."""

import math
from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.drawn_paths import DrawnPath
from diff3ds.page.noise import seed_of, uniform

# A fibre or speck in so many square pixels of a view 512 pixels high. [empirical: seen, but not looked at]
AREA = 420.0
WARM = (0.985, 0.965, 0.92)


@dataclass(frozen=True, eq=False)
class Fibres:
    """Short curved lines of one colour.

    Attributes:
        starts: pixels of the page.
        steps: of a quadratic Bézier from there to its control point, and to its end.
        width: pixels.
        color: as "#rrggbb".
        opacity: in [0, 1].
    """

    starts: Float[Array, "n 2"]
    steps: Float[Array, "n 4"]
    width: float
    color: str
    opacity: float

    def svg(self) -> str:
        """One element."""
        data = "".join(
            f"M{a:g},{b:g}q{c:g},{d:g} {e:g},{f:g}"
            for (a, b), (c, d, e, f) in zip(self.starts.tolist(), self.steps.tolist(), strict=True)
        )
        style = f'fill="none" stroke="{self.color}" stroke-opacity="{self.opacity}" stroke-width="{self.width:g}"'
        return f'<path d="{data}" {style} stroke-linecap="round"/>'

    def drawn(self) -> DrawnPath:
        """As cubics."""
        middle, end = self.steps[:, :2], self.steps[:, 2:]
        steps = np.stack([0 * end, 2 / 3 * middle, end / 3 + 2 / 3 * middle, end], 1)
        r, g, b = (int(self.color[i : i + 2], 16) / 255 for i in (1, 3, 5))
        return DrawnPath((), list(self.starts[:, None] + steps), False, self.width, (r, g, b), self.opacity)


def paper_fibres(size: tuple[float, float], unit: float, seed: int) -> list[Fibres]:
    """What lies on the ground: darker fibres, and lighter ones.

    Args:
        size: (height, width) of the page in pixels.
        unit: pixels of the page to a pixel of a view 512 pixels high.
        seed: of the page.
    """
    height, width = size
    count = math.ceil(height * width / (AREA * unit**2))
    found = []
    for layer, (color, opacity) in enumerate((("#7a6246", 0.16), ("#ffffff", 0.55))):
        x, y, angle, bend, length = (uniform(seed_of(seed, 100, layer, k), count) for k in range(5))
        length, angle, bend = unit * (1 + 9 * length**3), 2 * math.pi * angle, 2 * bend - 1
        direction = np.stack([np.cos(angle), np.sin(angle)], -1) * length[:, None]
        normal = np.stack([-direction[:, 1], direction[:, 0]], -1) * bend[:, None]
        steps = np.concatenate([direction / 2 + normal, direction], 1).round(1)
        starts = np.stack([x * width, y * height], -1).round(1)
        found.append(Fibres(starts, steps, 0.6 * unit, color, opacity))
    return found
