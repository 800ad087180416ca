"""Scenes by the interface of DiffVG: drawn by DiffVG itself (benchmarks/diffvg_truth.py) and by diff3ds.pydiffvg."""

import math
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any, NamedTuple

import torch
from torch import Tensor

RED, BLUE, GREEN = (0.875, 0.125, 0.0625, 1.0), (0.125, 0.25, 0.75, 1.0), (0.125, 0.625, 0.25, 1.0)
BLACK = (0.0, 0.0, 0.0, 1.0)
SIZE = 48


class Scene(NamedTuple):
    """What is drawn on a canvas (width, height), as a picture of `pixels` (width, height)."""

    shapes: list[Any]
    groups: list[Any]
    canvas: tuple[int, int] = (SIZE, SIZE)
    pixels: tuple[int, int] = (SIZE, SIZE)
    background: Tensor | None = None


def draw(module: ModuleType, scene: Scene, samples: int = 16, seed: int = 0) -> Tensor:
    """The picture (height, width, 4) of a scene by a module with DiffVG's interface."""
    arguments = module.RenderFunction.serialize_scene(*scene.canvas, scene.shapes, scene.groups)
    return module.RenderFunction.apply(*scene.pixels, samples, samples, seed, scene.background, *arguments)


class Maker:
    """Shapes and groups of one scene by a module with DiffVG's interface."""

    def __init__(self, module: ModuleType) -> None:
        self.module = module
        self.shapes: list[Any] = []
        self.groups: list[Any] = []
        self.options: dict[str, Any] = {}

    def path(self, kinds: Sequence[int], points: Any, width: Any = 1.0, closed: bool = False) -> int:
        """A path of segments with so many inner control points each; half a width for all or one a point."""
        inner = torch.tensor(kinds, dtype=torch.int32)
        half_width = torch.tensor(width, dtype=torch.float32)
        return self.add(self.module.Path(inner, torch.as_tensor(points).float(), closed, half_width))

    def add(self, shape: Any) -> int:
        """Any shape; its number."""
        self.shapes.append(shape)
        return len(self.shapes) - 1

    def group(
        self, shapes: Sequence[int], fill: Any = None, stroke: Any = None, even_odd: bool = True, to: Any = None
    ) -> None:
        """Shapes painted as one; colours are tuples of RGBA or gradients."""
        fill, stroke = (torch.tensor(c) if isinstance(c, tuple) else c for c in (fill, stroke))
        matrix = torch.eye(3) if to is None else torch.tensor([*to, [0.0, 0.0, 1.0]])
        self.groups.append(self.module.ShapeGroup(torch.tensor(shapes), fill, even_odd, stroke, matrix))

    def linear(self, begin: Any, end: Any, *stops: tuple[float, tuple[float, ...]]) -> Any:
        """A linear gradient of stops (offset, colour)."""
        return self.module.LinearGradient(torch.tensor(begin), torch.tensor(end), *_stops(stops))

    def radial(self, center: Any, radius: Any, *stops: tuple[float, tuple[float, ...]]) -> Any:
        """A radial gradient of stops (offset, colour)."""
        return self.module.RadialGradient(torch.tensor(center), torch.tensor(radius), *_stops(stops))

    def circle(self, radius: float, center: Sequence[float], width: float = 1.0) -> int:
        """A circle."""
        return self.add(self.module.Circle(torch.tensor(radius), torch.tensor(center), torch.tensor(width)))

    def ellipse(self, radius: Sequence[float], center: Sequence[float], width: float = 1.0) -> int:
        """An ellipse."""
        return self.add(self.module.Ellipse(torch.tensor(radius), torch.tensor(center), torch.tensor(width)))

    def rect(self, low: Sequence[float], high: Sequence[float], width: float = 1.0) -> int:
        """A rectangle."""
        return self.add(self.module.Rect(torch.tensor(low), torch.tensor(high), torch.tensor(width)))

    def polygon(self, points: Any, closed: bool, width: float = 1.0) -> int:
        """A polygon."""
        return self.add(self.module.Polygon(torch.as_tensor(points).float(), closed, torch.tensor(width)))

    def on(self, **options: Any) -> None:
        """Sets canvas, pixels or background of the scene."""
        self.options = options

    def scene(self) -> Scene:
        """All of it."""
        return Scene(self.shapes, self.groups, **self.options)


def _stops(stops: Sequence[tuple[float, tuple[float, ...]]]) -> tuple[Tensor, Tensor]:
    return torch.tensor([s[0] for s in stops]), torch.tensor([s[1] for s in stops])


