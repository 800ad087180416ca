"""Things of the library that stand, grow, ride or fly outdoors, as people draw them; beside `symbols_indoors`.

A drawing is a list of polylines (N, 2) in a box of about -1 to 1, y down, as in `doodles`. Every kind is a function of
a generator of chance, which varies proportions and parts.
"""

import math

import numpy as np
from doodles import arc, closed, path, smooth
from symbols_indoors import Chance, Lines, Symbol, box, rod, turned, wheels


def airplane(c: Chance) -> Lines:
    """From above, or from the side."""
    if c.random() < 0.5:
        w, sweep = c.uniform(0.08, 0.2), c.uniform(-0.1, 0.4)
        lines = [arc(0, 0, 1, w), path((0.25, -w), (0.05 - sweep, -0.8), (-0.2 - sweep, -0.8), (-0.15, -w))]
        lines += [path((0.25, w), (0.05 - sweep, 0.8), (-0.2 - sweep, 0.8), (-0.15, w))]
        lines += [path((-0.75, s * w * 0.6), (-1, s * 0.35), (-0.95, s * 0.05)) for s in (-1, 1)]
        return turned(lines, c.choice([0, 0, -90, -40]))
    w = c.uniform(0.12, 0.25)
    lines = [arc(0, 0, 1, w), path((-0.7, -w * 0.6), (-1, -0.5), (-0.8, -0.5), (-0.5, -w * 0.8))]
    lines.append(path((0.2, 0), (-0.3, 0.5), (-0.1, 0.5), (0.45, 0.05)))
    if c.random() < 0.4:
        lines.append(path((0.05, -w), (-0.2, -0.45), (0.0, -0.45), (0.3, -w)))
    if c.random() < 0.4:
        lines += [arc(x, -w * 0.3, 0.05) for x in np.linspace(-0.4, 0.5, 4)]
    return turned(lines, c.choice([0, 0, -20]))


def bicycle(c: Chance) -> Lines:
    """From the side."""
    r = c.uniform(0.3, 0.42)
    a, b, seat, bar, crank = (-0.6, 0.3), (0.6, 0.3), (-0.25, -0.3), (0.4, -0.3), (-0.05, 0.3)
    lines = [arc(*a, r), arc(*b, r), path(a, seat, bar, b), path(seat, crank, bar)]
    if c.random() < 0.7:
        lines.append(path(a, crank))
    lines += [path((-0.4, -0.38), (-0.1, -0.38)), path((0.25, -0.5), (0.4, -0.48), (0.4, -0.3))]
    if c.random() < 0.3:
        lines += [np.outer([-r, r], (math.cos(t), math.sin(t))) + p for p in (a, b) for t in (0.3, 1.4, 2.5)]
    return lines[:-1] if c.random() < 0.2 else lines


def bridge(c: Chance) -> Lines:
    """From the side: an arch, arches or towers."""
    which = c.random()
    if which < 0.35:
        lines = [arc(0, 0.5, 1, c.uniform(0.5, 0.9), 180, 360), arc(0, 0.5, 0.8, c.uniform(0.2, 0.45), 180, 360)]
        n = int(c.integers(0, 7))
        return [*lines, *(path((x, 0.3), (x, -0.05)) for x in np.linspace(-0.5, 0.5, n)), path((-1, 0.5), (1, 0.5))]
    if which < 0.6:
        n = int(c.integers(1, 4))
        lines = [path((-1, -0.2), (1, -0.2)), path((-1, -0.05), (1, -0.05))]
        return lines + [arc(x, 0.5, 0.9 / n, 0.5, 180, 360) for x in (np.arange(n) - (n - 1) / 2) * 2 / n]
    lines = [path((-1, 0.2), (1, 0.2)), path((-1, 0.3), (1, 0.3))][: int(c.integers(1, 3))]
    for x in (-0.5, 0.5):
        lines += rod(x, 0.6, x, -0.6, c.choice([0.0, 0.06]))
    lines += [arc(0, -0.6, 0.5, 0.6, 0, 180), path((-1, 0.1), (-0.5, -0.6)), path((1, 0.1), (0.5, -0.6))]
    return lines + [
        path((x, 0.2), (x, -0.6 + 0.6 * math.sqrt(1 - 4 * x * x)))
        for x in np.linspace(-0.35, 0.35, int(c.integers(0, 6)))
    ]


