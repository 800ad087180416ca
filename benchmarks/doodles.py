"""Drawings of what is none of the library's kinds: letters, shapes, animals, other things, scribbles.

A drawing is a list of polylines (N, 2) in a box of about -1 to 1, y down. Every class is a function of a generator of
chance; `FOR_TEST` names those that no network is trained on.
"""

import math
from collections.abc import Callable

import numpy as np

Line = np.ndarray
Doodle = Callable[[np.random.Generator], list[Line]]

# Letters and digits by strokes on a grid of 4 x 6: column and row of every corner.
LETTERS = {
    "A": "06 20 46,14 34", "B": "00 06 36 45 43 33 03,00 30 41 42 33", "C": "41 30 10 01 05 16 36 45",
    "D": "00 06 26 44 42 20 00", "E": "40 00 06 46,03 33", "F": "40 00 06,03 33", "G": "41 30 10 01 05 16 36 45 43 23",
    "H": "00 06,40 46,03 43", "I": "10 30,20 26,16 36", "J": "10 40,30 35 26 16 05", "K": "00 06,40 03 46",
    "L": "00 06 46", "M": "06 00 23 40 46", "N": "06 00 46 40", "O": "10 01 05 16 36 45 41 30 10",
    "P": "06 00 30 41 42 33 03", "Q": "10 01 05 16 36 45 41 30 10,24 46", "R": "06 00 30 41 42 33 03 46",
    "S": "41 30 10 01 02 13 33 44 45 36 16 05", "T": "00 40,20 26", "U": "00 05 16 36 45 40", "V": "00 26 40",
    "W": "00 16 22 36 40", "X": "00 46,40 06", "Y": "00 23 40,23 26", "Z": "00 40 06 46", "2": "01 10 30 41 42 06 46",
    "3": "00 40 22 33 44 45 36 16 05", "4": "36 30 04 44", "5": "40 00 03 33 44 45 36 06",
    "6": "40 12 04 05 16 36 45 44 33 04",
    "7": "00 40 16", "8": "10 01 02 44 45 36 16 05 04 42 41 30 10", "9": "43 13 02 01 10 30 41 43 36",
    "?": "01 10 30 41 42 24,26 26", "&": "46 02 11 20 31 04 16 26 44",
    "$": "41 30 10 01 13 33 45 36 16 05,20 27",
}  # fmt: skip


def arc(x: float, y: float, wide: float, high: float | None = None, start: float = 0, stop: float = 360) -> Line:
    """Part of an ellipse with these half axes, from and to degrees, clockwise on paper from the right."""
    angles = np.radians(np.linspace(start, stop, 40))
    return np.column_stack([x + wide * np.cos(angles), y + (high or wide) * np.sin(angles)])


def path(*corners: tuple[float, float]) -> Line:
    """Straight lines from corner to corner."""
    return np.array(corners, float)


def closed(*corners: tuple[float, float]) -> Line:
    """The same, and back to the first."""
    return np.array([*corners, corners[0]], float)


def smooth(points: Line, round_trip: bool = False) -> Line:
    """A smooth line through points: Catmull and Rom's."""
    ends = (points[-1:], points[:2]) if round_trip else (points[:1], points[-1:])
    p = np.concatenate([ends[0], points, ends[1]])
    t = np.linspace(0, 1, 8, endpoint=False)[:, None]
    spans = [
        0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
        for a, b, c, d in zip(p, p[1:], p[2:], p[3:], strict=False)
    ]
    return np.concatenate([*spans, points[:1] if round_trip else points[-1:]])


def letters(count: int) -> Doodle:
    """So many letters beside each other."""

    def draw(chance: np.random.Generator) -> list[Line]:
        lines = []
        for i in range(count):
            for stroke in LETTERS[str(chance.choice(list(LETTERS)))].split(","):
                p = np.array([(int(c[0]), int(c[1])) for c in stroke.split()], float) / 3 - (2 / 3, 1)
                lines.append((smooth(p) if chance.random() < 0.4 else p) + (1.8 * i, 0))
        return lines

    return draw


