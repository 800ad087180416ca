"""Things of the library that one uses indoors, as people draw them: flat, from the front or the side, parts left out.

A drawing is a list of polylines (N, 2) in a box of about -1 to 1, y down, as in `doodles`. Every kind is a function of
a generator of chance, which varies proportions and parts.
"""

import math
from collections.abc import Callable

import numpy as np
from doodles import Line, arc, closed, path, smooth

Chance = np.random.Generator
Lines = list[Line]
Symbol = Callable[[Chance], Lines]


def box(x: float, y: float, wide: float, high: float) -> Line:
    """A rectangle about a middle, with half sides."""
    return closed((x - wide, y - high), (x + wide, y - high), (x + wide, y + high), (x - wide, y + high))


def rod(x: float, y: float, to_x: float, to_y: float, wide: float) -> Lines:
    """Something long: a line, or two beside each other with an end."""
    if not wide:
        return [path((x, y), (to_x, to_y))]
    across = np.array([to_y - y, x - to_x]) / max(math.hypot(to_x - x, to_y - y), 1e-6) * wide
    a, b = np.array([x, y]), np.array([to_x, to_y])
    return [np.stack([a + across, b + across, b - across, a - across])]


def wheels(c: Chance, xs: tuple[float, ...], y: float, radius: float) -> Lines:
    """Circles, some with hubs."""
    hub = c.random() < 0.3
    return [arc(x, y, r) for x in xs for r in ((radius, radius * 0.4) if hub else (radius,))]


def turned(lines: Lines, degrees: float) -> Lines:
    """The same, turned."""
    a = math.radians(degrees)
    return [line @ np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]]) for line in lines]


def bed(c: Chance) -> Lines:
    """From the side, or from above."""
    if c.random() < 0.25:
        lines = [box(0, 0, 0.6, 1), box(0, -0.7, 0.4, 0.18)]
        return [*lines, path((-0.6, -0.35), (0.6, -0.35))]
    t, leg = c.uniform(0.1, 0.25), c.uniform(0.15, 0.35)
    lines = [box(0, 0, 0.9, t)] if c.random() < 0.7 else [path((-0.9, 0), (0.9, 0))]
    lines += [path((-0.9, -c.uniform(0.2, 0.6)), (-0.9, leg + t)), path((0.9, -c.uniform(0.0, 0.4)), (0.9, leg + t))]
    if c.random() < 0.6:
        lines.append(arc(-0.65, -t - 0.07, 0.2, 0.09))
    return lines


def bookshelf(c: Chance) -> Lines:
    """From the front."""
    w, n = c.uniform(0.4, 0.8), int(c.integers(2, 6))
    ys = np.linspace(-1, 1, n + 1)
    lines = [box(0, 0, w, 1), *(path((-w, y), (w, y)) for y in ys[1:-1])]
    for y in ys[1:]:
        if c.random() < 0.7:
            tops = c.uniform(0.5, 0.85, int(c.integers(2, 7))) * (2 / n)
            x = -w * 0.9 + np.arange(len(tops)) * 0.14
            lines += [path((a, y), (a, y - t), (a + 0.12, y - t), (a + 0.12, y)) for a, t in zip(x, tops, strict=True)]
    return lines


def bottle(c: Chance) -> Lines:
    """From the side."""
    neck, w, shoulder = c.uniform(0.07, 0.16), c.uniform(0.22, 0.5), c.uniform(-0.5, 0.1)
    right = [(neck, -1), (neck, shoulder - c.uniform(0.1, 0.4)), (w, shoulder + 0.1), (w, 1)]
    outline = path(*right, *((-x, y) for x, y in right[::-1]), right[0])
    lines = [smooth(outline[:4]), smooth(outline[4:8]), path(right[-1], (-w, 1)), path((-neck, -1), (neck, -1))]
    if c.random() < 0.4:
        lines.append(box(0, 0.45, w * 0.9, 0.2))
    if c.random() < 0.3:
        lines.append(path((-neck, -0.85), (neck, -0.85)))
    return lines if c.random() < 0.5 else [outline]