def see(color: tuple[float, ...], alpha: float) -> tuple[float, ...]:
    """The colour with another alpha."""
    return (*color[:3], alpha)


ZIGZAG = [[6.0, 38], [16, 8], [27, 37], [41, 11]]
WAVE = [[5.0, 30], [14, -6], [31, 52], [43, 14]]
ARCH = [[6.0, 36], [20, -12], [42, 33]]
MIXED = [[5.0, 12], [14, 8], [22, 2], [27, 16], [31, 34], [39, 44], [44, 30]]
DROP = [[8.0, 8], [38, 6], [46, 24], [34, 41], [20, 47], [2, 36]]
EIGHT = [[24.0, 24], [62, -6], [62, 54], [24, 24], [-14, -6], [-14, 54]]
SQUARE = [[16.25, 15.75], [16.25, 32.5], [31.5, 32.5], [31.5, 15.75]]
LETTER = [[10.0, 44], [18, 4], [28, 4], [38, 44], [30, 44], [27, 33], [18, 33], [16, 44]]
SHEAR = [[0.75, 0.25, 1.0], [-0.25, 0.75, 9.0]]
TWO = ((0.0, RED), (1.0, BLUE))
THREE = ((0.125, (0.0, 0.25, 1.0, 0.25)), (0.5, (1.0, 1.0, 0.0, 1.0)), (0.875, (0.75, 0.0, 0.25, 0.5)))
BLOB = [[24.0, 5], [40, 4], [45, 17], [41, 27], [36, 42], [22, 46], [13, 38], [2, 30], [3, 9]]


Build = Callable[["Maker"], object]


def star(points: int, skip: int = 2) -> Tensor:
    """Corners of a regular polygon, or of a star that crosses itself."""
    angles = torch.arange(points) * (skip * 2 * math.pi / points) + 0.2
    return SIZE / 2 + 20 * torch.stack([angles.sin(), -angles.cos()], 1)


def backdrop(alpha: float) -> Tensor:
    """A picture (SIZE, SIZE, 4) that changes slowly."""
    ramp = torch.arange(SIZE) / 64
    planes = (ramp.expand(SIZE, -1), ramp[:, None].expand(-1, SIZE), torch.tensor(0.25), torch.tensor(alpha))
    return torch.stack([plane.expand(SIZE, SIZE) for plane in planes], -1).contiguous()


def random_strokes(m: Maker) -> None:
    """Many translucent cubics, some of them half outside."""
    generator = torch.Generator().manual_seed(1)
    for _ in range(24):
        points = torch.rand(4, 2, generator=generator) * 64 - 8
        color = (*torch.rand(3, generator=generator).tolist(), 0.375)
        m.group([m.path([2], points, 0.5 + 2 * torch.rand(1, generator=generator).item())], stroke=color)


