"""Layers of a page: the paths of a view in groups within groups, and as pens draw them one group each."""

import math
from collections.abc import Iterator, Sequence
from typing import Literal

from diff3ds.page.drawn_paths import DrawnPath
from diff3ds.page.pens.pen_paths import pen_paths
from diff3ds.page.views_grid import hexadecimal
from diff3ds.svg.layer_groups import Group

Layers = Literal["color"]


def check_layers(layers: Layers | Sequence[str | Group] | None, strokes: int) -> None:
    """Sees that layers are one a stroke.

    Raises:
        ValueError: they are not.
    """
    if layers is not None and not isinstance(layers, str) and len(layers) != strokes:
        raise ValueError(f"layers must name one for each of the {strokes} strokes, got {len(layers)}")


def check_pen(pen_mm: float | None, centerline: bool, width_mm: float | None) -> None:
    """Sees that a pen has a width that a page can have.

    Raises:
        ValueError: it has not.
    """
    if pen_mm is None:
        return
    if not 0 < pen_mm < math.inf:
        raise ValueError(f"pen_mm must be positive, got {pen_mm}")
    if not centerline or width_mm is None:
        raise ValueError("pen_mm is the width of a pen's lines on paper: give centerline and width_mm as well")


def layered(
    paths: Sequence[DrawnPath],
    layers: Layers | Sequence[str | Group] | None,
    centerline: bool = False,
    pen: float | None = None,
) -> dict[Group, list[DrawnPath]]:
    """The paths of each layer, in the order of the first of each; where there are no layers all in one without a name.

    Args:
        paths: of a view.
        layers: "color" for one a colour, as "#rrggbb"; or of each stroke its layer, or layers within layers.
        centerline: whether pens draw them, each with one colour: the paths of a layer are then joined and put in order.
        pen: the width of each, pixels.
    """
    groups: dict[Group, list[DrawnPath]] = {}
    for path in paths:
        if layers is None or isinstance(layers, str):
            group: Group = (hexadecimal(path.color),) if layers or centerline else ()
        else:
            name = layers[path.strokes[0]]
            group = (name,) if isinstance(name, str) else name
        groups.setdefault(group, []).append(path)
    return dict(_of_pens(groups, pen)) if centerline else groups


def _of_pens(groups: dict[Group, list[DrawnPath]], pen: float | None) -> Iterator[tuple[Group, list[DrawnPath]]]:
    """The layers with the paths of one pen each: those of several colours have one within them a colour."""
    for group, paths in groups.items():
        by_color: dict[str, list[DrawnPath]] = {}
        for path in paths:
            by_color.setdefault(hexadecimal(path.color), []).append(path)
        for color, some in by_color.items():
            yield (*group, color) if len(by_color) > 1 else group, pen_paths(some, pen)
