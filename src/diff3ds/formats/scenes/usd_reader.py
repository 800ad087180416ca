"""The NurbsCurves of a USD file, by usd-core; `reader_process.py` runs it."""

from typing import Any

from pxr import Gf, Sdf, Tf, Usd, UsdGeom


def strokes_of(path: str) -> tuple[list[dict[str, Any]], list[str]]:
    """All curves: points, weights and knots, colour, opacity, what we say of widths, and how much a unit is.

    The unit is that of the file in metres: `scale`.
    """
    try:
        layer = Sdf.Layer.FindOrOpen(path)
    except Tf.ErrorException as error:
        raise ValueError(f"usd-core cannot read this USD file: {str(error).splitlines()[0]}") from error
    if layer is None:
        raise ValueError("usd-core cannot read this USD file: it is broken or none")
    if layer.GetExternalReferences():
        raise ValueError("this USD file refers to others, which are not opened: flatten it first (usdcat --flatten)")
    stage = Usd.Stage.Open(layer, Usd.Stage.LoadNone)
    scale = UsdGeom.GetStageMetersPerUnit(stage) if stage.HasAuthoredMetadata("metersPerUnit") else 1.0
    places = UsdGeom.XformCache()
    strokes: list[dict[str, Any]] = []
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.NurbsCurves):
            strokes += _strokes(UsdGeom.NurbsCurves(prim), places.GetLocalToWorldTransform(prim), scale)
    return strokes, []


def _strokes(curves: Any, place: Any, scale: float) -> list[dict[str, Any]]:
    """The curves of one prim."""
    name = curves.GetPath()
    counts, orders = list(curves.GetCurveVertexCountsAttr().Get() or []), list(curves.GetOrderAttr().Get() or [])
    points, knots = list(curves.GetPointsAttr().Get() or []), list(curves.GetKnotsAttr().Get() or [])
    weights = list(curves.GetPointWeightsAttr().Get() or [1.0] * len(points))
    expected = sum(count + order for count, order in zip(counts, orders, strict=False))
    if len(orders) != len(counts) or sum(counts) != len(points) != 0 or len(weights) != len(points):
        raise ValueError(f"{name}: {len(counts)} curves of {len(points)} points do not fit together")
    if expected != len(knots):
        raise ValueError(f"{name}: there must be {expected} knots, got {len(knots)}")
    if place != Gf.Matrix4d(1.0):
        points = [place.TransformAffine(Gf.Vec3d(p)) for p in points]
    prim = curves.GetPrim()
    look: dict[str, Any] = {"scale": scale, "closed": _own(prim, "closed")}
    colors, opacities = curves.GetDisplayColorAttr().Get(), curves.GetDisplayOpacityAttr().Get()
    found, first, at = [], 0, 0
    for i, (count, order) in enumerate(zip(counts, orders, strict=True)):
        curve = {
            "points": [[float(c) for c in p] for p in points[first : first + count]],
            "weights": [float(w) for w in weights[first : first + count]],
            "knots": [float(k) for k in knots[at : at + count + order]],
        }
        # One colour for all, or one a curve.
        color = [float(c) for c in colors[min(i, len(colors) - 1)]] if colors else [0.0, 0.0, 0.0]
        opacity = float(opacities[min(i, len(opacities) - 1)]) if opacities else 1.0
        found.append({"curves": [curve], "color": color, "opacity": opacity, **look})
        first, at = first + count, at + count + order
    width, space = _own(prim, "width"), _own(prim, "widthSpace")
    if len(found) == 1 and width is not None and space in ("image", "world"):
        found[0]["width"] = {"space": space, "values": [float(w) for w in width]}
    return found


def _own(prim: Any, name: str) -> Any:
    """The value of an attribute of ours, or None."""
    attribute = prim.GetAttribute(f"diff3ds:{name}")
    return attribute.Get() if attribute else None
