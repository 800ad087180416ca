"""The curve of an edge as Bézier curves, by OCCT; for readers that `reader_process.py` runs."""

from collections.abc import Iterator
from typing import Any

from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BezierCurve, Geom_BSplineCurve, Geom_Conic, Geom_Line, Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_C1
from OCP.GeomConvert import GeomConvert, GeomConvert_ApproxCurve, GeomConvert_BSplineCurveToBezierCurve
from OCP.TopAbs import TopAbs_REVERSED

MAX_DEGREE = 3
# Of the approximation of other curves, relative to how far their control points reach from the first.
TOLERANCE = 1e-4
MAX_SEGMENTS = 1000
# Places along a curve where its approximation is looked at.
_PROBES = 16


def is_tame(edge: Any) -> bool:
    """Whether what stands for the curve of an edge lies near it: of offset curves that break off it does not."""
    curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
    while isinstance(curve, Geom_TrimmedCurve):
        curve = curve.BasisCurve()
    if curve is None or isinstance(curve, (Geom_BSplineCurve, Geom_BezierCurve, Geom_Conic, Geom_Line)):
        return True
    first, last = BRep_Tool.Range_s(edge)
    spline = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(curve, first, last))
    places = [first + (last - first) * i / _PROBES for i in range(_PROBES + 1)]
    wanted, got = ([c.Value(t) for t in places] for c in (curve, spline))
    size = max(wanted[0].Distance(p) for p in wanted)
    return all(a.Distance(b) <= TOLERANCE * size for a, b in zip(wanted, got, strict=True))


def beziers(edge: Any) -> Iterator[tuple[list[list[float]], list[float]]]:
    """Control points and weights of the Bézier curves that make up an edge."""
    curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
    if curve is None:
        return
    first, last = BRep_Tool.Range_s(edge)
    if not (isinstance(curve, Geom_BSplineCurve) and (first, last) == (curve.FirstParameter(), curve.LastParameter())):
        curve = Geom_TrimmedCurve(curve, first, last)
    spline = GeomConvert.CurveToBSplineCurve_s(curve)
    if edge.Orientation() == TopAbs_REVERSED:
        spline.Reverse()
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
