"""What children wish for, as people draw it: kinds of which there are no or few drawings; beside `symbols_indoors`.

A drawing is a list of polylines (N, 2) in a box of about -1 to 1, y down, as in `doodles`. Every kind is a function of
a generator of chance, which varies proportions and parts.
"""

from collections.abc import Sequence

import numpy as np
from doodles import DOODLES, arc, closed, path, smooth
from symbols_indoors import INDOORS, Chance, Lines, Symbol, box, rod, turned, wheels
from symbols_outdoors import OUTDOORS

from diff3ds.library import CATEGORIES


def ball(c: Chance) -> Lines:
    """A circle with what makes it a ball: panels, seams, stripes."""
    lines, which = [arc(0, 0, 1)], c.random()
    if which < 0.35:
        turns = np.arange(5) * 2 * np.pi / 5 + c.random()
        inner, outer = (np.column_stack([np.cos(turns), np.sin(turns)]) * r for r in (c.uniform(0.25, 0.4), 0.7))
        lines += [closed(*map(tuple, inner)), *(path(tuple(a), tuple(b)) for a, b in zip(inner, outer, strict=True))]
        return lines + [path(tuple(p), tuple(p @ m)) for p in outer for m in (np.array([[1.2, 0.25], [-0.25, 1.2]]),)]
    if which < 0.65:
        x = c.uniform(1.0, 1.3)
        lines += [arc(-x, 0, 0.9, 0.9, -60, 60), arc(x, 0, 0.9, 0.9, 120, 240)]
        return turned(
            [*lines, path((-1, 0), (1, 0)), path((0, -1), (0, 1))][: int(c.integers(3, 6))], c.uniform(0, 180)
        )
    n = int(c.integers(1, 4))
    return turned([*lines, *(arc(0, 0, w, 1, -90, 90) for w in np.linspace(-0.6, 0.6, n))], c.uniform(-40, 40))


def bowl(c: Chance) -> Lines:
    """Half an ellipse under a rim."""
    h, foot, rim = c.uniform(0.5, 0.9), c.uniform(0.2, 0.45), c.choice([0.0, 0.12, 0.25])
    lines = [arc(0, 0, 1, h, 0, 180), arc(0, 0, 1, rim) if rim else path((-1, 0), (1, 0))]
    if c.random() < 0.6:
        lines.append(path((-foot, h * 0.95), (-foot, h + 0.1), (foot, h + 0.1), (foot, h * 0.95)))
    if c.random() < 0.3:
        lines += [smooth(path((x, -0.3), (x + 0.08, -0.45), (x - 0.05, -0.6), (x, -0.75))) for x in (-0.3, 0, 0.3)]
    return lines


def chest(c: Chance) -> Lines:
    """A box with a round lid and a lock, from the front or with a side."""
    h, lid = c.uniform(0.35, 0.5), c.uniform(0.25, 0.5)
    lines = [box(0, 0.3, 0.9, h), arc(0, 0.3 - h, 0.9, lid, 180, 360)]
    if c.random() < 0.8:
        lines.append(box(0, 0.35 - h, 0.12, 0.14))
    if c.random() < 0.5:
        lines += [path((x, 0.3 + h), (x, 0.3 - h), (x, 0.3 - h - lid * 0.7)) for x in (-0.55, 0.55)]
    return lines


def cupcake(c: Chance) -> Lines:
    """A cup with folds, a top of waves or swirls, perhaps a cherry."""
    w, n = c.uniform(0.45, 0.6), int(c.integers(0, 6))
    lines = [closed((-0.75, 0), (0.75, 0), (w, 1), (-w, 1))]
    lines += [path((x * 0.75, 0.03), (x * w, 1)) for x in np.linspace(-0.7, 0.7, n)]
    if c.random() < 0.5:
        lines += [arc(0, y, r, 0.22, 170, 370) for y, r in ((0, 0.85), (-0.3, 0.6), (-0.6, 0.35))]
    else:
        lines.append(arc(0, 0, 0.85, c.uniform(0.6, 0.9), 180, 360))
        lines.append(arc(0, 0, 0.85, 0.15, 0, 180))
    if c.random() < 0.6:
        lines.append(arc(0, -0.9, 0.13))
    return lines