def scribble(chance: np.random.Generator) -> list[Line]:
    """A line that wanders."""
    turn = np.cumsum(chance.normal(chance.normal(0, 0.2), 0.6, chance.integers(15, 90)))
    return [np.cumsum(np.column_stack([np.cos(turn), np.sin(turn)]), 0) * 0.1]


def scribbles(chance: np.random.Generator) -> list[Line]:
    """Several of them."""
    return [line + chance.normal(0, 0.6, 2) for _ in range(chance.integers(2, 6)) for line in scribble(chance)]


def hatching(chance: np.random.Generator) -> list[Line]:
    """Lines beside each other, or one that goes to and fro; crossed at times."""
    n, slant = int(chance.integers(4, 14)), chance.normal(0, 0.4)
    x = np.linspace(-1, 1, n)
    ends = np.column_stack([x, -chance.uniform(0.3, 1, n)]), np.column_stack([x + slant, chance.uniform(0.3, 1, n)])
    if chance.random() < 0.4:
        return [np.stack(ends, 1).reshape(-1, 2)]
    lines = [np.stack(two) for two in zip(*ends, strict=True)]
    return lines + [line[:, ::-1] for line in lines] if chance.random() < 0.3 else lines


def blob(chance: np.random.Generator) -> list[Line]:
    """A closed line."""
    n = int(chance.integers(4, 11))
    turn, radius = np.sort(chance.uniform(0, math.tau, n)), chance.uniform(0.35, 1, n)
    lines = [smooth(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]), round_trip=True)]
    for _ in range(chance.integers(0, 4)):
        lines.append(arc(*chance.normal(0, 0.3, 2), *chance.uniform(0.04, 0.25, 2)))
    return lines


def polygons(chance: np.random.Generator) -> list[Line]:
    """Regular polygons, circles and lines, thrown on paper."""
    lines = []
    for _ in range(chance.integers(1, 6)):
        n, turn = int(chance.choice([2, 3, 4, 4, 5, 6, 40])), chance.uniform(0, math.tau)
        angles = turn + np.arange(n + 1) * math.tau / n
        lines.append(
            np.column_stack([np.cos(angles), np.sin(angles)]) * chance.uniform(0.15, 0.7) + chance.normal(0, 0.5, 2)
        )
    return lines


def _legs(chance: np.random.Generator, xs: tuple[float, ...], top: float, bottom: float) -> list[Line]:
    wide = chance.choice([0.0, 0.09])
    if not wide:
        return [path((x, top), (x + chance.normal(0, 0.06), bottom)) for x in xs]
    return [path((x - wide, top), (x - wide, bottom), (x + wide, bottom), (x + wide, top)) for x in xs]


def _face(chance: np.random.Generator, x: float, y: float, size: float) -> list[Line]:
    """Eyes, mouth, and at times nose and whiskers."""
    lines = [arc(x + side * 0.38 * size, y - 0.2 * size, 0.1 * size) for side in (-1, 1)]
    lines.append(arc(x, y + 0.1 * size, 0.45 * size, 0.4 * size, 20, 160))
    if chance.random() < 0.5:
        lines.append(closed((x - 0.1 * size, y), (x + 0.1 * size, y), (x, y + 0.15 * size)))
    if chance.random() < 0.4:
        near, far = x + 0.3 * size * np.array([-1, 1]), x + 1.2 * size * np.array([-1, 1])
        for start, end in zip(near, far, strict=True):
            lines += [path((start, y + 0.2 * size), (end, y + (0.2 + k) * size)) for k in (-0.2, 0, 0.2)]
    return lines


