"""Dragons: a scaled back, bat wings, a horned head on a long neck and an arrow at the tail's end."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, girth, legs, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, backwards, curve, filled, join, mirror, polyline, side, solid


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    tail, neck, span = vary(0.9, 1.15), vary(0.92, 1.1), vary(0.95, 1.15)
    x, z = 0.6 + 0.4 * neck, 0.95 + 0.5 * neck
    tip = (-0.7 - 0.75 * tail, 0.5)
    back = (
        (x + 0.42, z - 0.06),
        (x + 0.04, z + 0.16),
        (x - 0.16, z),
        (0.54, 1.06),
        (0.2, 0.9),
        (-0.4, 0.8),
        (-0.7 - 0.3 * tail, 0.34),
        tip,
    )
    parts = [side(*back)]
    throat = ((x + 0.06, z - 0.1), (0.76, 0.96), (0.52, 0.5), (-0.1, 0.42), (-0.7 - 0.3 * tail, 0.2), tip)
    parts.append(side(*throat))
    parts.append(
        torso(
            parts[0],
            parts[1],
            ((x + 0.38, z - 0.08), 0.03),
            ((x, z + 0.03), 0.08),
            ((0.66, 0.98), 0.1),
            ((0.42, 0.72), 0.22),
            ((-0.2, 0.62), 0.2),
            ((-0.7 - 0.3 * tail, 0.27), 0.08),
            (tip, 0.01),
        )
    )
    # Jaws, open; horns; eyes.
    parts.append(
        polyline((x + 0.42, 0, z - 0.06), (x + 0.16, 0, z - 0.04), (x + 0.38, 0, z - 0.16), (x + 0.06, 0, z - 0.1))
    )
    parts.append(
        mirror(
            curve((x, 0.06, z + 0.14), (x - 0.08, 0.1, z + 0.24), (x - 0.16, 0.12, z + 0.28), (x - 0.3, 0.12, z + 0.3))
        )
    )
    parts.append(eyes(x + 0.14, 0.08, z + 0.05, 0.03))
    parts.append(girth((x, z + 0.03), 0.12, 0.13))
    parts.append(
        filled(
            polyline(
                (tip[0] + 0.06, 0.12, tip[1] - 0.1),
                (tip[0] - 0.2, 0, tip[1] + 0.16),
                (tip[0] + 0.06, -0.12, tip[1] - 0.1),
                closed=True,
            )
        )
    )
    parts.append(legs((0.54, 0.52), (0.24, 0.42), 0.44, 0.09, 0.2, bend=-0.04))
    parts.append(legs((-0.1, 0.42), (-0.56, 0.6), -0.34, 0.1, 0.22, bend=0.12))
    parts.append(girth((0.42, 0.72), 0.24, 0.28))
    # A wing: its arm, the fingers and the skin between their tips.
    root, wrist = (0.3, 0.2, 0.9), (0.36, 0.62 * span, 1.6)
    tips = ((-0.2, 1.35 * span, 1.34), (-0.56, 1.0 * span, 0.98), (-0.58, 0.5 * span, 0.78))
    rear = (-0.28, 0.18, 0.8)
    arm = curve(root, (0.3, 0.3, 1.2), (0.34, 0.4, 1.4), wrist)
    fingers = [
        curve(
            wrist,
            ((wrist[0] + end[0]) / 2, (wrist[1] + end[1]) / 2, (wrist[2] + end[2]) / 2 + 0.14),
            ((wrist[0] + 2 * end[0]) / 3, (wrist[1] + 2 * end[1]) / 3, (wrist[2] + 2 * end[2]) / 3 + 0.08),
            end,
        )
        for end in tips
    ]
    parts += [mirror(part) for part in (arm, *fingers)]
    for a, b, finger, other in zip(tips, (*tips[1:], rear), fingers, (*fingers[1:], backwards(arm)), strict=True):
        sag = tuple((p + q) / 2 for p, q in zip(a, b, strict=True))
        hem = curve(a, (sag[0] + 0.16, sag[1], sag[2] + 0.08), (sag[0] + 0.16, sag[1], sag[2] + 0.08), b)
        # The skin from this finger to the next one, or to the arm.
        parts += [mirror(hem), mirror(solid(filled(join(finger, hem, backwards(other)))))]
    if "spikes" in attributes:
        for at, level in ((0.44, 1.0), (0.16, 0.89), (-0.12, 0.86), (-0.4, 0.79)):
            parts.append(polyline((at + 0.08, 0, level), (at - 0.06, 0, level + 0.2), (at - 0.1, 0, level - 0.04)))
    if "fire" in attributes:
        for low, far in ((-0.12, 0.5), (-0.2, 0.62), (0.04, 0.45)):
            mouth = x + 0.34
            parts.append(
                curve(
                    (mouth, 0, z - 0.1),
                    (mouth + 0.4 * far, 0, z + low + 0.2),
                    (mouth + 0.6 * far, 0, z + low - 0.24),
                    (mouth + far, 0, z + low),
                )
            )
    return parts


CATEGORY = Category(
    "dragon",
    _make,
    synonyms=("wyvern",),
    attributes=(
        Attribute("spikes", ("with spikes", "with a spiky back", "spiky")),
        Attribute("fire", ("with fire", "breathing fire", "fire-breathing")),
    ),
    parts=("a head", "wings", "a tail", "horns", "legs", "teeth", "claws"),
    metres=10.0,
    carries=0.55,
    head=(0.86, 0.92, 0.14),
)
