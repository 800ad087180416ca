"""3DM files for Rhino and what reads its files, by rhino3dm (the extra `cad`).

A stroke becomes one NURBS curve of double precision, homogeneous as Rhino has them (control points times their weights,
and weights), called "stroke 0", "stroke 1" and so on, on a layer of its colour. Not kept: widths, opacities and
`width_space`.
"""

import base64
import importlib.util
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from diff3ds._files import write_bytes
from diff3ds._units import Unit
from diff3ds.bezier import to_nurbs
from diff3ds.formats.apart import check_size, nurbs_sketch
from diff3ds.formats.opening import check_writable
from diff3ds.sketch import Sketch

# Rhino's names of units.
_SYSTEMS: dict[Unit, str] = {"mm": "Millimeters", "cm": "Centimeters", "m": "Meters", "in": "Inches", "ft": "Feet"}


def save_3dm(path: str | Path, sketch: Sketch, *, unit: Unit = "mm") -> None:
    """Writes a file of Rhino 7, whole or not at all.

    Args:
        unit: what a world unit is.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: no strokes, a unit that is not known, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_writable(path, sketch, unit, "3DM", "rhino3dm", "rhino3dm", "cad")
    # Its stubs call read-only what can be written.
    rhino3dm: Any = import_module("rhino3dm")
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, _SYSTEMS[unit])
    layers: dict[tuple[int, ...], int] = {}
    for stroke, curve in enumerate(_curves(sketch.detach().to("cpu"))):
        color = tuple(round(min(max(c, 0.0), 1.0) * 255) for c in sketch.color[stroke].tolist())
        if color not in layers:
            layers[color] = model.Layers.AddLayer("#{:02x}{:02x}{:02x}".format(*color), (*color, 255))
        attributes = rhino3dm.ObjectAttributes()
        attributes.Name, attributes.LayerIndex = f"stroke {stroke}", layers[color]
        model.Objects.AddCurve(curve, attributes)
    options = rhino3dm.File3dmWriteOptions()
    options.Version = 7
    write_bytes(path, base64.b64decode(model.Encode(options)))


def _curves(sketch: Sketch) -> Iterator[Any]:
    """Each stroke as Rhino has it."""
    rhino3dm: Any = import_module("rhino3dm")
    points, weights = sketch.points.double(), sketch.weights.double()
    first = range(len(sketch) + 1) if sketch.chains is None else sketch.chains.first.tolist()
    for stroke in range(len(sketch)):
        rows = slice(first[stroke], first[stroke + 1])
        control, weight, knots = to_nurbs(points[rows], weights[rows])
        curve = rhino3dm.NurbsCurve(3, True, points.shape[1], len(control))
        for i, (place, w) in enumerate(zip(control.tolist(), weight.tolist(), strict=True)):
            # What Rhino keeps is homogeneous.
            curve.Points[i] = rhino3dm.Point4d(*(c * w for c in place), w)
        # Rhino leaves out the first knot and the last that others have.
        for i, knot in enumerate(knots[1:-1].tolist()):
            curve.Knots[i] = knot
        yield curve


def load_3dm(path: str | Path) -> Sketch:
    """The curves of a 3DM file as strokes, float64, in millimetres: control points within rounding, weights exact.

    Lines, arcs, polylines and NURBS curves up to degree 3 are exact. Colours are those of the objects or their layers.
    Widths, opacities and `width_space` get the defaults of `Sketch`.

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
    return nurbs_sketch(path, "cad/rhino_reader", "rhino3dm", "3DM")