def dinosaur(c: Chance) -> Lines:
    """A long neck, a round back, a tail; on four legs, or on two with teeth."""
    if c.random() < 0.6:
        neck = c.uniform(0.6, 1.0)
        back = smooth(
            path((-1.3, 0.2), (-0.7, -0.05), (0, -0.4), (0.5, -0.2), (0.75, -neck), (1.1, -neck), (1.1, -0.8 * neck),
                 (0.95, -0.7 * neck), (0.7, 0.15))
        )  # fmt: skip
        belly = smooth(path((-1.3, 0.2), (-0.7, 0.25), (0, 0.35), (0.7, 0.15)))
        legs = [rod(x, 0.25, x, 0.8, 0.09)[0] for x in (-0.5, -0.2, 0.3, 0.55)[: int(c.integers(2, 5))]]
        lines = [back, belly, *legs]
    else:
        body = smooth(path((-1.3, 0.5), (-0.5, 0.1), (0, -0.5), (0.2, -0.9), (0.9, -0.9), (0.9, -0.6), (0.45, -0.5),
                           (0.4, 0.1), (0.1, 0.5), (-0.5, 0.45), (-1.3, 0.5)))  # fmt: skip
        lines = [body, path((0.4, -0.1), (0.65, -0.05)), path((-0.1, 0.45), (-0.15, 0.9), (0.1, 0.9))]
    if c.random() < 0.4:
        lines += [
            closed((x, y), (x + 0.1, y - 0.25), (x + 0.2, y)) for x, y in ((-0.7, -0.05), (-0.4, -0.2), (-0.1, -0.35))
        ]
    if c.random() < 0.7:
        lines.append(arc(0.8, -0.75, 0.05))
    return lines


def heart(c: Chance) -> Lines:
    """One line, or with an arrow."""
    lines = DOODLES["heart"](c)
    return (
        [*lines, path((-1, 0.4), (1, -0.4)), path((0.75, -0.5), (1, -0.4), (0.85, -0.15))]
        if c.random() < 0.2
        else lines
    )


def person(c: Chance) -> Lines:
    """A head on a line with arms and legs, or with a body."""
    r, wide = c.uniform(0.16, 0.28), c.uniform(0.2, 0.5)
    neck, hip = -1 + 2 * r, c.uniform(0.2, 0.4)
    lines = [arc(0, -1 + r, r)]
    arm, reach = neck + 0.15, c.uniform(-0.3, 0.35)
    which = c.random()
    if which < 0.55:
        lines += [path((0, neck), (0, hip)), path((-wide, arm + reach), (0, arm), (wide, arm + reach))]
    elif which < 0.8:
        lines += [box(0, (neck + hip) / 2, 0.22, (hip - neck) / 2)]
        lines += [path((s * 0.22, arm), (s * (0.22 + wide), arm + reach)) for s in (-1, 1)]
    else:
        lines += [closed((0, neck), (0.4, hip), (-0.4, hip))]
        lines += [path((s * 0.1, arm), (s * (0.1 + wide), arm + reach)) for s in (-1, 1)]
    foot = 0.12 * c.integers(0, 2)
    lines += [path((s * 0.08, hip), (s * wide * 0.8, 1), (s * (wide * 0.8 + foot), 1)) for s in (-1, 1)]
    if c.random() < 0.6:
        lines += [arc(s * r * 0.35, -1 + r * 0.85, r * 0.1) for s in (-1, 1)]
        lines.append(arc(0, -1 + r, r * 0.55, r * 0.55, 30, 150))
    if c.random() < 0.3:
        lines.append(arc(0, -1 + r * 0.8, r * 1.2, r * 1.2, 180, 360))
    return lines


def present(c: Chance) -> Lines:
    """A box with a ribbon and a bow."""
    w, h = c.uniform(0.6, 0.9), c.uniform(0.45, 0.8)
    lines = [box(0, 0.2, w, h)]
    lines += [path((x, 0.2 - h), (x, 0.2 + h)) for x in ((0.0,) if c.random() < 0.5 else (-0.12, 0.12))]
    if c.random() < 0.6:
        lines.append(path((-w, 0.2), (w, 0.2)))
    if c.random() < 0.3:
        lines.append(box(0, 0.2 - h, w * 1.08, 0.13))
    top = 0.2 - h
    for s in (-1, 1):
        loop = path((0, top), (s * 0.3, top - 0.35), (s * 0.5, top - 0.2), (0, top))
        lines.append(smooth(loop) if c.random() < 0.7 else loop)
    return lines