def bow(c: Chance) -> Lines:
    """An archery bow, with an arrow at times."""
    bend = c.uniform(0.3, 0.7)
    drawn = c.choice([0.0, 0.0, -0.4])
    lines = [
        smooth(path((0, -1), (bend, -0.5), (bend * 1.15, 0), (bend, 0.5), (0, 1))),
        path((0, -1), (drawn, 0), (0, 1)),
    ]
    if drawn or c.random() < 0.4:
        lines += [path((drawn - 0.1, 0), (1, 0)), path((0.85, -0.1), (1, 0), (0.85, 0.1))]
    return turned(lines, c.choice([0, 0, 180, -40]))


def candle(c: Chance) -> Lines:
    """With a flame."""
    w = c.uniform(0.12, 0.35)
    lines = [box(0, 0.25, w, 0.65), path((0, -0.4), (0, -0.55))]
    lines.append(smooth(path((0, -1), (-0.1, -0.7), (0, -0.55), (0.1, -0.7), (0, -1))))
    if c.random() < 0.3:
        lines.append(arc(0, 0.9, w + 0.25, 0.12))
    return lines


def chair(c: Chance) -> Lines:
    """From the side, or aslant."""
    s, back = c.uniform(0.4, 0.6), -c.uniform(0.7, 1)
    if c.random() < 0.5:
        lines = [path((-s, 1), (-s, back)), path((-s, 0.1), (s, 0.1), (s, 1))]
        if c.random() < 0.4:
            lines.append(path((-s + 0.12, 1), (-s + 0.12, back), (-s, back)))
        return lines
    d = c.uniform(0.15, 0.35)
    seat = closed((-s, 0.1 + d), (-s + d, 0.1), (s + d, 0.1), (s, 0.1 + d))
    lines = [seat, path((-s + d, 0.1), (-s + d, back), (s + d, back), (s + d, 0.1))]
    lines += [path((x, y), (x, y + 0.75)) for x, y in ((-s, 0.1 + d), (s, 0.1 + d), (s + d, 0.1))]
    if c.random() < 0.5:
        lines += [path((x, 0.1), (x, back)) for x in np.linspace(-s + d, s + d, 5)[1:-1]]
    return lines


def clock(c: Chance) -> Lines:
    """A dial with hands."""
    a, b = c.uniform(0, math.tau, 2)
    lines = [arc(0, 0, 1)] + [np.outer([0, r], (math.cos(t), math.sin(t))) for t, r in ((a, 0.5), (b, 0.75))]
    which = c.random()
    turns = np.arange(12) * math.tau / 12
    if which < 0.4:
        lines += [np.outer([0.82, 0.95], (math.cos(t), math.sin(t))) for t in turns[:: int(c.choice([1, 3]))]]
    elif which < 0.75:
        lines += [
            np.array([[-0.04, -0.08], [0.05, -0.05], [-0.02, 0.08]]) + 0.8 * np.array((math.cos(t), math.sin(t)))
            for t in turns
        ]
    return [*lines, arc(0, 0, 1.12)] if c.random() < 0.2 else lines


def glasses(c: Chance) -> Lines:
    """From the front."""
    r, high = c.uniform(0.3, 0.42), c.uniform(0.22, 0.38)
    x = r + c.uniform(0.08, 0.15)
    lens = [arc(s * x, 0, r, high) for s in (-1, 1)] if c.random() < 0.7 else [box(s * x, 0, r, high) for s in (-1, 1)]
    lines = [*lens, arc(0, 0, x - r, 0.1, 180, 360) if c.random() < 0.5 else path((r - x, 0), (x - r, 0))]
    if c.random() < 0.75:
        ends = (c.uniform(0.15, 0.4), -c.uniform(0, 0.5))
        lines += [
            smooth(
                path((s * (x + r), 0), (s * (x + r + ends[0] * 0.5), ends[1]), (s * (x + r + ends[0]), ends[1] + 0.1))
            )
            for s in (-1, 1)
        ]
    return lines


