"""Boolean operations on filled outlines (skia-pathops, the extra `styles`); outlines as SVG path data and as cubics."""

import functools
import importlib
import importlib.util
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.noise import uniform

# px. Islands and holes smaller than a square of this side are rounding.
SPECK = 0.1
# Radians, by which the page is turned for one operation after another.
TURNS = (0.0, 0.4, 1.1, 2.3, 2.9)
# px, of an edge.
ROUNDING = 0.01
# px, by which points are moved that lie exactly on each other.
SHAKE = 0.004


def pathops() -> Any:
    """The library.

    Raises:
        ImportError: the extra `styles` is not installed.
    """
    if importlib.util.find_spec("pathops") is None:
        raise ImportError("styles join outlines with skia-pathops: install it with pip install 'diff3ds[styles]'")
    return importlib.import_module("pathops")


def united(path: Any) -> Any:
    """The outline of all that a path covers with nonzero winding: it neither crosses nor overlaps itself.

    Raises:
        ValueError: the library finds none.
    """
    for some in (path, None):
        some = some or _shaken(path)
        found = _agreed(some.transform, lambda moved: pathops().simplify(moved, keep_starting_points=False))
        if found is not None:
            return found
    contours = list(path.contours)
    # Of many, each half by itself, unless some are holes in others.
    if len(contours) > 1 and len({contour.clockwise for contour in contours}) == 1:
        one, other = (united(_path_of(contours[first::2])) for first in (0, 1))
        return _combined(one, other, pathops().PathOp.UNION)
    raise ValueError("the outlines of a stroke could not be joined: make it wider, or move the camera a little")


def _path_of(contours: Iterable[Any]) -> Any:
    path = pathops().Path()
    for contour in contours:
        path.addPath(contour)
    return path


def _shaken(path: Any) -> Any:
    """The outlines with points moved a little, for such as lie exactly on each other."""
    library = pathops()
    moved = library.Path()
    numbers = iter(((uniform(0, 2 * len(path.points)) - 0.5) * 2 * SHAKE).tolist())
    for kind, points in path:
        moved.add(kind, *[(x + next(numbers), y + next(numbers)) for x, y in points])
    return moved


def without(path: Any, taken: Any) -> Any:
    """What a path covers and another one does not."""
    return _combined(path, taken, pathops().PathOp.DIFFERENCE)


def within(path: Any, other: Any) -> Any:
    """What both cover."""
    return _combined(path, other, pathops().PathOp.INTERSECTION)


def _combined(path: Any, other: Any, operation: Any) -> Any:
    found = _agreed(lambda *m: (path.transform(*m), other.transform(*m)), lambda pair: pathops().op(*pair, operation))
    if found is None:
        raise ValueError("the outline of a stroke could not be cut: make it wider, or move the camera a little")
    return found


def _agreed(moved: Callable[..., Any], operation: Callable[[Any], Any]) -> Any:
    """The result of an operation that comes out alike in two turns of the page; None if no two do.

    Skia fails, or loses parts, where curves nearly coincide, some once in a thousand strokes. It does not do so twice
    alike: turned a little, the coordinates are other numbers.
    """
    before: list[Any] = []
    for turn in TURNS:
        c, s = math.cos(turn), math.sin(turn)
        try:
            found = operation(moved(c, s, -s, c, 0, 0)).transform(c, -s, s, c, 0, 0)
        except pathops().PathOpsError:
            continue
        same = next((other for other in before if _alike(other, found)), None)
        if same is not None:
            return _without_specks(same)
        before.append(found)
    return None


def _alike(a: Any, b: Any) -> bool:
    """Whether two outlines have one area, but for rounding along their edges."""
    x0, y0, x1, y1 = a.bounds
    return abs(a.area - b.area) <= ROUNDING * (x1 - x0 + y1 - y0) + 1e-4 * a.area


def _without_specks(path: Any) -> Any:
    return _path_of(contour for contour in path.contours if abs(contour.area) >= SPECK**2)


def svg_data(path: Any) -> str:
    """Path data of an outline, to a hundredth of a pixel, each point relative to the last."""
    library = pathops()
    verb = library.PathVerb
    letters = {verb.MOVE: "m", verb.LINE: "l", verb.QUAD: "q", verb.CUBIC: "c"}
    data: list[str] = []
    x = y = x0 = y0 = 0
    for kind, points in path:
        if kind == verb.CLOSE:
            if data[-1].startswith("l") and (x, y) == (x0, y0):
                data.pop()
            data.append("z")
            x, y = x0, y0
            continue
        rounded = [(round(100 * px), round(100 * py)) for px, py in points]
        text = " ".join(f"{_hundredths(px - x)},{_hundredths(py - y)}" for px, py in rounded)
        data.append(letters[kind] + text)
        x, y = rounded[-1]
        if kind == verb.MOVE:
            x0, y0 = x, y
    return "".join(data)


def cubics_of(path: Any) -> list[Float[Array, "n 2"]]:
    """The contours of an outline as cubics that follow on each other: the start, then three control points each."""
    verb = pathops().PathVerb
    found: list[list[Float[Array, " 2"]]] = []
    for kind, points in path:
        *inner, end = (np.array(point) for point in points or [found[-1][0]])
        if kind == verb.MOVE:
            found.append([end])
            continue
        start = found[-1][-1]
        if kind == verb.QUAD:
            inner = [start + (inner[0] - start) * 2 / 3, end + (inner[0] - end) * 2 / 3]
        if kind == verb.CLOSE and bool((start == end).all()):
            continue
        found[-1] += [*(inner or [start + (end - start) / 3, end + (start - end) / 3]), end]
    return [np.array(contour) for contour in found]


@functools.lru_cache(maxsize=1 << 16)
def _hundredths(value: int) -> str:
    """Steps between points are small: most numbers come again and again."""
    return f"{value / 100:g}"
