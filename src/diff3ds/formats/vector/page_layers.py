"""Layers of a page: the paths of a view in groups within groups, and as pens draw them one group each."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from diff3ds.camera import Cameras
from diff3ds.page.drawn_paths import DrawnPath, box_of_paths, drawn_paths, joined_dashes
from diff3ds.page.pens.pen_paths import Travel, pen_paths, travel
from diff3ds.page.sheet.ink_boxes import Box
from diff3ds.page.sheet.page_layout import PIXELS_PER_MM, Layout, lay_out, widened
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.page.sheet.views_grid import check_page, hexadecimal
from diff3ds.sketch import Sketch
from diff3ds.svg.layer_groups import Group, check_layers

Layers = Literal["color"]


# A pen's lines do not grow with the drawing: looked at so often, their box is right to a thousandth of their width.
LOOKS_OF_PENS = 3


class PathOptions(NamedTuple):
    """What `save_svg` and `save_pdf` are told of paths, by the same names."""

    layers: Layers | Sequence[str | Group] | Sequence[Sequence[str | Group]] | None
    centerline: bool
    pen_mm: float | None
    tolerance: float
    dashes: Sequence[int] | Sequence[Sequence[int]] | None = None


class LayeredPage(NamedTuple):
    """The paths of a page.

    Attributes:
        layout: where views lie.
        views: of each view its paths in layers.
        travel: what the pens travel that draw them; None where no pens do.
    """

    layout: Layout
    views: list[dict[Group, list[DrawnPath]]]
    travel: Travel | None


def layered_page(
    sketch: Sketch | Sequence[Sketch],
    cameras: Cameras,
    background: Sequence[float] | None,
    page: PageSetup | None,
    how: PathOptions,
    alone: bool = False,
) -> LayeredPage:
    """The views of cameras on their page; the arguments are those of `save_svg` and `save_pdf`.

    Raises:
        ValueError: as these.
    """
    sketches = check_page(sketch, cameras, background, how.tolerance)
    layers, dashes = (a_view(given, sketch, len(cameras)) for given in (how.layers, how.dashes))
    for each, named in zip(sketches, layers, strict=True):
        check_layers(None if isinstance(named, str) else named, len(each))
    check_pen(how.pen_mm, how.centerline, page)
    pen = None if how.pen_mm is None else how.pen_mm * PIXELS_PER_MM

    def views(cameras: Cameras, widen: float) -> Iterator[dict[Group, list[DrawnPath]]]:
        for view, each in enumerate(sketches):
            drawn = widened(each, widen)
            paths = drawn_paths(drawn, cameras, view, centerline=how.centerline, tolerance=how.tolerance)
            if dashes[view] is not None and not how.centerline:
                paths = joined_dashes(paths, dashes[view])
            groups = layered(paths, layers[view], how.centerline, pen)
            if dashes[view] is not None and how.centerline:
                groups = {group: joined_dashes(some, dashes[view], pens=True) for group, some in groups.items()}
            yield groups

    def boxes(cameras: Cameras, widen: float) -> Iterator[Box | None]:
        for groups in views(cameras, widen):
            yield box_of_paths(path for paths in groups.values() for path in paths)

    looks = 1 if pen is None else LOOKS_OF_PENS
    layout = lay_out(cameras, page, boxes, alone=alone, looks=looks)
    found = list(views(layout.cameras, layout.widen))
    if not how.centerline:
        return LayeredPage(layout, found, None)
    # On one page a pen goes from view to view before it is changed.
    pages = (
        [[each] for each in zip(found, layout.corners, strict=True)]
        if alone
        else [list(zip(found, layout.corners, strict=True))]
    )
    drawn = [paths for views_there in pages for paths in _by_pen(views_there)]
    return LayeredPage(layout, found, travel(drawn, 1 / (layout.pixels_per_mm or 1.0)))


def _by_pen(views: Sequence[tuple[dict[Group, list[DrawnPath]], tuple[float, float]]]) -> list[list[DrawnPath]]:
    """The paths of each pen on a page, in the order of its views, each of which begins at its corner."""
    found: dict[Group, list[DrawnPath]] = {}
    for groups, corner in views:
        for group, paths in groups.items():
            moved = (path._replace(curves=[curve + np.array(corner) for curve in path.curves]) for path in paths)
            found.setdefault(group, []).extend(moved)
    return list(found.values())


def a_view(given: Any, sketch: Sketch | Sequence[Sketch], count: int) -> list[Any]:
    """What is given of strokes, for each view: one thing for all, or of several sketches a list of one each."""
    return [given] * count if given is None or isinstance(given, str) or isinstance(sketch, Sketch) else list(given)


def check_pen(pen_mm: float | None, centerline: bool, page: PageSetup | None) -> None:
    """Sees that a pen has a width that a page can have.

    Raises:
        ValueError: it has not.
    """
    if pen_mm is None:
        return
    if not 0 < pen_mm < math.inf:
        raise ValueError(f"pen_mm must be positive, got {pen_mm}")
    if not centerline or page is None:
        raise ValueError("pen_mm is the width of a pen's lines on paper: give centerline and a page as well")


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