def bus(c: Chance) -> Lines:
    """From the side."""
    h = c.uniform(0.3, 0.55)
    lines = [box(0, 0, 1, h), *wheels(c, (-0.6, 0.6), h, c.uniform(0.13, 0.22))]
    n = int(c.integers(2, 6))
    xs = np.linspace(-0.8, 0.6, n)
    lines += [box(x, -h * 0.45, 0.6 / n, h * 0.28) for x in xs]
    if c.random() < 0.4:
        lines.append(box(0.85, 0.1, 0.1, h * 0.8))
    return lines


def cactus(c: Chance) -> Lines:
    """A trunk with two arms."""
    w, base = c.uniform(0.14, 0.24), path((-0.6, 1), (0.6, 1))
    left, right, a, b = c.uniform(-0.3, 0.3), c.uniform(-0.4, 0.3), c.uniform(0.45, 0.7), c.uniform(0.45, 0.7)
    v = w * 0.8
    trunk = [(-w, 1), (-w, left + v), (-a - v, left + v), (-a - v, left - 0.5), (-a + v, left - 0.5),
             (-a + v, left - v), (-w, left - v), (-w, -0.85), (0, -1), (w, -0.85), (w, right - v), (b - v, right - v),
             (b - v, right - 0.4), (b + v, right - 0.4), (b + v, right + v), (w, right + v), (w, 1)]  # fmt: skip
    outline = path(*trunk)
    lines = [smooth(outline) if c.random() < 0.5 else outline]
    if c.random() < 0.3:
        lines += [path((x, y), (x + 0.06, y - 0.06)) for x, y in c.uniform(-1, 1, (8, 2)) * (w, 0.8)]
    return [*lines, base] if c.random() < 0.25 else lines


def car(c: Chance) -> Lines:
    """From the side."""
    a, b = c.uniform(-0.6, -0.4), c.uniform(0.25, 0.5)
    top = path(
        (-1, 0.25), (-1, 0), (a - 0.1, -0.08), (a + 0.1, -0.5), (b - 0.15, -0.5), (b + 0.1, -0.08), (1, 0), (1, 0.25)
    )
    lines = [
        smooth(top) if c.random() < 0.5 else top,
        path((-1, 0.25), (1, 0.25)),
        *wheels(c, (-0.55, 0.55), 0.28, c.uniform(0.15, 0.25)),
    ]
    if c.random() < 0.5:
        lines.append(closed((a + 0.05, -0.08), (a + 0.15, -0.4), (b - 0.2, -0.4), (b, -0.08)))
    if c.random() < 0.3:
        lines.append(path(((a + b) / 2, -0.45), ((a + b) / 2, 0.25)))
    return lines


def church(c: Chance) -> Lines:
    """With a cross on its roof or tower."""
    w, cross = c.uniform(0.4, 0.8), [path((0, -1), (0, -0.6)), path((-0.12, -0.87), (0.12, -0.87))]
    if c.random() < 0.5:
        lines = [path((-w, 1), (-w, 0.1), (0, -0.6), (w, 0.1), (w, 1), (-w, 1)), *cross]
    else:
        t = c.uniform(0.15, 0.3)
        lines = [box(0, 0.2, t, 0.8), path((-t, -0.3), (0, -0.6), (t, -0.3)), *cross]
        side = c.choice([-1, 1, 0])
        for s in (-1, 1) if side == 0 else (side,):
            lines.append(path((s * t, 0.3), (s * 0.8, 0.3), (s * 0.8, 1), (s * t, 1)))
    if c.random() < 0.7:
        lines += [path((-0.12, 1), (-0.12, 0.65), (0, 0.55), (0.12, 0.65), (0.12, 1))]
    return lines