def _ears(chance: np.random.Generator, x: float, y: float, size: float, kind: str) -> list[Line]:
    if kind == "pointed":
        sides = [np.array(((s * 0.9, -0.4), (s * 0.75, -1.5), (s * 0.2, -0.95))) for s in (-1, 1)]
        return [side * size + (x, y) for side in sides]
    if kind == "round":
        return [arc(x + s * 0.8 * size, y - 0.8 * size, 0.4 * size) for s in (-1, 1)]
    if kind == "long":
        return [arc(x + s * 0.4 * size, y - 1.7 * size, 0.2 * size, 0.8 * size) for s in (-1, 1)]
    return [arc(x + s * 1.0 * size, y + 0.1 * size, 0.25 * size, 0.7 * size) for s in (-1, 1)]


def head_of(ears: str) -> Doodle:
    """The face of an animal."""

    def draw(chance: np.random.Generator) -> list[Line]:
        return [arc(0, 0, 0.8, chance.uniform(0.6, 0.9)), *_ears(chance, 0, 0, 0.75, ears), *_face(chance, 0, 0, 0.75)]

    return draw


def beast(ears: str, neck: float = 0.0, trunk: bool = False) -> Doodle:
    """A four-legged animal from the side."""

    def draw(chance: np.random.Generator) -> list[Line]:
        high = chance.uniform(0.25, 0.4)
        lines = [arc(0, 0, 0.75, high), *_legs(chance, (-0.55, -0.3, 0.3, 0.55), high * 0.8, chance.uniform(0.7, 1.0))]
        x, y, size = 0.85, -0.35 - neck, chance.uniform(0.22, 0.34)
        lines += [arc(x, y, size), *_ears(chance, x, y, size, ears), arc(x + 0.3 * size, y - 0.2 * size, 0.05)]
        if neck:
            lines += [path((0.55, -0.2), (x - 0.15, y + size)), path((0.72, 0.0), (x + 0.1, y + size))]
        if trunk:
            start = x + size
            lines.append(
                smooth(path((start, y), (start + 0.15, y + 0.3), (start + 0.1, y + 0.8), (start + 0.3, y + 0.9)))
            )
        tail = chance.uniform(-0.7, 0.4)
        lines.append(smooth(path((-0.73, 0), (-0.95, tail / 2), (-1.0 - chance.uniform(0, 0.3), tail))))
        return lines

    return draw


def leaf_veins() -> list[Line]:
    """Of a leaf, to both sides."""
    return [path((0, k + 0.25), (side * 0.3, k)) for k in (-0.4, -0.05, 0.3) for side in (-1, 1)]


def star(inner: float) -> Line:
    """A star of five rays; without inner corners if their distance from the middle is 0."""
    if not inner:
        angles = np.radians(-90 + 144 * np.arange(6))
        return np.column_stack([np.cos(angles), np.sin(angles)])
    angles = np.radians(-90 + 36 * np.arange(11))
    return np.column_stack([np.cos(angles), np.sin(angles)]) * np.where(np.arange(11) % 2, inner, 1)[:, None]


def heart() -> Line:
    """A heart."""
    t = np.linspace(0, math.tau, 60)
    y = 5 * np.cos(2 * t) + 2 * np.cos(3 * t) + np.cos(4 * t) - 13 * np.cos(t)
    return np.column_stack([16 * np.sin(t) ** 3, y]) / 17


def coil(turns: float) -> Line:
    """A spiral of radius 1."""
    turn = np.linspace(0, turns * math.tau, int(30 * turns))
    return np.column_stack([turn * np.cos(turn), turn * np.sin(turn)]) / turn[-1]


def hand() -> Line:
    """The outline of a hand."""
    corners = [(-0.4, 0.9), (-0.5, 0.2), (-0.9, -0.1), (-0.8, -0.25), (-0.4, 0)]
    for x, top in ((-0.35, -0.8), (-0.1, -0.95), (0.15, -0.85), (0.38, -0.6)):
        corners += [(x, top), (x + 0.15, top), (x + 0.17, -0.05)]
    return smooth(path(*corners, (0.5, 0.3), (0.35, 0.9)))


