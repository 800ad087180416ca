"""DXF files for CAD programs and cutters, by ezdxf (the extra `cad`).

A stroke becomes LINE, ARC, CIRCLE and ELLIPSE where it is one, and rational SPLINE elsewhere, exactly; or, for programs
that ignore the weights of splines, polylines. There is a layer a colour, named by it, or those that the caller names,
and each entity has the number of its stroke, and its name if it has one (extended data of the application DIFF3DS:
"stroke", the number, the name). Colours are true ones and, for
programs that map layers by it, the nearest of AutoCAD's 255. Not kept: widths, opacities and `width_space`.
"""

import importlib.util
import logging
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, get_args

import numpy as np

from diff3ds._files import replacing
from diff3ds._units import MILLIMETRES, DxfVersion, Unit, check_tolerance
from diff3ds.bezier import bounding_box
from diff3ds.formats.apart import check_size, nurbs_sketch
from diff3ds.formats.cad.arcs import Arc, Vector
from diff3ds.formats.cad.layers import checked_layers, color_layers
from diff3ds.formats.cad.strokes_as_curves import Curve, Line, curves_of, resolution
from diff3ds.formats.framing import ball_of
from diff3ds.formats.opening import check_writable
from diff3ds.formats.scenes.polylines import TOLERANCE, polylines_of
from diff3ds.sketch import Sketch

APPLICATION = "DIFF3DS"
# Characters of a text in extended data.
LONGEST = 255
# The numbers of $INSUNITS.
_INSUNITS: dict[Unit, int] = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6}

# AutoCAD's colour that is white on black and black on white.
BLACK_OR_WHITE = 7
# Width over height of the window that ezdxf has a drawing opened in, what is left free around the drawing, and how far
# from the origin a point or a vertical line is still seen. [empirical]
_WINDOW, _MARGIN, _LEAST_SEEN = 1.34, 1.1, 1e-6


def save_dxf(
    path: str | Path,
    sketch: Sketch,
    *,
    unit: Unit = "mm",
    polylines: bool = False,
    layers: Sequence[str] | None = None,
    tolerance: float | None = None,
    version: DxfVersion = "R2010",
) -> None:
    """Writes a DXF file, whole or not at all.

    Args:
        unit: what a world unit is; R12 has no word for it.
        polylines: all strokes as polylines, off by the tolerance at most, by default 1e-4 of the sketch's radius.
        layers: the layer of each stroke, by name; by default there is one a colour.
        tolerance: how far what stands for a curve may lie off it, world units; by default as well as the coordinates
            are known (`strokes_as_curves.resolution`).
        version: of AutoCAD. Files of R12, for old cutters, have polylines.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: no strokes, layers that are not one a stroke, a unit or version that is not known, a tolerance that
            is negative, not finite, or 0 for polylines, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_writable(path, sketch, unit, "DXF", "ezdxf", "ezdxf", "cad")
    check_tolerance(tolerance)
    if version not in get_args(DxfVersion):
        raise ValueError(f"version must be one of {', '.join(get_args(DxfVersion))}, got {version!r}")
    polylines = polylines or version == "R12"
    if polylines and tolerance == 0:
        raise ValueError("tolerance of polylines must be positive, got 0")
    import ezdxf

    named = checked_layers(layers, sketch)
    # Without a handler what ezdxf logs is printed, such as that R12 has no units.
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    document = ezdxf.new(version)
    document.header["$INSUNITS"] = _INSUNITS[unit]
    # Metric, or English.
    document.header["$MEASUREMENT"] = int(MILLIMETRES[unit] % 1 == 0)
    document.appids.add(APPLICATION)
    sketch = sketch.detach().to("cpu")
    _show(document, sketch)
    space = document.modelspace()
    drawn = _polylines(space, sketch, tolerance) if polylines else _curves(space, sketch, tolerance)
    called = [[(1000, name[:LONGEST])] if name else [] for name in sketch.names or ("",) * len(sketch)]
    for stroke, (entities, name) in enumerate(zip(drawn, named or color_layers(sketch), strict=True)):
        r, g, b = (round(min(max(c, 0.0), 1.0) * 255) for c in sketch.color[stroke].tolist())
        if name not in document.layers:
            document.layers.add(name, color=_nearest_color(r, g, b)).rgb = (r, g, b)
        for entity in entities:
            entity.dxf.layer = name
            if named:
                entity.dxf.color, entity.rgb = _nearest_color(r, g, b), (r, g, b)
            entity.set_xdata(APPLICATION, [(1000, "stroke"), (1071, stroke), *called[stroke]])
    with replacing(path) as temporary:
        document.saveas(temporary)


def _show(document: Any, sketch: Sketch) -> None:
    """Says how far the drawing reaches, and has programs open it there."""
    lower, upper = (box.double() for box in bounding_box(sketch.points, sketch.weights))
    low, high = lower.amin(0).tolist(), upper.amax(0).tolist()
    document.modelspace().reset_extents(low, high)
    width, height = high[0] - low[0], high[1] - low[1]
    # The larger of what the drawing takes up and what as much width takes in a window of ezdxf's ratio.
    seen = max(height, width / _WINDOW, _LEAST_SEEN * max(map(abs, (*low, *high)))) or 1.0
    document.set_modelspace_vport(_MARGIN * seen, ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2))


@cache
def _nearest_color(r: int, g: int, b: int) -> int:
    """The number of AutoCAD's colour nearest to one, in RGB; 7, which is shown white on black, is black here."""
    from ezdxf.colors import aci2rgb

    def off(index: int) -> int:
        known = (0, 0, 0) if index == BLACK_OR_WHITE else aci2rgb(index)
        return sum((a - b) ** 2 for a, b in zip(known, (r, g, b), strict=True))

    return min(range(1, 256), key=off)