def guitar(c: Chance) -> Lines:
    """From the front."""
    a, b = c.uniform(0.25, 0.33), c.uniform(0.35, 0.45)
    lines = [
        smooth(
            path(
                (-0.08, -0.1),
                (-a, 0.05),
                (-a * 0.8, 0.3),
                (-b, 0.65),
                (0, 1),
                (b, 0.65),
                (a * 0.8, 0.3),
                (a, 0.05),
                (0.08, -0.1),
            )
        )
    ]
    lines += [*rod(0, 0.1, 0, -0.85, 0.06), box(0, -0.92, 0.1, 0.1)]
    if c.random() < 0.7:
        lines.append(arc(0, 0.35, 0.12))
    if c.random() < 0.5:
        lines += [path((x, -0.8), (x, 0.7)) for x in np.linspace(-0.03, 0.03, int(c.integers(1, 4)))]
    return turned(lines, c.choice([0, 0, 45, 90]))


def hammer(c: Chance) -> Lines:
    """From the side."""
    w, h = c.uniform(0.35, 0.6), c.uniform(0.1, 0.2)
    lines = rod(0, 1, 0, -0.6 + (h if c.random() < 0.7 else 0), c.choice([0.0, 0.06, 0.1]))
    if c.random() < 0.6:
        lines.append(box(0, -0.7, w, h))
    else:
        lines.append(
            smooth(
                path((w, -0.7 - h), (w, -0.7 + h), (0, -0.6), (-w, -0.3), (-w * 0.6, -0.8), (0, -0.85), (w, -0.7 - h))
            )
        )
    return turned(lines, c.choice([0, 0, 0, 40, -40]))


def key(c: Chance) -> Lines:
    """A ring, a rod, teeth."""
    r = c.uniform(0.25, 0.4)
    lines = [arc(0, -1 + r, r), *rod(0, -1 + 2 * r, 0, 1, c.choice([0.0, 0.05, 0.1]))]
    if c.random() < 0.5:
        lines.append(arc(0, -1 + r, r * 0.45))
    y, deep = 0.95, c.uniform(0.15, 0.3)
    if c.random() < 0.5:
        lines += [path((0.05, y - k), (deep, y - k)) for k in (0.0, 0.2, 0.4)[: int(c.integers(2, 4))]]
    else:
        lines.append(
            path(
                (0.05, y),
                (deep, y),
                (deep, y - 0.12),
                (0.12, y - 0.12),
                (0.12, y - 0.25),
                (deep, y - 0.25),
                (deep, y - 0.4),
                (0.05, y - 0.4),
            )
        )
    return turned(lines, c.choice([0, 90, 90, -90, -45]))


def ladder(c: Chance) -> Lines:
    """Two rails with rungs."""
    w, n = c.uniform(0.25, 0.45), int(c.integers(3, 9))
    ys = np.linspace(-0.8, 0.8, n)
    return turned(
        [path((-w, -1), (-w, 1)), path((w, -1), (w, 1)), *(path((-w, y), (w, y)) for y in ys)],
        c.choice([0, 0, 15, -15]),
    )


def lamp(c: Chance) -> Lines:
    """A shade on a stand."""
    a, b, y = c.uniform(0.15, 0.35), c.uniform(0.4, 0.6), -c.uniform(0.1, 0.5)
    lines = [closed((-a, -1), (a, -1), (b, y), (-b, y)), *rod(0, y, 0, 0.95, c.choice([0.0, 0.0, 0.05]))]
    base = c.uniform(0.25, 0.5)
    return [*lines, path((-base, 0.95), (base, 0.95)) if c.random() < 0.5 else arc(0, 0.95, base, 0.08)]


