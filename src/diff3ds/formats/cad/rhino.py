"""3DM files for Rhino and what reads its files, by rhino3dm (the extra `cad`).

A stroke becomes one curve, called by its name or "stroke 0", "stroke 1" and so on, on a layer of its colour: a line or
an arc of a circle where it is one, else a NURBS curve of double precision, homogeneous as Rhino has them (control
points times their weights, and weights), or a polycurve of these. Not kept: widths, opacities and `width_space`.
"""

import base64
import importlib.util
import math
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._files import write_bytes
from diff3ds._units import Unit, check_tolerance
from diff3ds.bezier import ellipse, to_nurbs
from diff3ds.formats.apart import check_size, nurbs_sketch
from diff3ds.formats.cad.arcs import Arc
from diff3ds.formats.cad.strokes_as_curves import Curve, Line, Spline, curves_of
from diff3ds.formats.opening import check_writable
from diff3ds.sketch import Sketch

# Where strokes are that are in no layer of others.
NO_LAYER = ("strokes",)
# Rhino's names of units.
_SYSTEMS: dict[Unit, str] = {"mm": "Millimeters", "cm": "Centimeters", "m": "Meters", "in": "Inches", "ft": "Feet"}


def save_3dm(
    path: str | Path,
    sketch: Sketch,
    *,
    unit: Unit = "mm",
    layers: Sequence[tuple[str, ...]] | None = None,
    tolerance: float | None = None,
) -> None:
    """Writes a file of Rhino 7, whole or not at all.

    Args:
        unit: what a world unit is.
        layers: of each stroke the names of the layers that it is in, from the outermost on; by default one a colour.
        tolerance: how far what stands for a curve may lie off it, world units; by default as well as the coordinates
            are known (`strokes_as_curves.resolution`).

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: no strokes, layers that are not one a stroke, a unit that is not known, a tolerance that is negative
            or not finite, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_writable(path, sketch, unit, "3DM", "rhino3dm", "rhino3dm", "cad")
    check_tolerance(tolerance)
    # Its stubs call read-only what can be written.
    rhino3dm: Any = import_module("rhino3dm")
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, _SYSTEMS[unit])
    if layers is not None and len(layers) != len(sketch):
        raise ValueError(f"layers must be one a stroke, {len(sketch)}, got {len(layers)}")
    known: dict[tuple[str, ...], Any] = {}
    for stroke, curves in enumerate(curves_of(sketch, tolerance)):
        color = tuple(round(min(max(c, 0.0), 1.0) * 255) for c in sketch.color[stroke].tolist())
        group = ("#{:02x}{:02x}{:02x}".format(*color),) if layers is None else layers[stroke] or NO_LAYER
        attributes = rhino3dm.ObjectAttributes()
        name = sketch.names[stroke] if sketch.names else ""
        attributes.Name, attributes.LayerIndex = name or f"stroke {stroke}", _layer(model, group, color, known).Index
        if layers is not None:
            attributes.ObjectColor = (*color, 255)
            attributes.ColorSource = rhino3dm.ObjectColorSource.ColorFromObject
        model.Objects.AddCurve(_joined([_curve(curve) for curve in curves]), attributes)
    options = rhino3dm.File3dmWriteOptions()
    options.Version = 7
    write_bytes(path, base64.b64decode(model.Encode(options)))


def _layer(model: Any, group: tuple[str, ...], color: tuple[int, ...], known: dict[tuple[str, ...], Any]) -> Any:
    """The layer of this group, in the layers that hold it, added where it is not there yet."""
    if group not in known:
        rhino3dm: Any = import_module("rhino3dm")
        layer = rhino3dm.Layer()
        layer.Name, layer.Color = group[-1], (*color, 255)
        if len(group) > 1:
            layer.ParentLayerId = _layer(model, group[:-1], color, known).Id
        known[group] = model.Layers[model.Layers.Add(layer)]
    return known[group]


def _joined(parts: list[Any]) -> Any:
    """Curves that follow on each other, as one."""
    if len(parts) == 1:
        return parts[0]
    rhino3dm: Any = import_module("rhino3dm")
    whole = rhino3dm.PolyCurve()
    for part in parts:
        whole.Append(part)
    return whole


def _curve(curve: Curve) -> Any:
    """A curve as Rhino has it."""
    rhino3dm: Any = import_module("rhino3dm")
    if isinstance(curve, Line):
        return rhino3dm.LineCurve(*(rhino3dm.Point3d(*place.tolist()) for place in (curve.start, curve.stop)))
    if isinstance(curve, Arc) and curve.circular:
        circle = rhino3dm.Circle(float(np.linalg.norm(curve.major)))
        axes = (rhino3dm.Vector3d(*axis.tolist()) for axis in (curve.major, curve.minor))
        circle.Plane = rhino3dm.Plane(rhino3dm.Point3d(*curve.center.tolist()), *axes)
        if curve.whole:
            return rhino3dm.ArcCurve.CreateFromCircle(circle)
        return rhino3dm.ArcCurve.CreateFromArc(rhino3dm.Arc(circle, curve.stop))
    if isinstance(curve, Arc):
        center, u, v = (torch.from_numpy(vector) for vector in (curve.center, curve.major, curve.minor))
        pieces = ellipse(center, u, v, start=math.degrees(curve.start), stop=math.degrees(curve.stop))
        control, weight, knots = to_nurbs(*pieces)
        curve = Spline(control.numpy(), weight.numpy(), knots.numpy(), 2)
    return _nurbs(curve)


def _nurbs(spline: Spline) -> Any:
    rhino3dm: Any = import_module("rhino3dm")
    curve = rhino3dm.NurbsCurve(3, True, spline.degree + 1, len(spline.points))
    for i, (place, w) in enumerate(zip(spline.points.tolist(), spline.weights.tolist(), strict=True)):
        # What Rhino keeps is homogeneous.
        curve.Points[i] = rhino3dm.Point4d(*(c * w for c in place), w)
    # Rhino leaves out the first knot and the last that others have.
    for i, knot in enumerate(spline.knots[1:-1].tolist()):
        curve.Knots[i] = knot
    return curve


def load_3dm(path: str | Path) -> Sketch:
    """The curves that a 3DM file shows as strokes, float64, in millimetres: control points within rounding.

    Lines, arcs, polylines, polycurves and NURBS curves up to degree 3 are exact, also in blocks. Colours are those of
    the objects, their layers or block references. Widths, opacities and `width_space` get the defaults of `Sketch`. A
    warning counts, by kind, what else there is, such as surfaces and meshes, and what is hidden or on a sheet; another
    one says that the file names no unit of length.

    rhino3dm reads in a process of its own: a file that makes it crash or hang gives an error like any broken file.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: larger than 256 MiB, not a 3DM file, a broken one, no curves, a curve of a higher degree.
        OSError: the file cannot be read.
    """
    path = Path(path)
    check_size(path)
    if importlib.util.find_spec("rhino3dm") is None:
        raise ImportError(f"{path}: reading 3DM takes rhino3dm: install it with pip install 'diff3ds[cad]'")
    return nurbs_sketch(path, "diff3ds.formats.cad.rhino_reader", "rhino3dm", "3DM")
