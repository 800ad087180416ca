"""A sketch in a style, from any cameras: as painted outlines on a page, and as SVG text."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypedDict, TypeVar, Unpack

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.curves.join import Joined, join_smooth
from diff3ds.page.drawn_paths import DrawnPath
from diff3ds.page.ink_outlines import TOLERANCE
from diff3ds.page.noise import seed_of
from diff3ds.page.sheet.ink_boxes import union
from diff3ds.page.sheet.page_layout import PIXELS_PER_MM, PIXELS_PER_MM_OF_SCREENS, Layout, lay_out, to_frame, widened
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.page.sheet.views_grid import check_page, hexadecimal
from diff3ds.page.union import pathops, svg_data
from diff3ds.project import project
from diff3ds.sketch import Sketch
from diff3ds.styles.inked_areas import Area, painted_pixels
from diff3ds.styles.painted import Inked, Painted, SeenStrokes, Strokes
from diff3ds.styles.paper import WARM, Fibres, paper_fibres
from diff3ds.styles.style import Page, Style
from diff3ds.svg.layer_groups import INKSCAPE, Group, layer_elements
from diff3ds.svg.path_ids import KEPT, PathIds, said_of_strokes

# Ends this near to each other, of the sketch's size, are one place, and strokes that turn by less there, radians, go on
# in each other. [empirical: what the eye takes for one line]
NEAR, TURN = 2e-4, math.radians(30)
# A page is looked at so often before its ink is drawn: then widths that do not grow with the picture, as of technical
# pens, are right to a thousandth. [empirical]
LOOKS = 2
Held = TypeVar("Held")
Ink = TypeVar("Ink", Painted, Inked)


@dataclass(frozen=True, eq=False)
class Styled:
    """Views in a style, on their page.

    Attributes:
        layout: where each lies.
        strokes: of each view.
        views: of each view what was painted of its strokes, by their numbers among these.
        background: RGB of the ground, or None.
        paper: the seed of fibres on it, or None.
        numbers: of each view those by which ids call the sketch's strokes, or None.
        kept: what strokes have as the sketch's have it.
    """

    layout: Layout
    strokes: list[Strokes]
    views: list[dict[int, list[Painted]]]
    background: Sequence[float] | None
    paper: int | None
    numbers: list[Sequence[int] | None]
    kept: Sequence[str]

    @property
    def fibres(self) -> list[Fibres]:
        """What lies on the ground, in pixels of the page."""
        return fibres_on(self.layout, self.paper)

    def drawn(self) -> list[dict[Group, list[DrawnPath]]]:
        """The paths of each view in layers."""
        return [
            _in_layers(strokes, {stroke: [each.drawn(stroke) for each in some] for stroke, some in view.items()})
            for strokes, view in zip(self.strokes, self.views, strict=True)
        ]

    def svg(self) -> str:
        """As SVG text."""
        shown = {
            stroke if numbers is None else numbers[stroke]
            for strokes, numbers in zip(self.strokes, self.numbers, strict=True)
            for made in strokes.made
            for stroke in made
        }
        spaces = INKSCAPE if any(group for strokes in self.strokes for group in strokes.groups) else ""
        lines = [self.layout.svg_head(self.background, spaces, said_of_strokes(shown, self.kept, None))]
        lines += [fibres.svg() for fibres in self.fibres]
        for view, (strokes, painted) in enumerate(zip(self.strokes, self.views, strict=True)):
            several, (x, y) = len(self.views) > 1, self.layout.corners[view]
            prefix, at = (f"view-{view}-", (0.0, 0.0)) if several else ("", (x, y))
            if several:
                lines.append(f'<g id="view-{view}" transform="translate({x:.8g},{y:.8g})">')
            ids = PathIds(prefix, self.numbers[view])
            elements = {stroke: [_element(ids.of(strokes.made[stroke]), some, at)] for stroke, some in painted.items()}
            lines += layer_elements(_in_layers(strokes, elements), prefix)
            lines += ["</g>"] if several else []
        return "\n".join([*lines, "</svg>"]) + "\n"


def _in_layers(strokes: Strokes, held: Mapping[int, list[Held]]) -> dict[Group, list[Held]]:
    """What is held of strokes, by their layers."""
    found: dict[Group, list[Held]] = {}
    for stroke, some in held.items():
        found.setdefault(strokes.groups[stroke], []).extend(some)
    return found


def styled_svg(
    sketch: Sketch | Sequence[Sketch],
    cameras: Cameras,
    style: Style,
    *,
    width: float = 1.0,
    seed: int = 0,
    depth_cue: float = 0.0,
    paper: bool = False,
    background: Sequence[float] | None = (1.0, 1.0, 1.0),
    page: PageSetup | None = None,
    layers: Sequence[Group] | Sequence[Sequence[Group]] | None = None,
    numbers: Sequence[int] | Sequence[Sequence[int]] | None = None,
) -> str:
    """The views of all cameras in a style, side by side in a grid that is about square, as SVG text.

    Every stroke, of however many segments, is drawn as a whole, and is one element with the id "stroke-0", "stroke-1"
    and so on, by its number in the sketch, "strokes-2-5" where two go on in each other; of several views
    "view-0-stroke-0". Its outlines neither cross nor overlap themselves. Strokes lie over each other as `render` has
    them where they meet; none is cut, so that where their order goes round in a circle the file cannot show it. The
    same seed gives the same text.

    Args:
        sketch: one for all views, or one a view.
        cameras: of the views.
        style: such as `CHARCOAL`, `Ink(taper=(0, 20))`, or `stretched("leaf.svg")`.
        width: times the widths that the style gives to strokes.
        seed: of all that is random.
        depth_cue: from 0 to 1, how much lighter and thinner strokes become with their depth.
        paper: whether the ground has fibres; a white background is then that of warm paper.
        background: RGB in [0, 1], or None for a transparent one.
        page: the sheet of paper that the views are laid out on, in exact millimetres, which the ink is fitted to;
            without it the page is the pictures, and a pixel is a 96th of an inch.
        layers: of each stroke the names of the layers that it is in, from the outermost on: only strokes of one layer
            go on in each other, and the layers lie over each other in the order of the first strokes of each. Of
            several sketches a list for each.
        numbers: by which the ids call the strokes, where these are parts of a sketch's, -1 for lines of the view alone;
            of several sketches a list for each.

    Raises:
        ImportError: the extra `styles` is not installed.
        ValueError: no cameras, sketch and cameras on different devices, or a value out of range.
    """
    asked: Asked = {
        "width": width,
        "seed": seed,
        "depth_cue": depth_cue,
        "paper": paper,
        "background": background,
        "page": page,
    }
    return styled(sketch, cameras, style, layers=layers, numbers=numbers, **asked).svg()


class Asked(TypedDict):
    """What `styled_svg` is told beside sketch, cameras and style."""

    width: float
    seed: int
    depth_cue: float
    paper: bool
    background: Sequence[float] | None
    page: PageSetup | None


def styled(
    sketch: Sketch | Sequence[Sketch],
    cameras: Cameras,
    style: Style,
    *,
    layers: Sequence[Group] | Sequence[Sequence[Group]] | None = None,
    numbers: Sequence[int] | Sequence[Sequence[int]] | None = None,
    alone: bool = False,
    **asked: Unpack[Asked],
) -> Styled:
    """As `styled_svg`, before it becomes text.

    Args:
        sketch: as there, as are the others but for the last.
        alone: whether each view has a page of its own.

    Raises:
        ImportError, ValueError: as there.
    """
    one, count = isinstance(sketch, Sketch), len(cameras)
    named: list[Any] = [layers] * count if layers is None or one else list(layers)
    called: list[Any] = [numbers] * count if numbers is None or one else list(numbers)
    sheet = _Sheet(sketch, cameras, style, named, alone, asked)
    views = sheet.fitted([view.painted(sheet.ground) for view in sheet.seen()])
    kept = KEPT[:1] if asked["depth_cue"] == 0 else ()
    return Styled(sheet.layout, sheet.joined, views, sheet.background, sheet.paper, called, kept)


def styled_pixels(
    sketch: Sketch | Sequence[Sketch],
    cameras: Cameras,
    style: Style,
    *,
    pixels_per_mm: float = PIXELS_PER_MM_OF_SCREENS,
    **asked: Unpack[Asked],
) -> Float[Tensor, "H W C"]:
    """The page of `styled_svg` as a picture, RGB, or where there is no background as straight RGBA.

    Args:
        sketch: as there, as are the others but for this one.
        pixels_per_mm: of the picture, where there is a page; otherwise it is as large as the views.

    Raises:
        ImportError, ValueError: as there.
    """
    sheet = _Sheet(sketch, cameras, style, [None] * len(cameras), False, asked)
    views = sheet.fitted([view.inked(sheet.ground) for view in sheet.seen()])
    layout = sheet.layout
    scale = 1.0 if layout.pixels_per_mm is None else pixels_per_mm / layout.pixels_per_mm
    width, height = (max(round(scale * side), 1) for side in layout.size)
    areas = [Area.of(fibres.drawn()) for fibres in fibres_on(layout, sheet.paper)]
    # A view that is all of the picture is cut with it.
    cut = layout.pixels_per_mm is not None or len(views) > 1
    for corner, strokes in zip(layout.corners, views, strict=True):
        areas += [inked.area(corner, cut) for some in strokes.values() for inked in some]
    return painted_pixels(areas, (height, width), sheet.background, scale)


class _Sheet:
    """Strokes joined, and laid out on a page.

    Raises:
        ValueError: as `styled_svg`.
    """

    def __init__(
        self,
        sketch: Sketch | Sequence[Sketch],
        cameras: Cameras,
        style: Style,
        layers: Sequence[Sequence[Group] | None],
        alone: bool,
        asked: Asked,
    ) -> None:
        width, depth_cue, background = asked["width"], asked["depth_cue"], asked["background"]
        if not 0 < width < math.inf:
            raise ValueError(f"width must be positive, got {width}")
        if not 0 <= depth_cue <= 1:
            raise ValueError(f"depth_cue must be from 0 to 1, got {depth_cue}")
        sketches = check_page(sketch, cameras, background, TOLERANCE)
        pathops()
        self.style, self.page, self.depth_cue, self.seed = style, asked["page"], depth_cue, seed_of(asked["seed"])
        self.joined = [
            _joined(each, width, [()] * len(each) if groups is None else list(groups))
            for each, groups in zip(sketches, layers, strict=True)
        ]
        self.paper = self.seed if asked["paper"] else None
        warm = asked["paper"] and background is not None and tuple(background) == (1.0, 1.0, 1.0)
        self.background = WARM if warm else background
        self.layout = lay_out(
            cameras, self.page, lambda *how: (view.box() for view in self._seen(*how)), alone=alone, looks=LOOKS
        )

    @property
    def ground(self) -> Sequence[float]:
        """RGB of what lies below."""
        return self.background or (1.0, 1.0, 1.0)

    def seen(self) -> Iterator[SeenStrokes]:
        """The strokes of each view in its place."""
        return self._seen(self.layout.cameras, self.layout.widen)

    def _seen(self, cameras: Cameras, widen: float) -> Iterator[SeenStrokes]:
        per_mm = PIXELS_PER_MM_OF_SCREENS if self.page is None else PIXELS_PER_MM
        for view, each in enumerate(self.joined):
            wide = each._replace(sketch=widened(each.sketch, widen))
            sheet = Page(cameras.size, per_mm, self.seed)
            yield SeenStrokes(wide, project(wide.sketch, cameras[view]), self.style, sheet, self.depth_cue)

    def fitted(self, views: list[dict[int, list[Ink]]]) -> list[dict[int, list[Ink]]]:
        """Outlines moved by the little that is left to their place: ink does not quite grow with a picture."""
        if self.page is None or self.page.fit == "none":
            return views
        box = union(each.box for strokes in views for some in strokes.values() for each in some)
        if box is None:
            return views
        zoom, shift = to_frame(box, self.layout.frame, self.page.fit)
        return [
            {name: [each.moved(zoom, *shift) for each in some] for name, some in strokes.items()} for strokes in views
        ]


def _joined(sketch: Sketch, width: float, groups: Sequence[Group]) -> Strokes:
    """The strokes of each layer that go on in each other as one."""
    gap = NEAR * float((sketch.points.amax((0, 1)) - sketch.points.amin((0, 1))).max()) if len(sketch) else 0.0
    sketch = sketch.replace(width=sketch.width * width)
    rows: dict[Group, list[int]] = {}
    for stroke, group in enumerate(groups):
        rows.setdefault(group, []).append(stroke)
    if len(rows) < 2:
        joined = join_smooth(sketch, TURN, gap)
    else:
        parts = [join_smooth(sketch[some], TURN, gap) for some in rows.values()]
        made = [
            [some[stroke] for stroke in strokes]
            for part, some in zip(parts, rows.values(), strict=True)
            for strokes in part.strokes
        ]
        joined = Joined(Sketch.concatenate([part.sketch for part in parts]), made)
    return Strokes(joined.sketch, joined.strokes, [groups[strokes[0]] for strokes in joined.strokes])


def _element(name: str, painted: Sequence[Painted], at: tuple[float, float]) -> str:
    """The element of a stroke, moved."""
    paths = [_path(each, at) for each in painted]
    if len(paths) == 1:
        return paths[0].replace("<path", f'<path id="{name}"', 1)
    return f'<g id="{name}">{"".join(paths)}</g>'


def _path(painted: Painted, at: tuple[float, float]) -> str:
    style = f'fill="{hexadecimal(painted.color)}"'
    if painted.opacity < 1:
        style += f' fill-opacity="{painted.opacity:.4g}"'
    if painted.multiplied:
        style += ' style="mix-blend-mode:multiply"'
    path = painted.path if at == (0, 0) else painted.path.transform(1, 0, 0, 1, *at)
    return f'<path d="{svg_data(path)}" {style}/>'


def fibres_on(layout: Layout, seed: int | None) -> list[Fibres]:
    """The fibres of a page, in its pixels; without a seed there are none."""
    if seed is None:
        return []
    width, height = layout.size
    # As `Page.unit`.
    return paper_fibres((height, width), layout.cameras.size[0] / 512, seed)