def mug(c: Chance) -> Lines:
    """From the side, the handle right or left."""
    w, h, s = c.uniform(0.4, 0.6), c.uniform(0.5, 0.75), int(c.choice([-1, 1]))
    lines = [path((-w, -h), (-w, h), (w, h), (w, -h))]
    lines.append(arc(0, -h, w, 0.12) if c.random() < 0.5 else path((-w, -h), (w, -h)))
    r = c.uniform(0.2, 0.35)
    lines += [
        arc(s * w, 0, k, k * 1.3, 90 - 180 * (s > 0), 270 - 180 * (s > 0))
        for k in (r, r * 0.6)[: int(c.integers(1, 3))]
    ]
    if c.random() < 0.15:
        lines += [smooth(path((x, -h - 0.1), (x + 0.08, -h - 0.25), (x - 0.04, -h - 0.4))) for x in (-0.2, 0, 0.2)]
    return lines


def scissors(c: Chance) -> Lines:
    """Open, from above."""
    a, r = c.uniform(0.15, 0.5), c.uniform(0.15, 0.25)
    lines = [path((-a, -1), (a * 0.6, 0.5)), path((a, -1), (-a * 0.6, 0.5))]
    if c.random() < 0.3:
        lines = [
            closed((-a, -1), (-0.1, 0.1), (0.08, 0.0)),
            closed((a, -1), (0.1, 0.1), (-0.08, 0.0)),
            path((0.1, 0.1), (a * 0.6, 0.5)),
            path((-0.1, 0.1), (-a * 0.6, 0.5)),
        ]
    lines += [arc(s * (a * 0.6 + r * 0.4), 0.5 + r, r, r * c.uniform(1, 1.5)) for s in (-1, 1)]
    return turned(lines, c.choice([0, 0, 90, -90, 45, 180]))


def sofa(c: Chance) -> Lines:
    """From the front."""
    h, arm = c.uniform(0.3, 0.5), c.uniform(0.12, 0.25)
    back = (
        [box(0, -0.15, 1 - arm, h)]
        if c.random() < 0.6
        else [smooth(path((-0.8, 0.1), (-0.8, -h), (0, -h - 0.1), (0.8, -h), (0.8, 0.1)))]
    )
    lines = [*back, box(0, 0.25, 1 - arm, 0.15), *(box(s * (1 - arm / 2), 0.15, arm, 0.28) for s in (-1, 1))]
    if c.random() < 0.4:
        lines.append(path((0, -0.15), (0, 0.4)))
    if c.random() < 0.5:
        lines += [path((s * 0.85, 0.43), (s * 0.85, 0.58)) for s in (-1, 1)]
    return lines


def sword(c: Chance) -> Lines:
    """Upright, a guard and a grip."""
    w, g = c.uniform(0.04, 0.14), c.uniform(0.2, 0.4)
    blade = (
        path((-w, 0.45), (-w, -0.8), (0, -1), (w, -0.8), (w, 0.45)) if c.random() < 0.75 else path((0, 0.5), (0, -1))
    )
    lines = [
        blade,
        box(0, 0.5, g, 0.05) if c.random() < 0.6 else path((-g, 0.5), (g, 0.5)),
        *rod(0, 0.55, 0, 0.95, c.choice([0.0, 0.05])),
    ]
    if c.random() < 0.3:
        lines.append(arc(0, 1, 0.07))
    return turned(lines, c.choice([0, 0, 180, 40, -40, 90]))


def table(c: Chance) -> Lines:
    """From the front, or aslant."""
    t, leg = c.uniform(0.04, 0.12), c.uniform(0.5, 0.9)
    if c.random() < 0.55:
        lines = [box(0, -0.4, 1, t) if c.random() < 0.6 else path((-1, -0.4), (1, -0.4))]
        x = c.uniform(0.7, 1)
        return lines + [line for s in (-1, 1) for line in rod(s * x, -0.4 + t, s * x, leg, c.choice([0.0, 0.06]))]
    d = c.uniform(0.2, 0.5)
    lines = [closed((-1, 0), (-1 + d, -0.4), (1, -0.4), (1 - d, 0))] if c.random() < 0.7 else [arc(0, -0.2, 1, 0.35)]
    return lines + [
        path((x, y), (x, y + leg))
        for x, y in ((-0.95, 0), (0.95 - d, 0), (0.97, -0.35), (-0.85 + d, 0))[: int(c.integers(3, 5))]
    ]


