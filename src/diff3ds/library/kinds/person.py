"""People: a head, a trunk with arms, legs and feet, as a jointed doll has them."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    ball,
    curve,
    ellipse,
    filled,
    flesh,
    join,
    lathe,
    line,
    mirror,
    move,
    polyline,
    reflect,
    ring,
    sheet,
    solid,
    spline,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, shoulder, leg, arm = vary(0.2, 0.25), vary(0.28, 0.34), vary(0.95, 1.1), vary(8, 30)
    hip, chest, deep = leg, leg + 0.68, 0.15
    head = chest + 0.12 + 1.1 * r
    parts = [
        ellipse((0, 0, head), (0, 0.85 * r, 0), (0, 0, 1.1 * r)),
        ellipse((0, 0, head), (0.9 * r, 0, 0), (0, 0, 1.1 * r)),
    ]
    parts.append(ball((0, 0, head), (0.9 * r, 0.85 * r, 1.1 * r)))
    parts.append(mirror(line((0, 0.08, head - 1.0 * r), (0, 0.08, chest + 0.02))))
    parts.append(mirror(ring((0.78 * r, 0.34 * r, head + 0.15 * r), 0.1 * r, "x")))
    parts.append(ellipse((0.82 * r, 0, head - 0.3 * r), (0, 0.38 * r, 0), (0, 0, 0.25 * r), 180, 360))
    dressed = "skirt" in attributes
    waist = hip + 0.12 if dressed else hip
    flank = curve((0, 0.08, chest + 0.02), (0, shoulder, chest), (0, shoulder, chest - 0.2), (0, 0.2, waist))
    parts += [mirror(flank), flesh(flank, reflect(flank), 0.08, 0.97 * deep, 1.05 * deep, deep)]
    parts += [ellipse((0, 0, z), (deep, 0, 0), (0, y, 0)) for z, y in ((chest - 0.1, shoulder - 0.03), (waist, 0.2))]
    # Arms hang down, away from the body; a knight's right one bears the sword ahead.
    reach = arm / 60
    elbow, hand = (
        (-0.06, shoulder + 0.3 * reach + 0.08, chest - 0.36),
        (0.12, shoulder + 0.6 * reach + 0.06, chest - 0.66),
    )
    sleeve = (
        spline((0, shoulder - 0.02, chest - 0.05), elbow, hand),
        spline(
            (0, shoulder - 0.1, chest - 0.2),
            (elbow[0] + 0.1, elbow[1] - 0.09, elbow[2] + 0.02),
            (hand[0] + 0.06, hand[1] - 0.07, hand[2]),
        ),
    )
    palm = (hand[0] + 0.03, hand[1] - 0.035, hand[2] - 0.06)
    hand_of_it = join(ring(palm, 0.06, "x"), ball(palm, 0.06))
    parts += [mirror(part) for part in (*sleeve, flesh(*sleeve, 0.07, 0.05, 0.04), hand_of_it)]
    low = 0.6 * leg if dressed else hip
    if dressed:
        parts.append(mirror(line((0, 0.2, waist), (0, 0.44, 0.5 * leg))))
        parts.append(mirror(line((deep, 0, waist), (0.36, 0, 0.5 * leg)), "x"))
        parts.append(ellipse((0, 0, 0.5 * leg), (0.36, 0, 0), (0, 0.44, 0)))
        parts.append(sheet(ellipse((0, 0, waist), (deep, 0, 0), (0, 0.2, 0)), parts[-1]))
        low = 0.5 * leg
    inner, outer = 0.06, 0.2
    rear = line((-0.08, outer, low), (-0.05, 0.2, 0.06))
    front = line((0.08, inner if dressed else 0.02, low), (0.06, 0.09, 0.06))
    parts += [mirror(part) for part in (rear, front, flesh(rear, front, 0.1, 0.07))]
    parts.append(mirror(polyline((-0.05, 0.2, 0.06), (-0.07, 0.15, 0), (0.26, 0.15, 0), (0.06, 0.09, 0.06))))
    parts.append(
        mirror(
            curve((deep, 0, chest - 0.1), (1.2 * deep, 0, chest - 0.3), (deep, 0, waist + 0.2), (deep, 0, waist)), "x"
        )
    )
    if "hat" in attributes:
        brim = head + 0.55 * r
        parts += [filled(ring((0, 0, brim), 1.5 * r)), ring((0, 0, brim + 0.8 * r), 0.75 * r)]
        parts.append(solid(lathe(line((0.85 * r, 0, brim), (0.75 * r, 0, brim + 0.8 * r)), [])))
        parts += [
            mirror(line((0, 0.85 * r, brim), (0, 0.75 * r, brim + 0.8 * r))),
            mirror(line((0.85 * r, 0, brim), (0.75 * r, 0, brim + 0.8 * r)), "x"),
        ]
    if "armour" in attributes:
        x, y, z = hand[0], hand[1] - 0.035, hand[2] - 0.06
        parts += [
            line((x, y, z - 0.14), (x + 0.3, y, z + 0.95)),
            line((x - 0.04, y - 0.14, z + 0.1), (x + 0.1, y + 0.14, z + 0.06)),
        ]
        shield = ((0.26, 0.3, 0.3), (0.26, -0.3, 0.3), (0.26, -0.26, -0.1), (0.26, 0, -0.45), (0.26, 0.26, -0.1))
        outline = join(line(shield[0], shield[1]), spline(*shield[1:], shield[0]))
        parts.append(move(filled(outline), (0, -y, z + 0.1)))
        # A helmet with a slit and a plume.
        parts.append(ring((0, 0, head - 0.1 * r), 1.02 * r))
        parts.append(
            curve((0, 0, head + 1.1 * r), (-0.1, 0, head + 2.4 * r), (-0.5, 0, head + 2 * r), (-0.5, 0, head + r))
        )
    if "ball" in attributes:
        parts += [ball((0.55, 0.15, 0.2), 0.2), *(ring((0.55, 0.15, 0.2), 0.2, axis) for axis in ("x", "y", "z"))]
    return parts


CATEGORY = Category(
    "person",
    _make,
    synonyms=(
        "man",
        "boy",
        "child",
        "human",
        "stick figure",
        "stick man",
        "stickman",
        "king",
        "pirate",
        "teacher",
        "doctor",
        "baby",
        "figure",
        "player",
        "football player",
        "soccer player",
        "footballer",
        "doll",
        "dad",
        "daddy",
        "father",
        "brother",
        "grandfather",
        "grandpa",
        "grandad",
        "uncle",
        "friend",
        "kid",
        "astronaut",
        "clown",
        "elf",
        "giant",
        "policeman",
        "fireman",
        "nurse",
    ),
    attributes=(
        Attribute(
            "skirt",
            ("with a skirt", "with a dress"),
            nouns=(
                "woman",
                "girl",
                "princess",
                "queen",
                "lady",
                "mother",
                "mum",
                "mummy",
                "mom",
                "mommy",
                "sister",
                "grandmother",
                "grandma",
                "granny",
                "nan",
                "aunt",
                "auntie",
                "ballerina",
                "fairy",
            ),
        ),
        Attribute(
            "hat", ("with a hat",), nouns=("cowboy", "gentleman", "farmer", "wizard", "witch"), excludes=("armour",)
        ),
        Attribute("armour", ("with a sword and a shield", "with a shield"), nouns=("knight",), excludes=("skirt",)),
        Attribute("ball", ("with a ball", "with a football")),
    ),
    parts=("arms", "two arms", "legs", "two legs", "a head", "eyes", "a smile"),
    mirror=None,
    metres=1.75,
    head=(0.42, 0.93, 0.2),
)
