"""What animals are drawn with, beside other shapes: legs that read from the side and from the front, girths, eyes."""

from collections.abc import Sequence

from diff3ds.library.shapes import Part, body, curve, detail, ellipse, flesh, join, line, mirror, ring

# (x, z), as one sees it from the side.
Point = Sequence[float]


def legs(front: Point, back: Point, foot: float, half: float, y: float, bend: float = 0.0, thick: float = 0.05) -> Part:
    """A pair of legs, left and right: two edges from the body down to a foot on the ground z = 0.

    Args:
        front: where the front edge leaves the body, x and z.
        back: where the back edge does.
        foot: x of the foot's middle.
        half: half of its length.
        y: how far from the middle plane.
        bend: how far the knee lies behind, the heel before, a straight leg.
        thick: the front edge lies farther outside by this, the back edge farther inside, to be seen apart from ahead.
    """

    def edge(top: Point, end: float, side: float) -> Part:
        x, z = top
        return curve((x, side, z), ((x + end) / 2 + bend, side, 0.6 * z), (end - bend, side, 0.4 * z), (end, side, 0))

    toe, heel = foot + half, foot - half
    ahead, behind = edge(front, toe, y + thick), edge(back, heel, y - thick)
    sole = line((toe, y + thick, 0), (heel, y - thick, 0))
    return mirror(join(ahead, behind, sole, flesh(ahead, behind, thick)))


def torso(back: Part, under: Part, *sections: tuple[Point, float]) -> Part:
    """A round body between two outlines, as one sees them from the side: no stroke, but it hides what lies behind it.

    Args:
        back: from the nose over the back to the rear.
        under: from the nose along the belly to the rear.
        sections: places in the middle of the body, and half of its width across there.
    """
    return body(back, under, *(((x, 0, z), half) for (x, z), half in sections))


def girth(middle: Point, wide: float, high: float) -> Part:
    """A body's section across: an ellipse with these half axes."""
    return ellipse((middle[0], 0, middle[1]), (0, wide, 0), (0, 0, high))


def eyes(x: float, y: float, z: float, radius: float, axis: str = "y") -> Part:
    """One on each side of the head, facing along an axis."""
    return detail(mirror(ring((x, y, z), radius, axis)))