def teapot(c: Chance) -> Lines:
    """From the side."""
    h, s = c.uniform(0.4, 0.6), int(c.choice([-1, 1]))
    lines = [arc(0, 0.1, 0.6, h)] if c.random() < 0.7 else [closed((-0.4, -0.4), (0.4, -0.4), (0.6, 0.6), (-0.6, 0.6))]
    lines.append(
        smooth(
            path((s * 0.5, 0.25), (s * 0.8, 0.0), (s * 0.95, -0.35), (s * 1.05, -0.3), (s * 0.9, 0.15), (s * 0.55, 0.4))
        )
    )
    lines.append(arc(-s * 0.58, 0.1, 0.35, 0.3, 90 + 180 * (s < 0), 270 + 180 * (s < 0)))
    lines += [arc(0, 0.1 - h, 0.3, 0.12, 180, 360), arc(0, -0.05 - h, 0.07)][: int(c.integers(0, 3))]
    return lines


def umbrella(c: Chance) -> Lines:
    """From the side."""
    h, n = c.uniform(0.5, 0.8), int(c.integers(1, 6))
    lines = [arc(0, -0.1, 0.95, h, 180, 360), path((0, -0.1 - h * (c.random() < 0.5)), (0, 0.8))]
    lines += (
        [arc(x, -0.1, 0.95 / n, 0.12, 180, 360) for x in (np.arange(n) - (n - 1) / 2) * 1.9 / n]
        if n > 1
        else [path((-0.95, -0.1), (0.95, -0.1))]
    )
    s = int(c.choice([-1, 1]))
    if c.random() < 0.75:
        lines.append(arc(s * 0.12, 0.8, 0.12, 0.15, 0, 180))
    if n > 2 and c.random() < 0.4:
        lines += [arc(0, -0.1, 0.95 * k, h, 180, 360) for k in (0.35,)]
    return lines


def wine_glass(c: Chance) -> Lines:
    """A bowl on a stem."""
    w, y, foot = c.uniform(0.35, 0.6), c.uniform(-0.2, 0.15), c.uniform(0.25, 0.5)
    bowl = (
        smooth(path((-w, -1), (-w * 1.05, -0.5), (0, y), (w * 1.05, -0.5), (w, -1)))
        if c.random() < 0.7
        else path((-w, -1), (-w, y), (w, y), (w, -1))
    )
    lines = [
        bowl,
        *rod(0, y, 0, 0.9, c.choice([0.0, 0.0, 0.05])),
        path((-foot, 0.9), (foot, 0.9)) if c.random() < 0.5 else arc(0, 0.9, foot, 0.08),
    ]
    lines.append(arc(0, -1, w, 0.1) if c.random() < 0.4 else path((-w, -1), (w, -1)))
    return [*lines, path((-w, -0.65), (w, -0.65))] if c.random() < 0.35 else lines


INDOORS: dict[str, Symbol] = {
    "bed": bed,
    "bookshelf": bookshelf,
    "bottle": bottle,
    "bow": bow,
    "candle": candle,
    "chair": chair,
    "clock": clock,
    "glasses": glasses,
    "guitar": guitar,
    "hammer": hammer,
    "key": key,
    "ladder": ladder,
    "lamp": lamp,
    "mug": mug,
    "scissors": scissors,
    "sofa": sofa,
    "sword": sword,
    "table": table,
    "teapot": teapot,
    "umbrella": umbrella,
    "wine glass": wine_glass,
}