def snowflake() -> list[Line]:
    """Six branches."""
    lines = []
    for angle in np.arange(6) * math.tau / 6:
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        lines += [path((0, 0), (1, 0)) @ turn, path((0.8, 0.2), (0.6, 0), (0.8, -0.2)) @ turn]
    return lines


def sun(chance: np.random.Generator) -> list[Line]:
    """A circle with rays."""
    turns = np.arange(n := int(chance.integers(6, 14))) * math.tau / n
    return [arc(0, 0, 0.5), *(np.outer([0.6, 0.95], (math.cos(a), math.sin(a))) for a in turns)]


def cloud(chance: np.random.Generator) -> list[Line]:
    """Arcs around an oval."""
    turns = np.arange(n := int(chance.integers(5, 9))) * 360 / n
    middles = [(0.65 * math.cos(math.radians(a)), 0.4 * math.sin(math.radians(a))) for a in turns]
    return [arc(x, y, 0.33, 0.3, a - 95, a + 95) for a, (x, y) in zip(turns, middles, strict=True)]


def gulls(chance: np.random.Generator) -> list[Line]:
    """Birds far away."""
    birds = range(int(chance.integers(1, 4)))
    return [arc(side * 0.5 + k, 0.3 * k, 0.5, 0.4, 180, 360) for k in birds for side in (-1, 1)]


def snake(chance: np.random.Generator) -> list[Line]:
    """Two waves and a head."""
    x = np.linspace(-1, 1, 30)
    y = 0.25 * np.sin(x * chance.uniform(5, 12))
    return [np.column_stack([x, y]), np.column_stack([x, y + 0.15]), arc(1.1, y[-1] + 0.07, 0.15, 0.12)]


def spiral(chance: np.random.Generator) -> list[Line]:
    """Some turns."""
    return [coil(chance.uniform(2, 5))]


def zigzag(chance: np.random.Generator) -> list[Line]:
    """A line to and fro."""
    n = int(chance.integers(4, 12))
    return [np.column_stack([np.linspace(-1, 1, n), 0.3 * (-1.0) ** np.arange(n)])]


def waves(chance: np.random.Generator) -> list[Line]:
    """Waves over each other."""
    x = np.linspace(-1, 1, 60)
    return [np.column_stack([x, 0.15 * np.sin(9 * x) + y]) for y in np.arange(chance.integers(1, 5)) * 0.35]


def cube(chance: np.random.Generator) -> list[Line]:
    """Three faces of a box."""
    d = chance.uniform(0.2, 0.5)
    rim = path((-0.7, -0.4), (-0.7 + d, -0.4 - d), (0.4 + d, -0.4 - d), (0.4 + d, 0.7 - d), (0.4, 0.7))
    front = closed((-0.7, -0.4), (0.4, -0.4), (0.4, 0.7), (-0.7, 0.7))
    return [front, rim, path((0.4, -0.4), (0.4 + d, -0.4 - d))]


def ring(chance: np.random.Generator) -> list[Line]:
    """Two circles."""
    return [arc(0, 0, 0.9), arc(0, 0, chance.uniform(0.4, 0.8))]


def person(chance: np.random.Generator) -> list[Line]:
    """A stick figure."""
    arms = chance.normal(0, 0.3)
    limbs = [path((-0.5, -0.2 + arms), (0, -0.3), (0.5, -0.2 + arms)), path((-0.4, 1), (0, 0.3), (0.4, 1))]
    return [arc(0, -0.75, 0.25), path((0, -0.5), (0, 0.3)), *limbs]


def face(chance: np.random.Generator) -> list[Line]:
    """A face."""
    return [arc(0, 0, 0.8, 0.9), *_face(chance, 0, 0, 0.8)]


def octopus(chance: np.random.Generator) -> list[Line]:
    """A head with arms."""
    arms = [
        path((x, 0.1), (x * 1.3 + 0.1, 0.4), (x * 1.4 - 0.1, 0.65), (x * 1.7, 0.95))
        for x in np.linspace(-0.45, 0.45, 6)
    ]
    return [arc(0, -0.3, 0.5, 0.6, 150, 390), *_face(chance, 0, -0.35, 0.4), *map(smooth, arms)]