def tiny_squares(m: Maker) -> None:
    """Squares on a corner, from a fiftieth of a pixel to six pixels."""
    for i in range(36):
        x, y, r = 5 + 7.3 * (i % 6), 5 + 7.3 * (i // 6), 0.1 + 0.05 * i
        m.group([m.path([0] * 4, [[x - r, y], [x, y - r], [x + r, y], [x, y + r]], closed=True)], BLUE)


def ring(m: Maker, inner: list[list[float]], even_odd: bool) -> None:
    """A square within a square."""
    rings = ([[5.0, 5], [43, 7], [41, 42], [6, 40]], inner)
    m.group([m.path([0] * 4, ring, closed=True) for ring in rings], BLUE, even_odd=even_odd)


# Strokes: segments of all kinds, closed, widths of all kinds, groups, order.
STROKES: dict[str, Build] = {
    "lines": lambda m: m.group([m.path([0, 0, 0], ZIGZAG, 2.0)], stroke=BLACK),
    "quadratic": lambda m: m.group([m.path([1], ARCH, 2.5)], stroke=RED),
    "cubic": lambda m: m.group([m.path([2], WAVE, 1.5)], stroke=BLUE),
    "mixed": lambda m: m.group([m.path([0, 1, 2], MIXED, 2.0)], stroke=GREEN),
    "closed lines": lambda m: m.group([m.path([0] * 4, ZIGZAG, 1.75, True)], stroke=RED),
    "closed mixed": lambda m: m.group([m.path([0, 1, 2], DROP, 2.0, True)], stroke=BLUE),
    "closed cubics": lambda m: m.group([m.path([2, 2, 2], BLOB, 1.5, True)], stroke=see(GREEN, 0.625)),
    "width 0": lambda m: (
        m.group([m.path([0, 0, 0], ZIGZAG, 0.0)], stroke=BLACK),
        m.group([m.path([1], ARCH, 1.0)], stroke=RED),
    ),
    "hairline": lambda m: m.group([m.path([2], WAVE, 0.2)], stroke=BLACK),
    "widths of lines": lambda m: m.group([m.path([0, 0, 0], ZIGZAG, [3.0, 1.5, 2.5, 1.0])], stroke=BLACK),
    "widths of a quadratic": lambda m: m.group([m.path([1], ARCH, [1.0, 5.0, 2.0])], stroke=RED),
    "widths of a cubic": lambda m: m.group([m.path([2], WAVE, [3.0, 0.5, 4.0, 1.5])], stroke=BLUE),
    "widths of a closed path": lambda m: m.group(
        [m.path([2, 2, 2], BLOB, [1.0, 2, 3, 1, 0.5, 3, 2, 1, 2], True)], stroke=GREEN
    ),
    "widths to nothing": lambda m: m.group([m.path([2], WAVE, [0.0, 3.0, 3.0, 0.0])], stroke=BLACK),
    "translucent loop": lambda m: m.group(
        [m.path([2], [[8.0, 42], [62, 2], [-14, 2], [40, 42]], 2.5)], stroke=see(RED, 0.5)
    ),
    "cusp": lambda m: m.group([m.path([2], [[10.0, 40], [44, 8], [4, 8], [38, 40]], 2.0)], stroke=BLUE),
    "turns within the width": lambda m: (
        m.group([m.path([1], [[8.0, 30], [24, 8], [40, 30]], 9.0)], stroke=see(GREEN, 0.75)),
        m.group([m.path([2], [[22.0, 42], [23, 36], [25, 36], [26, 42]], 4.0)], stroke=RED),
    ),
    "united strokes": lambda m: m.group(
        [m.path([0, 0, 0], ZIGZAG, 2.5), m.path([1], ARCH, 3.0), m.path([2], WAVE, 1.5)], stroke=see(BLUE, 0.5)
    ),
    "order of groups": lambda m: (
        m.group([m.path([0, 0, 0], ZIGZAG, 3.0)], stroke=RED),
        m.group([m.path([1], ARCH, 3.0)], stroke=GREEN),
        m.group([m.path([2], WAVE, 3.0)], stroke=BLUE),
    ),
    "translucent strokes": lambda m: (
        m.group([m.path([0, 0, 0], ZIGZAG, 3.0)], stroke=see(RED, 0.75)),
        m.group([m.path([1], ARCH, 3.0)], stroke=see(GREEN, 0.5)),
        m.group([m.path([2], WAVE, 3.0)], stroke=see(BLUE, 0.25)),
    ),
    "beyond the canvas": lambda m: m.group(
        [m.path([2, 0], [[-20.0, 10], [10, -30], [40, 80], [60, 20], [20, -9]], 4.0)], stroke=RED
    ),
    "random strokes": random_strokes,
}

# Transforms of groups, and canvases that are not the picture.
TRANSFORMS: dict[str, Build] = {
    "turned stroke": lambda m: m.group([m.path([2], WAVE, 1.5)], stroke=RED, to=[[0.6, -0.8, 26.0], [0.8, 0.6, -12.0]]),
    "sheared stroke": lambda m: m.group(
        [m.path([0, 1, 2], MIXED, 2.0)], stroke=BLUE, to=[[0.75, 0.5, -2.0], [0.0, 1.0, 1.0]]
    ),
    "unevenly scaled stroke": lambda m: m.group(
        [m.path([1], [[2.0, 10], [11, -4], [21, 11]], 1.5)], stroke=GREEN, to=[[2.0, 0.0, 1.0], [0.0, 3.0, 4.0]]
    ),
    "mirrored shapes": lambda m: (
        m.group([m.path([0, 0, 0], ZIGZAG, 1.5)], stroke=RED, to=[[-1.0, 0.0, 48.0], [0.0, 1.0, 0.0]]),
        m.group([m.circle(6.0, [12.0, 14.0])], BLUE, to=[[-1.25, 0.5, 44.0], [0.25, 1.5, 0.0]]),
    ),
    "sheared fill": lambda m: m.group([m.path([2, 2, 2], BLOB, 1.0, True)], RED, to=SHEAR),
    "one shape in two groups": lambda m: (
        m.group([m.path([0, 0, 0], [[4.0, 4], [20, 6], [10, 20]], 1.0, True)], RED),
        m.group([0], BLUE, to=[[1.0, 0.25, 18.0], [0.0, 1.25, 18.0]]),
    ),
    "larger canvas": lambda m: (
        m.group([m.path([1], [[20.0, 90], [60, -10], [116, 80]], 5.0)], stroke=BLUE),
        m.on(canvas=(128, 128)),
    ),
    "smaller canvas": lambda m: (
        m.group([m.path([2, 2, 2], [[x / 3, y / 3] for x, y in BLOB], 0.5, True)], GREEN),
        m.on(canvas=(16, 16)),
    ),
    "canvas of other proportions": lambda m: (
        m.group([m.circle(14.0, [20.0, 40.0], 2.0)], stroke=BLUE),
        m.group([m.path([0], [[6.0, 10], [34, 70]], 2.0)], stroke=GREEN),
        m.on(canvas=(40, 80), pixels=(60, 40)),
    ),
}

# Fills of paths: kinds of segments, both rules, crossings, holes, overlaps.
FILLS: dict[str, Build] = {
    "triangle": lambda m: m.group([m.path([0] * 3, [[6.0, 40], [22, 5], [43, 34]], closed=True)], RED),
    "quadratics": lambda m: m.group(
        [m.path([1] * 3, [[24.0, 4], [50, 8], [40, 30], [30, 50], [14, 38], [-8, 20]], closed=True)], BLUE
    ),
    "cubics": lambda m: m.group([m.path([2] * 3, BLOB, closed=True)], GREEN),
    "mixed fill": lambda m: m.group([m.path([0, 1, 2], DROP, closed=True)], RED),
    "star, even-odd": lambda m: m.group([m.path([0] * 5, star(5), closed=True)], BLUE),
    "star, nonzero": lambda m: m.group([m.path([0] * 5, star(5), closed=True)], BLUE, even_odd=False),
    "double star, even-odd": lambda m: m.group([m.path([0] * 8, star(8, 3), closed=True)], RED),
    "double star, nonzero": lambda m: m.group([m.path([0] * 8, star(8, 3), closed=True)], RED, even_odd=False),
    "eight, even-odd": lambda m: m.group([m.path([2, 2], EIGHT, closed=True)], GREEN),
    "eight, nonzero": lambda m: m.group([m.path([2, 2], EIGHT, closed=True)], GREEN, even_odd=False),
    "hole, even-odd": lambda m: ring(m, SQUARE, True),
    "hole, nonzero": lambda m: ring(m, SQUARE, False),
    "same turn, nonzero": lambda m: ring(m, SQUARE[::-1], False),
    "letter": lambda m: m.group(
        [
            m.path([0] * 8, LETTER, closed=True),
            m.path([0] * 3, [[22.5, 12], [19, 27], [26, 27]], closed=True),
        ],
        BLACK,
    ),
    "crossing circles": lambda m: m.group([m.circle(13.0, [18.0, 20.0]), m.circle(13.0, [31.0, 28.0])], see(RED, 0.75)),
    "slivers": lambda m: [
        m.group([m.path([0] * 3, [[4.0, 4 + i], [44, 5 + 4.5 * i], [44, 5.4 + 4.5 * i]], closed=True)], BLACK)
        for i in range(9)
    ],
    "tiny squares": tiny_squares,
    "translucent fills": lambda m: [
        m.group([m.circle(12.0, [16.0 + 8 * i, 30.0 - 11 * (i % 2)])], see(color, 0.5))
        for i, color in enumerate((RED, GREEN, BLUE))
    ],
    "shared edge": lambda m: (
        m.group([m.path([0] * 3, [[4.0, 4], [44, 4], [4, 40]], closed=True)], RED),
        m.group([m.path([0] * 3, [[44.0, 4], [44, 40], [4, 40]], closed=True)], BLUE),
    ),
}

# Circles, ellipses, rectangles and polygons: fills, strokes, both; backgrounds.
SHAPES: dict[str, Build] = {
    "circle": lambda m: (
        m.group([m.circle(15.5, [23.25, 24.75])], RED),
        m.group([m.circle(0.75, [4.5, 4.25])], BLUE),
    ),
    "ellipse": lambda m: m.group([m.ellipse([19.0, 9.5], [24.5, 23.25])], GREEN),
    "rectangle": lambda m: m.group([m.rect([5.25, 9.5], [40.75, 33.125])], BLUE),
    "polygon": lambda m: m.group([m.polygon(star(7, 1), True)], RED),
    "circle's stroke": lambda m: m.group([m.circle(14.5, [24.0, 23.0], 3.5)], stroke=see(RED, 0.5)),
    "rectangle's stroke": lambda m: m.group([m.rect([9.25, 12.5], [38.75, 34.125], 3.0)], stroke=BLUE),
    "ellipse's stroke": lambda m: m.group([m.ellipse([19.0, 9.5], [24.5, 23.25], 2.0)], stroke=GREEN),
    "polygon's stroke": lambda m: m.group([m.polygon(star(6, 1), True, 2.0)], stroke=BLACK),
    "open polygon's stroke": lambda m: m.group([m.polygon(ZIGZAG, False, 2.0)], stroke=BLACK),
    "turned ellipse and rectangle": lambda m: (
        m.group([m.ellipse([16.0, 6.0], [24.0, 16.0])], RED, to=[[0.8, -0.6, 18.0], [0.6, 0.8, -10.0]]),
        m.group([m.rect([14.0, 26.0], [36.0, 36.0])], BLUE, to=[[0.8, -0.6, 18.0], [0.6, 0.8, -10.0]]),
    ),
    "fill and stroke": lambda m: m.group([m.path([2] * 3, BLOB, 3.0, True)], RED, BLUE),
    "translucent fill and stroke": lambda m: m.group([m.path([2] * 3, BLOB, 3.0, True)], see(RED, 0.5), see(BLUE, 0.5)),
    "opaque background": lambda m: (
        m.group([m.circle(15.0, [24.0, 24.0])], see(RED, 0.5)),
        m.on(background=backdrop(1.0)),
    ),
    "translucent background": lambda m: (
        m.group([m.circle(15.0, [24.0, 24.0])], see(RED, 0.5)),
        m.group([m.path([2], WAVE, 2.0)], stroke=BLUE),
        m.on(background=backdrop(0.5)),
    ),
}

# Colours that change along a line or with a radius; alphas of stops; transforms; canvases.
GRADIENTS: dict[str, Build] = {
    "linear": lambda m: m.group([m.path([2] * 3, BLOB, 3.0, True)], m.linear([8.0, 10.0], [40.0, 36.0], *TWO)),
    "linear, three stops": lambda m: m.group(
        [m.path([2] * 3, BLOB, 3.0, True)], m.linear([4.0, 30.0], [44.0, 20.0], *THREE)
    ),
    "radial": lambda m: m.group([m.path([2] * 3, BLOB, 3.0, True)], m.radial([22.0, 20.0], [22.0, 16.0], *TWO)),
    "radial, three stops": lambda m: m.group(
        [m.path([2] * 3, BLOB, 3.0, True)], m.radial([26.0, 24.0], [18.0, 24.0], *THREE)
    ),
    "strokes of gradients": lambda m: (
        m.group([m.path([2] * 3, BLOB, 3.0, True)], stroke=m.linear([4.0, 30.0], [44.0, 20.0], *THREE)),
        m.group([m.path([0] * 3, ZIGZAG, 2.0)], stroke=m.radial([22.0, 20.0], [22.0, 16.0], *TWO)),
    ),
    "linear and shear": lambda m: m.group(
        [m.path([2] * 3, BLOB, 1.0, True)], m.linear([8.0, 10.0], [40.0, 36.0], *TWO), to=SHEAR
    ),
    "radial and shear": lambda m: m.group(
        [m.path([2] * 3, BLOB, 1.0, True)], m.radial([26.0, 24.0], [18.0, 24.0], *THREE), to=SHEAR
    ),
    "gradients on a wide picture": lambda m: (
        m.group([m.path([2] * 3, BLOB, 3.0, True)], m.radial([22.0, 20.0], [22.0, 16.0], *TWO)),
        m.group([m.path([0] * 3, ZIGZAG, 2.0)], stroke=m.linear([8.0, 10.0], [40.0, 36.0], *THREE)),
        m.on(pixels=(72, 36)),
    ),
}

SCENES = STROKES | TRANSFORMS | FILLS | SHAPES | GRADIENTS


def scene(module: ModuleType, name: str) -> Scene:
    """The scene of this name, made of the module's shapes."""
    maker = Maker(module)
    SCENES[name](maker)
    return maker.scene()
