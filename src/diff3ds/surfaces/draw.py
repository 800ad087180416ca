"""Contours of surfaces as strokes, and sketches drawn with surfaces that hide what lies behind them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeVar, get_args

import numpy as np
import torch

from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.page.chords import chords_of
from diff3ds.page.dashes import dashed
from diff3ds.page.parts import Parts, cut_sketch, faint
from diff3ds.page.picture import Picture
from diff3ds.parallel.in_copies import in_copies
from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.project import project
from diff3ds.render import Antialiasing, Backend, Rendering, render
from diff3ds.render.antialiasing import antialiasing_from
from diff3ds.render.checks import Background, canvas_from, check_scene
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.surfaces.hatching.tones import By, Hatch
from diff3ds.surfaces.hidden.lines_of_mesh import Drawn, MeshSeen, prepare
from diff3ds.surfaces.hidden.lines_of_quadrics import QuadricsSeen
from diff3ds.surfaces.hidden.visibility import EXACT, FOR_FILMS, Care
from diff3ds.surfaces.shape.quadrics import Quadrics
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

Hidden = Literal["drop", "faint", "dashed", "show"]
Surface = TriangleMesh | Quadrics
Result = TypeVar("Result")

# Largest distance between a contour and the strokes that are fitted to it, pixels.
TOLERANCE = 0.2
# Opacity of faint strokes, as a share of that of visible ones.
FAINT = 0.25
# Bytes that views take which are looked at side by side, and what each triangle takes then, as measured.
LOOKING, PER_FACE = 3 << 29, 350
# What the strokes of a sketch are called where nobody says, what outlines are called that depend on the view, and what
# lines of tone.
STROKE, CONTOUR, HATCHING = "stroke", "contour", "hatching"


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of one view.

    Attributes:
        sketch: all strokes, hidden ones too: those of a sketch, then the surface's own lines.
        kinds: what each stroke is: what the caller has called it, then "contour" (a line that depends on the view) or
            "crease" (the end of a cylinder or cone), "intersection" (where solids or pieces of a mesh meet), and last
            "hatching".
        parts: which parts of the segments are seen and which hidden.
        cameras: the view.
        numbers: of the strokes in the sketch that was given, -1 for the surface's own lines.
    """

    sketch: Sketch
    kinds: tuple[str, ...]
    parts: Parts
    cameras: Cameras
    numbers: tuple[int, ...] = ()

    def strokes(self, visible: bool, kind: str | None = None) -> Sketch:
        """The visible or the hidden strokes, of one kind or all; gradients flow to the sketch."""
        return cut_sketch(self.sketch, *self._chosen(visible, kind))[0]

    def drawn(self, hidden: Hidden) -> Sketch:
        """What is drawn: visible strokes, and hidden ones as `ds.render` says."""
        return self.drawn_from(hidden)[0]

    def layers(self, hidden: Hidden) -> list[str]:
        """What each stroke of `drawn` is: "crease", "contour, hidden" and the like."""
        return self.named(self.origins(hidden))

    def origins(self, hidden: Hidden) -> list[tuple[int, bool]]:
        """Of each stroke of `drawn` its row in `sketch`, and whether it is seen; where all are drawn whole, each is."""
        return self.drawn_from(hidden)[1]

    def drawn_from(self, hidden: Hidden) -> tuple[Sketch, list[tuple[int, bool]]]:
        """What `drawn` and `origins` give."""
        if hidden == "show":
            return self.sketch, [(row, True) for row in range(len(self.sketch))]
        seen, rows = cut_sketch(self.sketch, *self._chosen(True, None))
        origins = [(row, True) for row in rows.tolist()]
        if hidden == "drop":
            return seen, origins
        cut = self._dash_parts() if hidden == "dashed" else self._chosen(False, None)
        other, rows = cut_sketch(self.sketch, *cut)
        if hidden == "faint":
            other = faint(other, FAINT)
        return Sketch.concatenate([other, seen]), [(row, False) for row in rows.tolist()] + origins

    def named(self, origins: list[tuple[int, bool]]) -> list[str]:
        """What strokes are of which `origins` says where they come from."""
        return [self.kinds[row] if seen else f"{self.kinds[row]}, hidden" for row, seen in origins]

    def dashes(self, hidden: Hidden) -> list[int] | None:
        """Of each stroke of `drawn` the row in `sketch` that it is a dash of, -1 for others; None where none are."""
        return [-1 if seen else row for row, seen in self.origins(hidden)] if hidden == "dashed" else None

    def _dash_parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        parts = self.parts[~self.parts.visible]
        strokes = project(self.sketch.detach(), self.cameras)
        chords = chords_of(strokes.cubics[0].cpu().numpy(), Picture.of(self.cameras, 0))
        width = 2 * float(strokes.half_width.median()) if len(self.sketch) else 0.0
        if strokes.width_space == "world":
            # Of lines of many widths and depths, one in the middle.
            width /= max(float(strokes.depth(strokes.cubics[0, :, 0]).median()), strokes.near)
        chains = self.sketch.chains or Chains.plain(len(self.sketch))
        cut = dashed(parts, chains.after.cpu().numpy(), chords, self.cameras.size[0], width)
        return cut.segment, cut.start, cut.stop

    def _chosen(self, visible: bool, kind: str | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        parts = self.parts[self.parts.visible == visible]
        if kind is not None:
            of_kind = np.array([k == kind for k in self.kinds], bool)
            stroke = (self.sketch.chains or Chains.plain(len(self.sketch))).stroke.cpu().numpy()
            parts = parts[of_kind[stroke[parts.segment]]]
        return parts.segment, parts.start, parts.stop


def contours(surface: Surface, cameras: Cameras, *, tolerance: float = TOLERANCE) -> list[Sketch]:
    """The contours of a surface from each camera, as strokes in space, hidden ones too.

    Contours of a mesh are where its normals, interpolated between creases, are at right angles to the line of sight,
    and along creases where the surface turns over; borders are none. Strokes are rational cubics in float64, black and
    of the default width, one a contour. Those of quadrics are exact conics; with the ends of cylinders and cones among
    them, and without what lies inside of other solids. Then come the lines where solids, or pieces of a mesh, go
    through each other. Gradients flow to quadrics and from there to cameras.

    Args:
        surface: what is seen.
        cameras: from where.
        tolerance: largest distance between a contour of a mesh and its stroke, pixels of the cameras.

    Raises:
        TypeError, ValueError: another surface, or a tolerance that is not positive.
    """
    _check(surface)
    if not (isinstance(tolerance, int | float) and 0 < tolerance < float("inf")):
        raise ValueError(f"tolerance must be a positive number of pixels, got {tolerance!r}")
    return _each_view(surface, cameras, None, True, lambda seen, view: seen.lines, tolerance)


def _each_view(
    surface: Surface,
    cameras: Cameras,
    sketch: Sketch | None,
    contours: bool,
    take: Callable[[MeshSeen | QuadricsSeen, int], Result],
    tolerance: float = TOLERANCE,
    told: Callable[[int], None] = lambda done: None,
    care: Care = EXACT,
) -> list[Result]:
    """What is taken from each view of a surface, with contours along the creases that a sketch does not draw.

    They are looked at side by side, but with gradients, which no copy of this process could give back.
    """
    if isinstance(surface, Quadrics):
        return side_by_side(lambda view: take(QuadricsSeen(surface, cameras, view), view), len(cameras), 1, told)
    drawn = Drawn.by(Sketch(torch.zeros(0, 4, 3)) if sketch is None else sketch, surface)
    gradients = surface.points.requires_grad and torch.is_grad_enabled()

    def look(view: int) -> Result:
        # Other threads do not know what the caller's wants.
        with torch.set_grad_enabled(gradients):
            return take(MeshSeen(surface, cameras, view, tolerance if contours else None, drawn, care), view)

    copies = 1 if gradients else max(1, LOOKING // (PER_FACE * len(surface)))
    if copies > 1:
        prepare(surface, with_strokes=sketch is not None and len(sketch) > 0)
    return in_copies(look, len(cameras), copies, told)


def visible_lines(
    sketch: Sketch,
    cameras: Cameras,
    surface: Surface,
    *,
    kinds: Sequence[str] | None = None,
    contours: bool = True,
    hatch: Hatch | By | None = None,
    told: Callable[[int], None] = lambda done: None,
) -> list[Lines]:
    """The strokes of a sketch and the contours of a surface, with the parts that the surface hides from each camera.

    A stroke's visibility changes where its picture crosses an outline of the surface and where it goes through it. It
    is cut there, exactly, and each part is seen or hidden as a whole. What is nearer to a mesh than 0.4 % of its size
    lies on it, and is not hidden by what it lies on; in a quadric that is what is less deep in it than 0.2 % of its
    radius.

    Args:
        sketch: strokes; they may be none.
        cameras: V views.
        surface: what hides.
        kinds: what each stroke is, such as "crease"; by default the sketch's own kinds, of which "contour" is left out
            where the surface's contours are drawn, and "stroke" where it has none.
        contours: whether the surface's own contours are among the lines, and where solids or pieces of a mesh meet:
            along creases and there only where no stroke draws them.
        hatch: lines that make the surface darker, on what of it is turned to the camera: `Hatch(...)`, or "light" or
            "depth", short for it. Those of a mesh are on its faces, and have their width along them.
        told: told how many views are done.

    Returns:
        The lines of each view. Strokes that no view shows, behind the near plane, have no parts.

    Raises:
        TypeError, ValueError: another surface, or kinds that are not one a stroke.
    """
    looked = _Looked.of(sketch, cameras, surface, kinds, contours, _hatch_from(hatch))
    found = _each_view(surface, cameras, looked.sketch, contours, looked.look, told=told)
    return [looked.lines(view, each) for view, each in enumerate(found)]


def lines_for_pixels(
    take: Callable[[Lines, int], Result],
    sketch: Sketch,
    cameras: Cameras,
    surface: Surface,
    care: Care = FOR_FILMS,
    *,
    kinds: Sequence[str] | None = None,
    contours: bool = True,
    hatch: Hatch | None = None,
    told: Callable[[int], None] = lambda done: None,
) -> list[Result]:
    """What is taken from the lines of a view and its number, as `visible_lines` finds them, in the copies that do so.

    They are found less exactly, since they are seen or measured in pictures of pixels, and without gradients.
    """
    looked = _Looked.of(sketch, cameras, surface, kinds, contours, hatch)

    def taken(seen: MeshSeen | QuadricsSeen, view: int) -> Result:
        return take(looked.lines(view, looked.look(seen, view)), view)

    return _each_view(surface, cameras, looked.sketch, contours, taken, told=told, care=care)


# What a view shows: the parts of a sketch; the surface's own lines, what they are, and their parts; lines of tone.
_Found = tuple[Parts, Sketch, tuple[str, ...], Parts | None, Sketch | None]


@dataclass(frozen=True, eq=False)
class _Looked:
    """What is looked for in views.

    Attributes:
        sketch: the strokes that views show.
        named: what each is.
        rows: their numbers in the sketch that was given.
        cameras: the views.
        contours: whether the surface's own contours are looked for.
        hatch: lines of tone.
    """

    sketch: Sketch
    named: tuple[str, ...]
    rows: list[int]
    cameras: Cameras
    contours: bool
    hatch: Hatch | None

    @staticmethod
    def of(
        sketch: Sketch,
        cameras: Cameras,
        surface: Surface,
        kinds: Sequence[str] | None,
        contours: bool,
        hatch: Hatch | None,
    ) -> "_Looked":
        """As `visible_lines`."""
        _check(surface)
        named = tuple(kind or STROKE for kind in sketch.kinds or ("",) * len(sketch)) if kinds is None else tuple(kinds)
        if len(named) != len(sketch):
            raise ValueError(f"kinds must be one a stroke, {len(sketch)}, got {len(named)}")
        rows = list(range(len(sketch)))
        if contours and kinds is None and CONTOUR in named:
            # Outlines that were fitted for all sides: each view has its own.
            rows = [i for i, kind in enumerate(named) if kind != CONTOUR]
            sketch, named = sketch[rows], tuple(named[i] for i in rows)
        return _Looked(sketch, named, rows, cameras, contours, hatch)

    def look(self, seen: MeshSeen | QuadricsSeen, view: int) -> _Found:
        """What a view shows."""
        own = seen.line_parts() if self.contours and len(seen.lines) else None
        tone = None if self.hatch is None else seen.hatching(self.hatch)
        return seen.parts(self.sketch), seen.lines, seen.kinds, own, tone

    def lines(self, view: int, found: _Found) -> Lines:
        """The lines of a view."""
        parts, own_lines, own_kinds, own_parts, tone = found
        whole, all_kinds = self.sketch, self.named
        if own_parts is not None:
            whole = Sketch.concatenate([whole, _drawn_like(own_lines, whole)])
            parts = Parts.concatenate(parts, own_parts, len(self.sketch.points))
            all_kinds = (*all_kinds, *own_kinds)
        if tone is not None and len(tone):
            parts = Parts.concatenate(parts, Parts.whole(len(tone.points)), len(whole.points))
            whole = Sketch.concatenate([whole, _as_wide(tone, self.sketch, self.cameras[view])])
            all_kinds = (*all_kinds, *(HATCHING,) * len(tone))
        numbers = (*self.rows, *[-1] * (len(whole) - len(self.rows)))
        return Lines(whole.replace(kinds=all_kinds), all_kinds, parts, self.cameras[view], numbers)


def draw(
    sketch: Sketch,
    cameras: Cameras,
    surface: Surface,
    *,
    hidden: Hidden = "drop",
    contours: bool = True,
    hatch: Hatch | By | None = None,
    background: Background = 1.0,
    antialiasing: Antialiasing = "analytic",
    backend: Backend | None = None,
) -> Rendering:
    """Draws a sketch, and the contours of a surface, without the lines that the surface hides.

    What is left of the sketch is another sketch in each view; `render` draws it, with gradients. None knows of the
    places where strokes begin to be hidden.

    Args:
        sketch: strokes; they may be none.
        cameras: V views.
        surface: what hides what lies behind it, such as `load_surface` gives.
        hidden: what becomes of hidden parts of strokes: "drop" leaves them out, "faint" draws them with a quarter of
            their opacity, "dashed" in dashes, and "show" as if they were visible.
        contours: whether the surface's contours are drawn, and the lines where its solids or pieces meet, black and as
            wide as the sketch's strokes.
        hatch: as of `visible_lines`: what is hidden of these lines is never drawn.
        background: as of `render`.
        antialiasing: the same.
        backend: the same.

    Raises:
        TypeError, ValueError: another surface, or another way to draw what is hidden; as `render`.
    """
    check_scene(sketch, cameras, "draw")
    how = antialiasing_from(antialiasing)
    _check(surface)
    if hidden not in get_args(Hidden):
        raise ValueError(f"hidden must be one of {', '.join(map(repr, get_args(Hidden)))}, got {hidden!r}")
    if not len(cameras):
        return render(sketch, cameras, background=background, antialiasing=how, backend=backend)
    ground = canvas_from(background, sketch.color, (len(cameras), *cameras.size, 3)).expand(len(cameras), -1, -1, -1)
    views = [
        render(lines.drawn(hidden), cameras[v], background=ground[v : v + 1], antialiasing=how, backend=backend)
        for v, lines in enumerate(visible_lines(sketch, cameras, surface, contours=contours, hatch=hatch))
    ]
    return Rendering(*(torch.cat([getattr(view, name) for view in views]) for name in ("color", "alpha", "depth")))


def _check(surface: object) -> None:
    if not isinstance(surface, TriangleMesh | Quadrics):
        raise TypeError(f"surface must be a TriangleMesh or Quadrics, got {type(surface).__name__}")


def _drawn_like(strokes: Sketch, sketch: Sketch) -> Sketch:
    """Contours in a sketch's dtype, on its device, as wide as its strokes are in the middle."""
    width = sketch.width.detach().median() if len(sketch) else torch.tensor(DEFAULT_WIDTH).to(sketch.points)
    like = strokes.to(sketch.points.dtype).to(sketch.points.device)
    return replace(like, width=width.expand(len(like)), width_space=sketch.width_space)


def _hatch_from(given: Hatch | By | None) -> Hatch | None:
    if given is None or isinstance(given, Hatch):
        return given
    if not isinstance(given, str):
        raise TypeError(f"hatch must be Hatch(...), {' or '.join(map(repr, get_args(By)))}, got {given!r}")
    return Hatch(given)


def _as_wide(strokes: Sketch, sketch: Sketch, camera: Cameras) -> Sketch:
    """Strokes with widths in image heights in a sketch's dtype, on its device, with widths in the space of its own."""
    width = strokes.width
    if sketch.width_space == "world":
        picture = Picture.of(camera, 0)
        depth = 1.0 if picture.orthographic else torch.from_numpy(picture.seen(strokes.points.numpy())[1])
        width = width * picture.size[0] * depth / picture.focal
    made = replace(strokes, width=width, width_space=sketch.width_space)
    return made.to(sketch.points.dtype).to(sketch.points.device)
