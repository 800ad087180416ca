"""Butterflies: two pairs of wings, half raised, on a thin body with feelers."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ball, ellipse, filled, mirror, ring, spline, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    span, rear, rise = vary(0.95, 1.1), vary(0.85, 1.05), vary(28, 46)
    fore = ((0.12, 0.06), (0.42, 0.3), (0.72, 0.72), (0.7, 1.06), (0.34, 1.04), (0.06, 0.72), (0.02, 0.06))
    hind = ((0.0, 0.06), (0.02, 0.5), (-0.08, 0.84), (-0.42, 0.86), (-0.66, 0.5), (-0.44, 0.2), (-0.1, 0.06))

    def raised(strokes: Part) -> Part:
        # Right wings turn up around the body's axis, and have mirror images.
        return mirror(turn(strokes, rise, "x"))

    parts = [
        raised(filled(spline(*((x, span * y, 0) for x, y in fore)))),
        raised(filled(spline(*((rear * x, span * rear * y, 0) for x, y in hind)))),
    ]
    parts.append(ellipse((-0.06, 0, 0), (0.42, 0, 0), (0, 0.06, 0)))
    parts.append(ellipse((-0.06, 0, 0), (0.42, 0, 0), (0, 0, 0.06)))
    parts += [ring((0.42, 0, 0.02), 0.07, "z"), ball((-0.06, 0, 0), (0.42, 0.06, 0.06)), ball((0.42, 0, 0.02), 0.07)]
    parts.append(mirror(spline((0.46, 0.03, 0.06), (0.66, 0.12, 0.2), (0.84, 0.3, 0.26), (0.8, 0.34, 0.2))))
    if "spots" in attributes:
        for x, y, r in ((0.46, 0.76, 0.13), (-0.34, 0.56, 0.12)):
            parts.append(raised(ring((x, span * y, 0), r)))
    if "pattern" in attributes:
        parts.append(raised(spline((0.08, 0.08, 0), (0.3, 0.5 * span, 0), (0.5, 0.96 * span, 0))))
        parts.append(raised(spline((-0.04, 0.08, 0), (-0.2, 0.4 * span, 0), (-0.3, 0.8 * span * rear, 0))))
    return parts


CATEGORY = Category(
    "butterfly",
    _make,
    synonyms=("moth",),
    attributes=(
        Attribute("spots", ("with spots", "spotted")),
        Attribute("pattern", ("with a pattern", "patterned", "with veins")),
    ),
    parts=("wings", "feelers", "antennae"),
    metres=0.15,
    aloft=True,
)