# Those of which all have one shape, but for the hand that draws them.
SHAPES: dict[str, list[Line]] = {
    "bird": [
        arc(0, 0, 0.6, 0.4), arc(0.6, -0.45, 0.25), closed((0.83, -0.5), (1.1, -0.42), (0.83, -0.35)),
        path((-0.55, -0.1), (-1.0, -0.25), (-0.95, 0.1), (-0.55, 0.12)), arc(-0.05, 0, 0.35, 0.22, 0, 180),
        path((-0.1, 0.38), (-0.13, 0.8)), path((0.15, 0.38), (0.15, 0.8)), arc(0.66, -0.5, 0.04),
    ],
    "spider": [
        arc(0, 0, 0.35), arc(0, -0.45, 0.18),
        *(path((s * 0.3, k * 0.15), (s * 0.7, k * 0.3 - 0.25), (s * 1.0, k * 0.4 + 0.2))
          for s in (-1, 1) for k in (-1.5, -0.5, 0.5, 1.5)),
    ],
    "butterfly": [
        arc(0, 0, 0.07, 0.5), path((0, -0.5), (-0.2, -0.85)), path((0, -0.5), (0.2, -0.85)),
        *(arc(s * 0.45, y, 0.4, 0.35) for s in (-1, 1) for y in (-0.3, 0.32)),
    ],
    "snail": [
        0.6 * coil(3), smooth(path((-0.9, 0.65), (0.3, 0.65), (0.8, 0.4), (0.85, -0.1))),
        path((0.75, -0.45), (0.85, -0.1), (1.0, -0.45)),
    ],
    "turtle": [
        arc(0, 0, 0.7, 0.55, 180, 360), path((-0.7, 0), (0.7, 0)), arc(0.9, -0.1, 0.2), path((-0.3, -0.5), (-0.1, 0)),
        path((0.3, -0.5), (0.1, 0)), path((-0.5, 0), (-0.5, 0.25)), path((0.5, 0), (0.5, 0.25)),
    ],
    "star": [star(0)],
    "outlined star": [star(0.42)],
    "heart": [heart()],
    "moon": [arc(0, 0, 0.9, 0.9, 60, 300), arc(0.35, 0, 0.75, 0.8, 85, 275)],
    "arrow": [path((-1, 0), (1, 0)), path((0.5, -0.4), (1, 0), (0.5, 0.4))],
    "cross": [path((-1, 0), (1, 0)), path((0, -1), (0, 1))],
    "apple": [
        arc(-0.25, 0, 0.5, 0.65, 70, 300), arc(0.25, 0, 0.5, 0.65, -120, 110), path((0, -0.5), (0.1, -0.95)),
        arc(0.3, -0.85, 0.2, 0.1),
    ],
    "ice cream": [closed((-0.4, -0.1), (0, 1), (0.4, -0.1)), arc(0, -0.2, 0.45, 0.5, 170, 370)],
    "screen": [
        closed((-1, -0.7), (1, -0.7), (1, 0.5), (-1, 0.5)), path((-0.4, 0.9), (0, 0.5), (0.4, 0.9)),
        closed((-0.85, -0.55), (0.85, -0.55), (0.85, 0.35), (-0.85, 0.35)),
    ],
    "envelope": [closed((-1, -0.6), (1, -0.6), (1, 0.6), (-1, 0.6)), path((-1, -0.6), (0, 0.1), (1, -0.6))],
    "shirt": [
        closed((-0.3, -0.8), (-1, -0.4), (-0.8, 0), (-0.5, -0.15), (-0.5, 0.9), (0.5, 0.9), (0.5, -0.15), (0.8, 0),
               (1, -0.4), (0.3, -0.8), (0, -0.6)),
    ],
    "trousers": [closed((-0.5, -0.9), (0.5, -0.9), (0.65, 0.9), (0.2, 0.9), (0, -0.2), (-0.2, 0.9), (-0.65, 0.9))],
    "crown": [closed((-0.9, 0.6), (-1, -0.5), (-0.5, 0), (0, -0.7), (0.5, 0), (1, -0.5), (0.9, 0.6))],
    "hand": [hand()],
    "leaf": [arc(0.5, 0, 1, 0.9, 120, 240), arc(-0.5, 0, 1, 0.9, -60, 60), path((0, 1.1), (0, -0.7)), *leaf_veins()],
    "banana": [arc(0, -0.5, 1, 1, 10, 170), arc(0, -0.75, 1, 0.8, 20, 160)],
    "eye": [arc(0, 0.5, 1, 0.9, 215, 325), arc(0, -0.5, 1, 0.9, 35, 145), arc(0, 0, 0.3), arc(0, 0, 0.12)],
    "lightning": [closed((0.2, -1), (-0.5, 0.1), (0, 0.1), (-0.3, 1), (0.6, -0.2), (0.1, -0.2), (0.5, -1))],
    "snowflake": snowflake(),
    "shoe": [smooth(closed((-0.9, -0.5), (-0.9, 0.5), (0.9, 0.5), (0.9, 0.15), (0.2, -0.05), (-0.2, -0.5)))],
    "hat": [arc(0, 0.4, 1, 0.2), path((-0.5, 0.3), (-0.45, -0.7), (0.45, -0.7), (0.5, 0.3))],
    "book": [path((0, -0.5), (-0.9, -0.7), (-0.9, 0.5), (0, 0.7), (0.9, 0.5), (0.9, -0.7), (0, -0.5), (0, 0.7))],
    "ball": [arc(0, 0, 0.9), arc(-1.1, 0, 0.9, 0.9, -50, 50), arc(1.1, 0, 0.9, 0.9, 130, 230)],
    "skull": [
        arc(0, -0.2, 0.8, 0.7, 140, 400), path((-0.5, 0.3), (-0.4, 0.9), (0.4, 0.9), (0.5, 0.3)), arc(-0.3, -0.1, 0.18),
        arc(0.3, -0.1, 0.18), path((-0.15, 0.6), (-0.15, 0.9)), path((0.15, 0.6), (0.15, 0.9)),
    ],
    "drop": [smooth(path((0, -1), (-0.5, 0.2), (0, 0.8), (0.5, 0.2), (0, -1)))],
    "grid": [*(path((-1, y), (1, y)) for y in (-0.33, 0.33)), *(path((x, -1), (x, 1)) for x in (-0.33, 0.33))],
}  # fmt: skip


def still(lines: list[Line]) -> Doodle:
    """A doodle that is always the same."""
    return lambda chance: lines


DOODLES: dict[str, Doodle] = {
    "letter": letters(1), "two letters": letters(2), "word": letters(4), "scribble": scribble, "scribbles": scribbles,
    "hatching": hatching, "blob": blob, "polygons": polygons, "cat's head": head_of("pointed"),
    "bear's head": head_of("round"), "rabbit's head": head_of("long"), "dog's head": head_of("hanging"),
    "cat": beast("pointed"), "mouse": beast("round"), "rabbit": beast("long"), "dog": beast("hanging"),
    "giraffe": beast("pointed", 0.7), "horse": beast("pointed", 0.3), "elephant": beast("hanging", 0, True),
    "octopus": octopus, "gulls": gulls, "snake": snake, "person": person, "face": face, "sun": sun, "cloud": cloud,
    "spiral": spiral, "zigzag": zigzag, "cube": cube, "waves": waves, "ring": ring,
    **{name: still(lines) for name, lines in SHAPES.items()},
}  # fmt: skip
# Those of the test, which no network is trained on or chosen by, and those of validation.
FOR_TEST, FOR_VALIDATION = tuple(DOODLES)[2::3], tuple(DOODLES)[1::6]
