"""The edges of a STEP file as Bézier curves, by OCCT. A script: `python step_reader.py FILE` answers in JSON.

It imports nothing of the package: `load_step` runs it in a process of its own, so that no file takes its caller down.
"""

import json
import os
import sys
from collections.abc import Iterator
from typing import Any

from OCP.BRep import BRep_Tool
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.collections import Sequence_TDF_Label
from OCP.Geom import Geom_BSplineCurve, Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_C1
from OCP.GeomConvert import GeomConvert, GeomConvert_ApproxCurve, GeomConvert_BSplineCurveToBezierCurve
from OCP.IFSelect import IFSelect_RetDone
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.XCAFDoc import XCAFDoc_ColorCurv, XCAFDoc_ColorGen, XCAFDoc_ColorTool, XCAFDoc_DocumentTool

MAX_DEGREE = 3
# Of the approximation of other curves, relative to how far their control points reach from the first.
TOLERANCE = 1e-4
MAX_SEGMENTS = 1000


def strokes_of(path: str) -> list[dict[str, Any]]:
    """All edges: colour (sRGB, in [0, 1]), and Bézier segments with points (K, 3) in millimetres and weights (K)."""
    reader = STEPCAFControl_Reader()
    reader.SetColorMode(True)
    reader.SetNameMode(False)
    if reader.ReadFile(path) != IFSelect_RetDone:
        raise ValueError("OCCT cannot read this STEP file: it is broken or of an unknown schema")
    document = TDocStd_Document(TCollection_ExtendedString("sketch"))
    if not reader.Transfer(document):
        raise ValueError("OCCT finds no shape in this STEP file")
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    labels = Sequence_TDF_Label()
    shapes.GetFreeShapes(labels)
    edges = ShapeMap()
    for i in range(1, labels.Length() + 1):
        TopExp.MapShapes_s(shapes.GetShape_s(labels.Value(i)), TopAbs_EDGE, edges)
    strokes: list[dict[str, Any]] = []
    for i in range(1, edges.Extent() + 1):
        edge = TopoDS.Edge(edges.FindKey(i))
        segments: list[dict[str, Any]] = [{"points": points, "weights": weights} for points, weights in _beziers(edge)]
        if segments:
            # One segment that ends where it begins stays open, as it was written.
            closed = len(segments) > 1 and segments[0]["points"][0] == segments[-1]["points"][-1]
            strokes.append({"segments": segments, "closed": closed, "color": _color(colors, edge)})
    return strokes


def _color(colors: XCAFDoc_ColorTool, edge: Any) -> tuple[float, float, float]:
    color = Quantity_Color()
    for kind in (XCAFDoc_ColorCurv, XCAFDoc_ColorGen):
        if colors.GetColor(edge, kind, color):
            r, g, b = color.Values(Quantity_TOC_sRGB)
            return r, g, b
    return 0.0, 0.0, 0.0


def _beziers(edge: Any) -> Iterator[tuple[list[list[float]], list[float]]]:
    """Control points and weights of the Bézier curves that make up an edge."""
    curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
    if curve is None:
        return
    first, last = BRep_Tool.Range_s(edge)
    if not (isinstance(curve, Geom_BSplineCurve) and (first, last) == (curve.FirstParameter(), curve.LastParameter())):
        curve = Geom_TrimmedCurve(curve, first, last)
    spline = GeomConvert.CurveToBSplineCurve_s(curve)
    if spline.Degree() > MAX_DEGREE:
        spline = _approximation(spline)
    pieces = GeomConvert_BSplineCurveToBezierCurve(spline)
    for i in range(1, pieces.NbArcs() + 1):
        bezier = pieces.Arc(i)
        order = range(1, bezier.NbPoles() + 1)
        poles = [bezier.Pole(k) for k in order]
        yield [[p.X(), p.Y(), p.Z()] for p in poles], [bezier.Weight(k) for k in order]


def _approximation(spline: Geom_BSplineCurve) -> Geom_BSplineCurve:
    """A spline of degree 3 near one of a higher degree."""
    poles = [spline.Pole(k) for k in range(1, spline.NbPoles() + 1)]
    size = max(poles[0].Distance(p) for p in poles)
    approximation = GeomConvert_ApproxCurve(spline, TOLERANCE * size, GeomAbs_C1, MAX_SEGMENTS, MAX_DEGREE)
    if not approximation.HasResult() or approximation.MaxError() > TOLERANCE * size:
        raise ValueError(
            f"a curve of degree {spline.Degree()} cannot be approximated by cubics to {TOLERANCE} of its size"
        )
    return approximation.Curve()


def main(path: str) -> None:
    """Prints {"strokes": [...]} or {"error": message}."""
    # OCCT prints its statistics to the standard output: that goes to the error output, the answer to the real one.
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    try:
        result: dict[str, Any] = {"strokes": strokes_of(path)}
    # OCCT's exceptions have no common Python class but this.
    except Exception as error:
        result = {"error": str(error).strip() or type(error).__name__}
    with answer:
        json.dump(result, answer)


if __name__ == "__main__":
    main(sys.argv[1])