def _curves(space: Any, sketch: Sketch, tolerance: float | None) -> list[list[Any]]:
    """The entities of each stroke."""
    flat = resolution(sketch) if tolerance is None else tolerance
    return [[_entity(space, curve, flat) for curve in curves] for curves in curves_of(sketch, tolerance)]


def _entity(space: Any, curve: Curve, flat: float) -> Any:
    """A curve; one that is level up to `flat`, world units, is level."""
    if isinstance(curve, Line):
        return space.add_line(curve.start, curve.stop)
    if isinstance(curve, Arc):
        arc, normal = _upward(curve, flat)
        return _circle(space, arc, normal) if curve.circular else _ellipse(space, arc, normal)
    spline = space.add_spline(degree=curve.degree)
    # They are what they are: of ezdxf's own knots the inner ones are simple.
    spline.control_points, spline.knots, spline.weights = curve.points, curve.knots, curve.weights
    return spline


def _upward(arc: Arc, flat: float) -> tuple[Arc, Vector]:
    """An arc and its normal; of level ones it points up, and they run counter-clockwise from above.

    Several programs pass over the normal: of arcs seen from below they would show the mirror image.
    """
    normal = np.cross(arc.major, arc.minor)
    normal /= np.linalg.norm(normal)
    if float(np.hypot(normal[0], normal[1]) * np.linalg.norm(arc.major)) > flat:
        return arc, normal
    if normal[2] < 0:
        start = -arc.stop % (2 * math.pi)
        arc = arc._replace(minor=-arc.minor, start=start, stop=start + arc.stop - arc.start)
    return arc, np.array([0.0, 0.0, 1.0])


def _circle(space: Any, arc: Arc, normal: Vector) -> Any:
    """Circles and their arcs are given in a frame that the normal defines (DXF's arbitrary axes)."""
    from ezdxf.math import OCS

    radius = float(np.linalg.norm(arc.major))
    frame = OCS(tuple(normal))
    center, axis = frame.from_wcs(tuple(arc.center)), frame.from_wcs(tuple(arc.major))
    given = {"extrusion": tuple(normal)}
    if arc.whole:
        return space.add_circle(center, radius, dxfattribs=given)
    offset = math.atan2(axis[1], axis[0])
    ends = [math.degrees(offset + t) % 360 for t in (arc.start, arc.stop)]
    return space.add_arc(center, radius, *ends, dxfattribs=given)


def _ellipse(space: Any, arc: Arc, normal: Vector) -> Any:
    ratio = float(np.linalg.norm(arc.minor) / np.linalg.norm(arc.major))
    given = {"extrusion": tuple(normal)}
    return space.add_ellipse(tuple(arc.center), tuple(arc.major), ratio, arc.start, arc.stop, dxfattribs=given)


def _polylines(space: Any, sketch: Sketch, tolerance: float | None) -> list[list[Any]]:
    """One polyline a stroke; of R12, whose readers may know no others, level ones are plane."""
    found = []
    relative = TOLERANCE if tolerance is None else tolerance / ball_of(sketch)[1]
    for line in polylines_of(sketch, relative):
        height = float(line.vertices[0, 2])
        if space.dxfversion == "AC1009" and bool((line.vertices[:, 2] == height).all()):
            given = {"elevation": (0.0, 0.0, height)}
            found.append([space.add_polyline2d(line.vertices[:, :2], close=line.closed, dxfattribs=given)])
        else:
            found.append([space.add_polyline3d(line.vertices, close=line.closed)])
    return found


def load_dxf(path: str | Path) -> Sketch:
    """The curves that a DXF file's model space shows as strokes, float64, in millimetres.

    Lines, arcs, circles, ellipses, polylines, multilines and splines up to degree 3 are exact, also in blocks and
    arrays of them, mirrored or scaled unevenly; the entities of a stroke that `save_dxf` wrote are one again, whose
    arcs may run the other way. Colours are those of the entities, their layers or block references. Widths, opacities
    and `width_space` get the defaults of `Sketch`. A warning counts, by kind, what else is drawn, and what is hidden,
    on a layer that is off or frozen, or on a sheet; another one says that the file names no unit of length.

    ezdxf reads in a process of its own: a file that makes it crash or hang gives an error like any other broken file.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: larger than 256 MiB, not a DXF file, a broken one, no curves, a curve of a higher degree.
        OSError: the file cannot be read.
    """
    path = Path(path)
    check_size(path)
    if importlib.util.find_spec("ezdxf") is None:
        raise ImportError(f"{path}: reading DXF takes ezdxf: install it with pip install 'diff3ds[cad]'")
    return nurbs_sketch(path, "diff3ds.formats.cad.dxf_reader", "ezdxf", "DXF")