def fish(c: Chance) -> Lines:
    """From the side."""
    h, tail = c.uniform(0.3, 0.6), c.uniform(0.25, 0.5)
    lines = [arc(0.1, 0, 0.75, h), path((-0.62, 0), (-1, -tail), (-1 + c.uniform(0, 0.15), 0), (-1, tail), (-0.62, 0))]
    if c.random() < 0.4:
        lines = [
            smooth(path((-1, -tail), (-0.5, 0), (0.1, h), (0.85, 0), (0.1, -h), (-0.5, 0), (-1, tail), (-1, -tail)))
        ]
    if c.random() < 0.7:
        lines.append(arc(0.5, -0.1, 0.05))
    if c.random() < 0.4:
        lines.append(arc(0.15, 0, 0.2, h * 0.8, -60, 60))
    if c.random() < 0.3:
        lines.append(path((-0.1, -h), (0.05, -h - 0.2), (0.3, -h * 0.9)))
    return lines


def flower(c: Chance) -> Lines:
    """Petals around a middle, a stem."""
    n, r = int(c.integers(4, 9)), c.uniform(0.12, 0.2)
    y, petal = -0.5, c.uniform(0.14, 0.22)
    turns = np.arange(n) * math.tau / n
    lines = [arc(0, y, r), *(arc((r + petal) * math.cos(t), y + (r + petal) * math.sin(t), petal) for t in turns)]
    if c.random() < 0.9:
        lines.append(smooth(path((0, y + r + petal), (c.normal(0, 0.05), 0.4), (0, 1))))
        if c.random() < 0.6:
            lines += [
                smooth(path((0, 0.5), (s * 0.25, 0.2), (s * 0.35, 0.3), (0, 0.6)))
                for s in (-1, 1)[: int(c.integers(1, 3))]
            ]
    return lines


def balloon(c: Chance) -> Lines:
    """A balloon with a basket."""
    r, y, w = c.uniform(0.5, 0.65), -0.35, c.uniform(0.13, 0.22)
    lines = (
        [smooth(path((-w, 0.4), (-r, -0.2), (0, y - r), (r, -0.2), (w, 0.4)))] if c.random() < 0.5 else [arc(0, y, r)]
    )
    b = c.uniform(0.65, 0.8)
    lines += [box(0, b + 0.13, w, 0.13), path((-w, b), (-w * 1.2, 0.25)), path((w, b), (w * 1.2, 0.25))]
    if c.random() < 0.4:
        lines += [arc(0, y, r * k, r) for k in (0.3, 0.65)[: int(c.integers(1, 3))]]
    return lines


def house(c: Chance) -> Lines:
    """From the front, or with a side."""
    w, over = c.uniform(0.5, 0.85), c.choice([0.0, 0.0, 0.15])
    lines = [box(0, 0.45, w, 0.55), closed((-w - over, -0.1), (0, -c.uniform(0.6, 1)), (w + over, -0.1))]
    if c.random() < 0.7:
        x = c.uniform(-0.5, 0.5) * w
        lines.append(path((x - 0.12, 1), (x - 0.12, 0.5), (x + 0.12, 0.5), (x + 0.12, 1)))
    for x in (-0.6, 0.6)[: int(c.integers(0, 3))]:
        lines.append(box(x * w, 0.3, 0.13, 0.13))
        if c.random() < 0.5:
            lines += [path((x * w - 0.13, 0.3), (x * w + 0.13, 0.3)), path((x * w, 0.17), (x * w, 0.43))]
    if c.random() < 0.3:
        lines.append(path((0.3 * w, -0.45), (0.3 * w, -0.85), (0.5 * w, -0.85), (0.5 * w, -0.3)))
    if c.random() < 0.15:
        d = c.uniform(0.3, 0.7)
        lines += [path((0, -0.7), (d, -0.8), (w + d, -0.2), (w, -0.1)), path((w + d, -0.2), (w + d, 0.85), (w, 1))]
    return lines


