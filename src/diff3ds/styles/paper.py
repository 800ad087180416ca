"""Paper: a ground with fibres and specks, as vector paths, drawn by seed."""

import math

import numpy as np

from diff3ds.page.noise import seed_of, uniform

# A fibre or speck in so many square pixels of a view 512 pixels high. [empirical: seen, but not looked at]
AREA = 420.0
WARM = (0.985, 0.965, 0.92)


def paper_elements(size: tuple[int, int], unit: float, seed: int) -> list[str]:
    """SVG elements of what lies on the ground: darker fibres, and lighter ones.

    Args:
        size: (height, width) of the page in pixels.
        unit: pixels of the page to a pixel of a view 512 pixels high.
        seed: of the page.
    """
    height, width = size
    count = math.ceil(height * width / (AREA * unit**2))
    elements = []
    for layer, (color, opacity) in enumerate((("#7a6246", 0.16), ("#ffffff", 0.55))):
        x, y, angle, bend, length = (uniform(seed_of(seed, 100, layer, k), count) for k in range(5))
        length, angle, bend = unit * (1 + 9 * length**3), 2 * math.pi * angle, 2 * bend - 1
        direction = np.stack([np.cos(angle), np.sin(angle)], -1) * length[:, None]
        normal = np.stack([-direction[:, 1], direction[:, 0]], -1) * bend[:, None]
        steps = np.concatenate([direction / 2 + normal, direction], 1).round(1).tolist()
        starts = np.stack([x * width, y * height], -1).round(1).tolist()
        data = "".join(
            f"M{a:g},{b:g}q{c:g},{d:g} {e:g},{f:g}" for (a, b), (c, d, e, f) in zip(starts, steps, strict=True)
        )
        style = f'fill="none" stroke="{color}" stroke-opacity="{opacity}" stroke-width="{0.6 * unit:g}"'
        elements.append(f'<path d="{data}" {style} stroke-linecap="round"/>')
    return elements
