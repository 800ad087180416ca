"""The curves of a 3DM file as NURBS, by rhino3dm; `reader_process.py` runs it."""

from typing import Any

import rhino3dm

MILLIMETRES = {"Millimeters": 1.0, "Centimeters": 10.0, "Meters": 1000.0, "Inches": 25.4, "Feet": 304.8}


def strokes_of(path: str) -> list[dict[str, Any]]:
    """All curves: points, weights and knots, colour (sRGB, in [0, 1]), and the millimetres of a unit."""
    model: Any = rhino3dm.File3dm.Read(path)
    if model is None:
        raise ValueError("rhino3dm cannot read this 3DM file: it is broken or none")
    unit = MILLIMETRES.get(model.Settings.ModelUnitSystem.name, 1.0)
    strokes = []
    for item in model.Objects:
        geometry = item.Geometry
        if not isinstance(geometry, rhino3dm.Curve):
            continue
        curve: Any = geometry if isinstance(geometry, rhino3dm.NurbsCurve) else geometry.ToNurbsCurve()
        if curve is None:
            raise ValueError(f"rhino3dm makes no NURBS curve of {item.Attributes.Name or 'a curve'!r}")
        strokes.append({"curves": [_nurbs(curve)], "color": _color(model, item.Attributes), "scale": unit})
    return strokes


def _nurbs(curve: Any) -> dict[str, Any]:
    homogeneous = [(p.X, p.Y, p.Z, p.W) for p in (curve.Points[i] for i in range(len(curve.Points)))]
    knots = [curve.Knots[i] for i in range(len(curve.Knots))]
    return {
        "points": [(x / w, y / w, z / w) for x, y, z, w in homogeneous],
        "weights": [w for *_, w in homogeneous],
        # Others have one more at each end.
        "knots": [knots[0], *knots, knots[-1]],
    }


def _color(model: Any, attributes: Any) -> tuple[float, float, float]:
    if attributes.ColorSource != rhino3dm.ObjectColorSource.ColorFromLayer:
        rgb = attributes.ObjectColor
    elif 0 <= attributes.LayerIndex < len(model.Layers):
        rgb = model.Layers[attributes.LayerIndex].Color
    else:
        # Such objects are on Rhino's default layer, which is black.
        rgb = (0, 0, 0)
    r, g, b = (channel / 255 for channel in rgb[:3])
    return r, g, b