def lighthouse(c: Chance) -> Lines:
    """A tower with a light."""
    a, b = c.uniform(0.15, 0.25), c.uniform(0.3, 0.45)
    lines = [
        closed((-a, -0.5), (a, -0.5), (b, 1), (-b, 1)),
        box(0, -0.65, a * 0.8, 0.15),
        path((-a, -0.8), (0, -1), (a, -0.8), (-a, -0.8)),
    ]
    ys = np.linspace(-0.5, 1, int(c.integers(2, 7)))[1:-1]
    if c.random() < 0.6:
        lines += [path((-(a + (b - a) * (y + 0.5) / 1.5), y), (a + (b - a) * (y + 0.5) / 1.5, y)) for y in ys]
    if c.random() < 0.5:
        lines += [
            path((s * a, -0.65), (s * 0.9, -0.65 + k)) for s in (-1, 1)[: int(c.integers(1, 3))] for k in (-0.2, 0.15)
        ]
    return [*lines, arc(0, 1, 0.8, 0.3, 180, 360)] if c.random() < 0.2 else lines


def mushroom(c: Chance) -> Lines:
    """A cap on a stalk."""
    h, w, b = c.uniform(0.6, 1), c.uniform(0.15, 0.35), c.uniform(0.15, 0.4)
    lines = [arc(0, 0, 0.9, h, 180, 360), path((-0.9, 0), (0.9, 0)), path((-w, 0), (-b, 0.9), (b, 0.9), (w, 0))]
    if c.random() < 0.4:
        lines += [arc(x, -h * 0.45, 0.1) for x in (-0.45, 0.0, 0.4)[: int(c.integers(1, 4))]]
    return lines


def rocket(c: Chance) -> Lines:
    """Upright, with fins."""
    w, y = c.uniform(0.2, 0.32), -c.uniform(0.3, 0.6)
    nose = smooth(path((-w, y), (0, -1), (w, y))) if c.random() < 0.5 else path((-w, y), (0, -1), (w, y))
    lines = [
        nose,
        path((-w, y), (-w, 0.6), (w, 0.6), (w, y)),
        *(path((s * w, 0.2), (s * (w + 0.3), 0.75), (s * w, 0.6)) for s in (-1, 1)),
    ]
    if c.random() < 0.6:
        lines.append(path((-w, y), (w, y)))
    if c.random() < 0.7:
        lines += [arc(0, k, 0.1) for k in (-0.15, 0.2)[: int(c.integers(1, 3))]]
    if c.random() < 0.4:
        lines.append(path((-0.15, 0.62), (-0.1, 0.9), (0, 0.75), (0.1, 1), (0.15, 0.62)))
    return turned(lines, c.choice([0, 0, 0, 40]))


def sailing_boat(c: Chance) -> Lines:
    """A hull with one sail or two."""
    h, x = c.uniform(0.25, 0.45), c.uniform(-0.2, 0.2)
    hull = path((-0.9, 0.5), (0.9, 0.5), (0.6, 0.5 + h), (-0.6, 0.5 + h), (-0.9, 0.5))
    if c.random() < 0.4:
        hull = np.concatenate([path((-0.9, 0.5), (0.9, 0.5)), arc(0, 0.5, 0.9, h, 0, 180)])
    lines = [hull, path((x, 0.5), (x, -1))]
    foot = c.uniform(0.0, 0.35)
    lines.append(path((x, -0.95), (x + 0.65, foot), (x, foot)))
    if c.random() < 0.5:
        lines.append(path((x, -0.8), (x - 0.5, foot), (x, foot)))
    return lines


def snowman(c: Chance) -> Lines:
    """Balls upon each other."""
    radii = np.array([0.25, 0.35, 0.45]) * c.uniform(0.85, 1.15, 3)
    if c.random() < 0.35:
        radii = radii[[0, 2]]
    lines, y = [], -1.0
    for i, r in enumerate(radii):
        lines.append(arc(0, y + r, r))
        if i == 0 and c.random() < 0.6:
            lines += [arc(s * 0.09, y + r - 0.05, 0.025) for s in (-1, 1)]
            lines.append(
                arc(0, y + r, 0.12, 0.12, 30, 150)
                if c.random() < 0.5
                else path((0, y + r), (0.25, y + r + 0.04), (0, y + r + 0.06))
            )
        if i == len(radii) - 2 and c.random() < 0.5:
            lines += [path((s * r, y + r), (s * (r + 0.4), y + r - 0.25)) for s in (-1, 1)]
        y += 2 * r
    if c.random() < 0.3:
        lines += [path((-0.3, -1), (0.3, -1)), path((-0.18, -1), (-0.18, -1.3), (0.18, -1.3), (0.18, -1))]
    return lines


