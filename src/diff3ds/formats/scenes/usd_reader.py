"""The curves of a USD file as NURBS, by usd-core; `reader_process.py` runs it."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pxr import Gf, Sdf, Tf, Usd, UsdGeom

# What USD takes where a file does not say.
METERS = 0.01
# Curves, with those of instances: more is taken for an attack, which needs few bytes to ask for many.
MOST = 1_000_000
# Files that one refers to, and bytes of all of them.
MOST_LAYERS, MOST_BYTES = 1000, 1 << 28
# y up to z up, of row vectors: what came towards the viewer (z) is -y.
Z_UP = Gf.Matrix4d(1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1)


def found_in(path: str, told: Callable[[int, int], None]) -> tuple[list[dict[str, Any]], list[str]]:
    """All curves that are shown, and what is said.

    Each has points, weights and knots, its colour, opacity, what we say of widths, and how much a unit is in metres.
    """
    try:
        layer = Sdf.Layer.FindOrOpen(path)
    except Tf.ErrorException as error:
        raise ValueError(f"usd-core cannot read this USD file: {str(error).splitlines()[0]}") from error
    if layer is None:
        raise ValueError("usd-core cannot read this USD file: it is broken or none")
    reader = Reader(layer)
    return list(reader.read()), reader.said()


class Reader:
    """Reads the prims of a layer and of what it refers to, and counts what it leaves out."""

    def __init__(self, layer: Any) -> None:
        self._left_out, self._hidden, self._animated, self._count = Counter[str](), 0, 0, 0
        about = layer.pseudoRoot
        self._says_unit = about.HasInfo("metersPerUnit")
        self._scale = float(about.GetInfo("metersPerUnit")) if self._says_unit else METERS
        up = about.GetInfo("upAxis") if about.HasInfo("upAxis") else UsdGeom.GetFallbackUpAxis()
        self._turn = Gf.Matrix4d(1.0) if up == UsdGeom.Tokens.z else Z_UP
        self._stage = Usd.Stage.CreateInMemory()
        for name in self._not_opened(layer):
            self._stage.MuteLayer(name)
        self._stage.GetRootLayer().subLayerPaths.append(layer.identifier)
        # What a player shows when it opens the file.
        start = layer.startTimeCode if layer.HasStartTimeCode() else None
        self._time = Usd.TimeCode.EarliestTime() if start is None else Usd.TimeCode(start)
        self._places = UsdGeom.XformCache(self._time)

    def said(self) -> list[str]:
        """What whoever reads the file should know, a line each."""
        lines = []
        parts = [f"{count} {kind}" for kind, count in sorted((+self._left_out).items())]
        parts += [f"{self._hidden} invisible"] if self._hidden else []
        if parts:
            lines.append(f"left out of what is drawn: {', '.join(parts)}")
        if self._animated:
            lines.append(f"{self._animated} curves move: they are taken at their first frame")
        if not self._says_unit:
            lines.append("says no unit of length (metersPerUnit): centimetres are assumed, as USD does")
        return lines

    def _not_opened(self, root: Any) -> list[str]:
        """Materials that the layer and those below it refer to; they are not looked at.

        Raises:
            ValueError: one refers to what is missing or not in the folder of the file: what it draws is not known.
        """
        folder, package = Path(root.realPath).resolve().parent, f"{root.identifier}["
        seen, materials, waiting, size = {root.identifier}, list[str](), [root], 0
        while waiting:
            layer = waiting.pop()
            for asset in layer.GetCompositionAssetDependencies():
                name = layer.ComputeAbsolutePath(asset) if asset else root.identifier
                if name in seen:
                    continue
                seen.add(name)
                path = Path(name)
                if path.suffix == ".mtlx":
                    materials.append(name)
                    continue
                inside = name.startswith(package) or (path.resolve().is_relative_to(folder) and path.is_file())
                size += path.stat().st_size if inside and path.is_file() else 0
                if len(seen) > MOST_LAYERS or size > MOST_BYTES:
                    raise ValueError(f"refers to more than {MOST_LAYERS} files, or {MOST_BYTES} bytes of them")
                below = Sdf.Layer.FindOrOpen(name) if inside else None
                if below is None:
                    raise ValueError(
                        f"this USD file refers to others that are missing or not in its folder, such as {asset}, which "
                        "are not opened: flatten it first (usdcat --flatten)"
                    )
                waiting.append(below)
        return materials

    def read(self) -> Iterator[dict[str, Any]]:
        """The curves of prims that are shown. Proxies stand in for what is rendered: they are said where nothing is."""
        found: dict[str, list[dict[str, Any]]] = {}
        prims = iter(Usd.PrimRange.Stage(self._stage, Usd.TraverseInstanceProxies()))
        for prim in prims:
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                shown = self._shown(prim)
                if shown:
                    found.setdefault(shown, []).extend(self._instances(UsdGeom.PointInstancer(prim)))
            elif prim.IsA(UsdGeom.Gprim):
                shown = self._shown(prim)
                if shown:
                    found.setdefault(shown, []).extend(self._curves(prim, self._places.GetLocalToWorldTransform(prim)))
        tokens = UsdGeom.Tokens
        yield from found.get(tokens.default_, [])
        yield from found.get(tokens.render, [])
        if not found.get(tokens.render):
            self._left_out["proxies"] += len(found.get(tokens.proxy, []))

    def _shown(self, prim: Any) -> str:
        """The purpose of a prim that is shown, else ""."""
        imageable = UsdGeom.Imageable(prim)
        if imageable.ComputeVisibility(self._time) == UsdGeom.Tokens.invisible:
            self._hidden += 1
            return ""
        purpose: str = imageable.ComputePurpose()
        if purpose == UsdGeom.Tokens.guide:
            self._left_out["guides"] += 1
            return ""
        return purpose

    def _instances(self, instancer: Any) -> Iterator[dict[str, Any]]:
        """The curves of a point instancer: those of its prototypes, at each of its points."""
        prim = instancer.GetPrim()
        kinds = list(instancer.GetProtoIndicesAttr().Get(self._time) or [])
        matrices = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, instancer.IncludeProtoXform, instancer.IgnoreMask
        )
        shown = instancer.ComputeMaskAtTime(self._time) or [True] * len(kinds)
        roots = [prim.GetStage().GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetTargets()]
        world = self._places.GetLocalToWorldTransform(prim)
        if not len(kinds) == len(matrices) == len(shown) or not all(0 <= kind < len(roots) for kind in kinds):
            raise ValueError(f"{prim.GetPath()}: its points and prototypes do not fit together")
        for kind, matrix, is_shown in zip(kinds, matrices, shown, strict=True):
            if not is_shown or not roots[kind]:
                continue
            back = self._places.GetLocalToWorldTransform(roots[kind]).GetInverse()
            for part in Usd.PrimRange(roots[kind], Usd.TraverseInstanceProxies()):
                if part.IsA(UsdGeom.PointInstancer):
                    self._left_out["PointInstancer in another"] += 1
                elif part.IsA(UsdGeom.Gprim):
                    place = self._places.GetLocalToWorldTransform(part) * back * Gf.Matrix4d(matrix) * world
                    yield from self._curves(part, place)

    def _curves(self, prim: Any, place: Any) -> Iterator[dict[str, Any]]:
        """The curves of a prim, at a place in the world."""
        curves: Iterator[tuple[int, dict[str, Any] | None]]
        if prim.IsA(UsdGeom.NurbsCurves):
            curves = self._nurbs(UsdGeom.NurbsCurves(prim))
        elif prim.IsA(UsdGeom.BasisCurves):
            curves = self._basis_curves(UsdGeom.BasisCurves(prim))
        else:
            self._left_out[prim.GetTypeName()] += 1
            return
        place = place * self._turn
        moves = self._moves(prim)
        first, strokes = 0, []
        for i, (count, curve) in enumerate(curves):
            first += count
            if curve is None:
                continue
            self._count += 1
            if self._count > MOST:
                raise ValueError(f"more than {MOST} curves in this USD file")
            self._animated += moves
            if place != Gf.Matrix4d(1.0):
                curve["points"] = [list(place.TransformAffine(Gf.Vec3d(*p))) for p in curve["points"]]
            color = self._look(prim, "displayColor", i, first - count, count) or [0.0, 0.0, 0.0]
            opacity = self._look(prim, "displayOpacity", i, first - count, count) or [1.0]
            look = {"color": color, "opacity": min(max(opacity[0], 0.0), 1.0), "scale": self._scale}
            strokes.append({"curves": [curve], **look, "closed": curve.pop("closed", _own(prim, "closed"))})
        width, space = _own(prim, "width"), _own(prim, "widthSpace")
        if len(strokes) == 1 and width is not None and space in ("image", "world"):
            strokes[0]["width"] = {"space": space, "values": [float(w) for w in width]}
        yield from strokes

    def _moves(self, prim: Any) -> bool:
        """Whether a prim has points, or a place, that change with time."""
        if UsdGeom.PointBased(prim).GetPointsAttr().ValueMightBeTimeVarying():
            return True
        while prim and not prim.IsPseudoRoot():
            if prim.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
                return True
            prim = prim.GetParent()
        return False

    def _value(self, attribute: Any) -> list[Any]:
        return list(attribute.Get(self._time) or [])

    def _look(self, prim: Any, name: str, curve: int, first: int, count: int) -> list[float]:
        """Colour or opacity of a curve of a prim: the mean one where it changes along it; [] where nothing says it."""
        variable = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        values = list(variable.ComputeFlattened(self._time) or []) if variable else []
        rows = [tuple(v) if hasattr(v, "__len__") else (v,) for v in values]
        if not rows:
            return []
        how = variable.GetInterpolation()
        if how in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(rows) >= first + count:
            rows = rows[first : first + count]
        else:
            rows = [rows[min(curve, len(rows) - 1)] if how == UsdGeom.Tokens.uniform else rows[0]]
        return [float(sum(column)) / len(rows) for column in zip(*rows, strict=True)]

    def _nurbs(self, curves: Any) -> Iterator[tuple[int, dict[str, Any] | None]]:
        """The NURBS curves of a prim: how many points each has, and itself."""
        name = curves.GetPath()
        counts, orders = self._value(curves.GetCurveVertexCountsAttr()), self._value(curves.GetOrderAttr())
        points, knots = self._value(curves.GetPointsAttr()), self._value(curves.GetKnotsAttr())
        weights = self._value(curves.GetPointWeightsAttr()) or [1.0] * len(points)
        ranges = self._value(curves.GetRangesAttr())
        expected = sum(count + order for count, order in zip(counts, orders, strict=False))
        if len(orders) != len(counts) or sum(counts) != len(points) != 0 or len(weights) != len(points):
            raise ValueError(f"{name}: {len(counts)} curves of {len(points)} points do not fit together")
        if expected != len(knots):
            raise ValueError(f"{name}: there must be {expected} knots, got {len(knots)}")
        first = at = 0
        for i, (count, order) in enumerate(zip(counts, orders, strict=True)):
            curve: dict[str, Any] = {
                "points": [[float(c) for c in p] for p in points[first : first + count]],
                "weights": [float(w) for w in weights[first : first + count]],
                "knots": [float(k) for k in knots[at : at + count + order]],
            }
            if len(ranges) == len(counts):
                curve["range"] = [float(t) for t in ranges[i]]
            yield count, curve
            first, at = first + count, at + count + order

    def _basis_curves(self, curves: Any) -> Iterator[tuple[int, dict[str, Any] | None]]:
        """The curves of a prim that have a basis: how many points each has, and itself, None of a broken one."""
        counts, points = self._value(curves.GetCurveVertexCountsAttr()), self._value(curves.GetPointsAttr())
        kind, basis, wrap = (
            attribute.Get(self._time)
            for attribute in (curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr())
        )
        if sum(counts) != len(points):
            raise ValueError(f"{curves.GetPath()}: {len(counts)} curves of {len(points)} points do not fit together")
        first = 0
        for count in counts:
            some = [[float(c) for c in p] for p in points[first : first + count]]
            first += count
            curve = _of_basis(some, "linear" if kind == UsdGeom.Tokens.linear else basis, wrap)
            closed = wrap == UsdGeom.Tokens.periodic
            self._left_out["broken BasisCurves"] += curve is None
            yield count, curve and {**curve, "weights": [1.0] * len(curve["points"]), "closed": closed}


def _of_basis(points: list[list[float]], basis: str, wrap: str) -> dict[str, Any] | None:
    """A curve of a basis as points and knots (UsdGeomBasisCurves); None with another number of points than it takes."""
    periodic = wrap == UsdGeom.Tokens.periodic
    if basis == "linear":
        points = points + points[:1] if periodic else points
        knots = [0.0, *map(float, range(len(points))), len(points) - 1.0]
        return {"points": points, "knots": knots} if len(points) > 1 else None
    if basis in ("bspline", "catmullRom"):
        if periodic:
            points = [points[-1], *points, *points[:2]]
        elif wrap == UsdGeom.Tokens.pinned and len(points) > 1:
            # As far beyond the ends as their neighbours are within.
            ends = [[2 * a - b for a, b in zip(*pair, strict=True)] for pair in (points[:2], points[:-3:-1])]
            points = [ends[0], *points, ends[1]]
        if len(points) < 4:
            return None
        if basis == "bspline":
            return {"points": points, "knots": [float(k) for k in range(len(points) + 4)]}
        points = _through(points)
    else:
        points = points + points[:1] if periodic else points
    segments, rest = divmod(len(points) - 1, 3)
    if rest or segments < 1 or basis not in ("bezier", "catmullRom"):
        return None
    return {"points": points, "knots": [0.0, *(float(k // 3) for k in range(3 * segments + 3)), float(segments)]}


def _through(points: list[list[float]]) -> list[list[float]]:
    """The Bézier points of the uniform Catmull-Rom spline through all points but the first and the last."""
    found = [points[1]]
    for a, b, c, d in zip(points, points[1:], points[2:], points[3:], strict=False):
        found.append([y + (z - x) / 6 for x, y, z in zip(a, b, c, strict=True)])
        found.append([y - (z - x) / 6 for x, y, z in zip(b, c, d, strict=True)])
        found.append(c)
    return found


def _own(prim: Any, name: str) -> Any:
    """The value of an attribute of ours, or None."""
    attribute = prim.GetAttribute(f"diff3ds:{name}")
    return attribute.Get() if attribute else None
