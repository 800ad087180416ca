"""DXF files for CAD programs and cutters, by ezdxf (the extra `cad`).

A stroke becomes LINE, ARC, CIRCLE and ELLIPSE where it is one, and rational SPLINE elsewhere, exactly; or, for programs
that ignore the weights of splines, polylines. There is a layer a colour, named by it, or those that the caller names,
and each entity has the number of its stroke (extended data of the application DIFF3DS). Not kept: widths, opacities and
`width_space`.
"""

import importlib.util
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diff3ds._files import replacing
from diff3ds._units import MILLIMETRES, Unit
from diff3ds.formats.apart import check_size, nurbs_sketch
from diff3ds.formats.cad.curve_kinds import Arc, Curve, Line, curves_of
from diff3ds.formats.cad.layers import checked_layers, color_layers
from diff3ds.formats.opening import check_writable
from diff3ds.formats.scenes.polylines import polylines_of
from diff3ds.sketch import Sketch

APPLICATION = "DIFF3DS"
# The numbers of $INSUNITS.
_INSUNITS: dict[Unit, int] = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6}


def save_dxf(
    path: str | Path,
    sketch: Sketch,
    *,
    unit: Unit = "mm",
    polylines: bool = False,
    layers: Sequence[str] | None = None,
) -> None:
    """Writes a DXF file of AutoCAD 2010, whole or not at all.

    Args:
        unit: what a world unit is.
        polylines: all strokes as 3D polylines, off by 1e-4 of the sketch's radius at most.
        layers: the layer of each stroke, by name; by default there is one a colour.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: no strokes, layers that are not one a stroke, a unit that is not known, or values that have become
            invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_writable(path, sketch, unit, "DXF", "ezdxf", "ezdxf", "cad")
    import ezdxf

    named = checked_layers(layers, sketch)
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = _INSUNITS[unit]
    # Metric, or English.
    document.header["$MEASUREMENT"] = int(MILLIMETRES[unit] % 1 == 0)
    document.appids.add(APPLICATION)
    space = document.modelspace()
    sketch = sketch.detach().to("cpu")
    drawn = _polylines(space, sketch) if polylines else _curves(space, sketch)
    for stroke, (entities, name) in enumerate(zip(drawn, named or color_layers(sketch), strict=True)):
        color = tuple(round(min(max(c, 0.0), 1.0) * 255) for c in sketch.color[stroke].tolist())
        if name not in document.layers:
            document.layers.add(name).rgb = color
        for entity in entities:
            entity.dxf.layer = name
            if named:
                entity.rgb = color
            entity.set_xdata(APPLICATION, [(1000, "stroke"), (1071, stroke)])
    with replacing(path) as temporary:
        document.saveas(temporary)


def _curves(space: Any, sketch: Sketch) -> list[list[Any]]:
    """The entities of each stroke."""
    return [[_entity(space, curve) for curve in curves] for curves in curves_of(sketch)]


def _entity(space: Any, curve: Curve) -> Any:
    if isinstance(curve, Line):
        return space.add_line(curve.start, curve.stop)
    if isinstance(curve, Arc):
        return _circle(space, curve) if curve.circular else _ellipse(space, curve)
    spline = space.add_spline(degree=curve.degree)
    # They are what they are: of ezdxf's own knots the inner ones are simple.
    spline.control_points, spline.knots, spline.weights = curve.points, curve.knots, curve.weights
    return spline


def _circle(space: Any, arc: Arc) -> Any:
    """Circles and their arcs are given in a frame that the normal defines (DXF's arbitrary axes)."""
    from ezdxf.math import OCS

    radius = float(np.linalg.norm(arc.major))
    normal = np.cross(arc.major, arc.minor) / radius**2
    frame = OCS(tuple(normal))
    center, axis = frame.from_wcs(tuple(arc.center)), frame.from_wcs(tuple(arc.major))
    given = {"extrusion": tuple(normal)}
    if arc.whole:
        return space.add_circle(center, radius, dxfattribs=given)
    offset = math.atan2(axis[1], axis[0])
    ends = [math.degrees(offset + t) for t in (arc.start, arc.stop)]
    return space.add_arc(center, radius, *ends, dxfattribs=given)


def _ellipse(space: Any, arc: Arc) -> Any:
    major, minor = float(np.linalg.norm(arc.major)), float(np.linalg.norm(arc.minor))
    normal = np.cross(arc.major, arc.minor) / (major * minor)
    given = {"extrusion": tuple(normal)}
    return space.add_ellipse(tuple(arc.center), tuple(arc.major), minor / major, arc.start, arc.stop, dxfattribs=given)


def _polylines(space: Any, sketch: Sketch) -> list[list[Any]]:
    """One polyline a stroke."""
    return [[space.add_polyline3d(line.vertices, close=line.closed)] for line in polylines_of(sketch)]


def load_dxf(path: str | Path) -> Sketch:
    """The curves of a DXF file's model space as strokes, float64, in millimetres.

    Lines, arcs, circles, ellipses, polylines and splines up to degree 3 are exact, also in blocks; the entities of a
    stroke that `save_dxf` wrote are one again. Colours are those of the entities or their layers. Widths, opacities and
    `width_space` get the defaults of `Sketch`.

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
    return nurbs_sketch(path, "cad/dxf_reader", "ezdxf", "DXF")