def tent(c: Chance) -> Lines:
    """From the front, or with a side."""
    w = c.uniform(0.6, 1)
    lines = [closed((-w, 0.8), (0, -0.8), (w, 0.8))]
    if c.random() < 0.7:
        lines.append(path((-0.3, 0.8), (0, c.uniform(-0.8, 0)), (0.3, 0.8)))
    if c.random() < 0.25:
        lines.append(path((0, -0.8), (0, 0.8)))
    if c.random() < 0.35:
        d = c.uniform(0.5, 1.1)
        lines.append(path((0, -0.8), (d, -0.8 - c.uniform(-0.1, 0.2)), (w + d, 0.5), (w, 0.8)))
    return lines


def tree(c: Chance) -> Lines:
    """A crown on a trunk, or a fir."""
    w = c.uniform(0.08, 0.2)
    trunk = [path((-w, 0.2), (-w * 1.2, 1)), path((w, 0.2), (w * 1.2, 1))]
    if c.random() < 0.2:
        n = int(c.integers(2, 4))
        lines = [
            closed((-0.3 - 0.12 * i, -0.5 + 0.4 * i), (0, -1 + 0.4 * i), (0.3 + 0.12 * i, -0.5 + 0.4 * i))
            for i in range(n)
        ]
        return [*lines, box(0, 0.4 * n - 0.3, 0.1, 0.2)]
    n = int(c.integers(5, 10))
    turns = np.arange(n) * math.tau / n + c.random()
    bumps = [
        arc(0.42 * math.cos(t), -0.35 + 0.38 * math.sin(t), 0.27, 0.25, math.degrees(t) - 95, math.degrees(t) + 95)
        for t in turns
    ]
    which = c.random()
    crown = (
        bumps
        if which < 0.5
        else [arc(0, -0.35, c.uniform(0.5, 0.7), 0.6)]
        if which < 0.75
        else [
            smooth(
                np.column_stack([np.cos(turns), np.sin(turns)]) * c.uniform(0.4, 0.7, (n, 1)) + (0, -0.35),
                round_trip=True,
            )
        ]
    )
    return [*crown, *trunk]


def windmill(c: Chance) -> Lines:
    """A tower with four vanes."""
    a, b, t = c.uniform(0.12, 0.35), c.uniform(0.35, 0.5), c.uniform(0, math.pi / 2)
    lines = [closed((-a, -0.2), (a, -0.2), (b, 1), (-b, 1))]
    if c.random() < 0.5:
        lines.append(path((-a, -0.2), (0, -0.5), (a, -0.2)))
    hub, long, wide = np.array([0, -0.3]), c.uniform(0.55, 0.8), c.uniform(0.08, 0.18)
    vane = (
        closed((0, 0), (0.15, -wide), (long, -wide), (long, wide), (0.15, wide))
        if c.random() < 0.7
        else path((0, 0), (long, 0))
    )
    if c.random() < 0.3:
        vane = closed((0, 0), (long, -wide * 1.5), (long, wide * 1.5))
    lines += [
        line + hub for k in range(4 if c.random() < 0.85 else 3) for line in turned([vane], math.degrees(t) + 90 * k)
    ]
    if c.random() < 0.4:
        lines.append(path((-0.12, 1), (-0.12, 0.65), (0.12, 0.65), (0.12, 1)))
    return lines


OUTDOORS: dict[str, Symbol] = {
    "airplane": airplane,
    "bicycle": bicycle,
    "bridge": bridge,
    "bus": bus,
    "cactus": cactus,
    "car": car,
    "church": church,
    "fish": fish,
    "flower": flower,
    "hot-air balloon": balloon,
    "house": house,
    "lighthouse": lighthouse,
    "mushroom": mushroom,
    "rocket": rocket,
    "sailing boat": sailing_boat,
    "snowman": snowman,
    "tent": tent,
    "tree": tree,
    "windmill": windmill,
}