def pumpkin(c: Chance) -> Lines:
    """A broad ball with ribs and a stalk, perhaps with a face."""
    h = c.uniform(0.65, 0.85)
    lines = [arc(0, 0, 1, h), closed((-0.1, -h), (-0.05, -h - 0.3), (0.15, -h - 0.3), (0.1, -h))]
    if c.random() < 0.6:
        lines += [arc(0, 0, w, h) for w in (0.35, 0.7)[: int(c.integers(1, 3))]]
    if c.random() < 0.5:
        lines += [closed((s * 0.45, -0.35), (s * 0.25, -0.05), (s * 0.6, -0.05)) for s in (-1, 1)]
        lines.append(path((-0.5, 0.2), (-0.3, 0.4), (-0.1, 0.25), (0.1, 0.4), (0.3, 0.25), (0.5, 0.2)))
    return lines


def robot(c: Chance) -> Lines:
    """Boxes with limbs, eyes and an aerial."""
    head, body, low = c.uniform(0.2, 0.35), c.uniform(0.3, 0.5), c.uniform(0.35, 0.5)
    lines = [box(0, -0.6, head, 0.25), box(0, 0.1, body, 0.4)]
    lines += [rod(s * body, -0.1, s * (body + 0.35), c.uniform(-0.4, 0.4), c.choice([0.0, 0.07]))[0] for s in (-1, 1)]
    lines += [box(s * body * 0.5, 0.5 + low / 2, 0.1, low / 2) for s in (-1, 1)]
    if c.random() < 0.8:
        eyes = c.random() < 0.5
        lines += [
            arc(s * head * 0.45, -0.65, 0.06) if eyes else box(s * head * 0.45, -0.65, 0.06, 0.06) for s in (-1, 1)
        ]
        lines.append(path((-head * 0.5, -0.48), (head * 0.5, -0.48)))
    if c.random() < 0.6:
        lines += [path((0, -0.85), (0, -1)), arc(0, -1.05, 0.05)]
    if c.random() < 0.3:
        lines += [arc(x, 0.1, 0.07) for x in (-0.15, 0.15)]
    return lines


def train(c: Chance) -> Lines:
    """An engine from the side, perhaps with a wagon."""
    lines = [box(0.1, 0.1, 0.5, 0.25), box(-0.6, -0.1, 0.22, 0.45), box(0.4, -0.3, 0.08, 0.16)]
    lines += wheels(c, (-0.6, -0.1, 0.35), 0.45, c.uniform(0.12, 0.2))
    if c.random() < 0.5:
        lines.append(box(-0.6, -0.25, 0.12, 0.12))
    if c.random() < 0.4:
        lines += [box(-1.4, 0.1, 0.5, 0.3), *wheels(c, (-1.65, -1.15), 0.45, 0.13), path((-0.9, 0.3), (-0.8, 0.3))]
    if c.random() < 0.4:
        lines += [arc(0.4 - 0.12 * i, -0.6 - 0.15 * i, 0.1 + 0.03 * i) for i in range(3)]
    return lines


def _one_of(*names: str) -> Symbol:
    """A doodle of these, by chance."""
    return lambda c: DOODLES[str(c.choice(names))](c)


WISHES: dict[str, Symbol] = {
    "apple": _one_of("apple"), "ball": ball, "bird": _one_of("bird"), "bowl": bowl,
    "butterfly": _one_of("butterfly"), "cat": _one_of("cat", "cat's head"), "crown": _one_of("crown"),
    "cupcake": cupcake, "dinosaur": dinosaur, "dog": _one_of("dog", "dog's head"), "elephant": _one_of("elephant"),
    "hat": _one_of("hat"), "heart": heart, "horse": _one_of("horse"), "ice cream": _one_of("ice cream"),
    "person": person, "present": present, "pumpkin": pumpkin, "rabbit": _one_of("rabbit", "rabbit's head"),
    "robot": robot, "snail": _one_of("snail"), "spider": _one_of("spider"),
    "star": _one_of("star", "outlined star"), "sun": _one_of("sun"), "teddy bear": _one_of("bear's head"),
    "train": train, "treasure chest": chest, "turtle": _one_of("turtle"),
}  # fmt: skip
# Not every kind has one.
SYMBOLS = dict(sorted({**INDOORS, **OUTDOORS, **WISHES}.items()))
# The kinds that a network learns to name, in the library's order.
KINDS = tuple(CATEGORIES)
# Kinds that doodles show of other names.
SHOWN = {"cat's head": "cat", "dog's head": "dog", "rabbit's head": "rabbit", "bear's head": "teddy bear"}
SHOWN |= {"outlined star": "star"}


def is_doodle(name: str, kinds: Sequence[str]) -> bool:
    """Whether a doodle is none of these kinds."""
    return SHOWN.get(name, name) not in kinds
