"""The paths of strokes in an SVG drawing that another program has edited: which strokes, and how they look there."""

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

from diff3ds.svg.drawing import Drawn, read_drawing
from diff3ds.svg.paints import Gradient

# The ids of paths, of one stroke or of several that a pen joins; of several views "view-1-" comes before.
_STROKES = re.compile(r"(?:view-\d+-)?strokes?-(\d+(?:-\d+)*)(?:-part-\d+)?")
# Lines of the view alone, and what lies around paths.
_OTHERS = re.compile(r"(?:view-\d+-)?(?:line-\d+|layer-.*)|view-\d+|page-\d+")
_RANGE = re.compile(r"(\d+)(?:-(\d+))?")
# What an SVG file keeps of strokes where it does not say it.
KEPT = ("color", "opacity", "width")


@dataclass(frozen=True)
class EditedPath:
    """How a path looks.

    Attributes:
        strokes: the numbers of its strokes.
        label: what it is called, "" where it is not.
        color: 8 bit each; None for a gradient, or where nothing is drawn.
        opacity: in [0, 1].
        width: of a stroked one, in the units of the view box; None of others.
    """

    strokes: tuple[int, ...]
    label: str
    color: tuple[int, int, int] | None
    opacity: float
    width: float | None


@dataclass(frozen=True)
class EditedFile:
    """What an edited file has.

    Attributes:
        paths: those of strokes.
        shown: the strokes that it had when it was written; None where it does not say so any more.
        kept: of "color", "opacity" and "width" what it has of strokes as these have it.
        height: what the height of the image is in the units of the view box; None where that is not known.
        strangers: what is drawn and is of no stroke, by ids.
    """

    paths: tuple[EditedPath, ...]
    shown: frozenset[int] | None
    kept: frozenset[str]
    height: float | None
    strangers: tuple[str, ...]


def read_edited(path: Path) -> EditedFile:
    """Reads an SVG file that was written for a sketch.

    Raises:
        ValueError, OSError: as `read_drawing`.
    """
    with warnings.catch_warnings():
        # Outlines are not looked at, nor what cuts them.
        warnings.simplefilter("ignore")
        drawing = read_drawing(path)
    paths, strangers = [], []
    for drawn in drawing.drawn:
        names = (*drawn.around, drawn.name)
        found = [m for name in reversed(names) if (m := _STROKES.fullmatch(name))]
        if found:
            numbers = tuple(int(number) for number in found[0][1].split("-"))
            paths.append(_looks(drawn, numbers))
        elif not _OTHERS.fullmatch(drawn.name) and not _is_ground(drawn):
            strangers.append(drawn.name or drawn.tag)
    said = drawing.told
    kept = said["data-keeps"].split() if "data-keeps" in said else KEPT
    height = float(said["data-height"]) if "data-height" in said else None
    shown = _numbers(said["data-strokes"]) if "data-strokes" in said else None
    return EditedFile(tuple(paths), shown, frozenset(kept), height, tuple(strangers))


def _is_ground(drawn: Drawn) -> bool:
    """Whether it is what lies below all paths."""
    return drawn.tag == "rect" and drawn.stroke is None and not drawn.name


def _looks(drawn: Drawn, strokes: tuple[int, ...]) -> EditedPath:
    paint = drawn.fill if drawn.stroke is None else drawn.stroke
    a, b, c, d, _, _ = drawn.matrix
    width = None if drawn.stroke is None else drawn.width * math.sqrt(abs(a * d - b * c))
    if paint is None or isinstance(paint, Gradient):
        return EditedPath(strokes, drawn.label, None, 1.0, width)
    red, green, blue = (round(share * 255) for share in paint[:3])
    return EditedPath(strokes, drawn.label, (red, green, blue), paint[3], width)


def _numbers(text: str) -> frozenset[int]:
    """The numbers in ranges such as "0-11 13"."""
    ranges = [(int(m[1]), int(m[2] or m[1])) for m in _RANGE.finditer(text)]
    return frozenset(number for first, last in ranges for number in range(first, min(last, 1 << 20) + 1))
