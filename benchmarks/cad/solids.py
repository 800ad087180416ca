"""Solids of the CAD kernel: profiles, extrusions, revolutions, holes, unions, rounded and bevelled edges."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_Sewing,
    BRepBuilderAPI_Transform,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer, BRepFilletAPI_MakeFillet
from OCP.BRepLib import BRepLib
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeRevol,
)
from OCP.collections import HArray1_gp_Pnt
from OCP.GC import GC_MakeArcOfCircle
from OCP.GeomAPI import GeomAPI_Interpolate
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.Standard import (
    Standard_ConstructionError,
    Standard_DomainError,
    Standard_Failure,
    Standard_NoSuchObject,
    Standard_NullObject,
    Standard_OutOfRange,
)
from OCP.StdFail import StdFail_NotDone
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Wire

Point = Sequence[float]
Z = (0.0, 0.0, 1.0)
# What the kernel raises where it cannot build a shape; in Python none of them is the base of another.
FAILURES = (
    Standard_ConstructionError,
    Standard_DomainError,
    Standard_Failure,
    Standard_NoSuchObject,
    Standard_NullObject,
    Standard_OutOfRange,
    StdFail_NotDone,
)


class BuildError(Exception):
    """The kernel could not build what was asked for; other dimensions may do."""


def _built(maker) -> TopoDS_Shape:
    """The result of a maker of the kernel, or BuildError."""
    try:
        shape = maker.Shape()
    except FAILURES as failure:
        raise BuildError(str(failure)) from failure
    if shape.IsNull():
        raise BuildError("the kernel returned nothing")
    return shape


def box(corner: Point, size: Point) -> TopoDS_Shape:
    """The box from `corner` to `corner + size`, along the axes."""
    return _built(BRepPrimAPI_MakeBox(gp_Pnt(*corner), *size))


def cylinder(base: Point, radius: float, height: float, direction: Point = Z) -> TopoDS_Shape:
    """A full cylinder from the centre `base` along `direction`."""
    return _built(BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(*base), gp_Dir(*direction)), radius, height))


def cone(base: Point, radii: tuple[float, float], height: float, direction: Point = Z) -> TopoDS_Shape:
    """A frustum of a cone: the radius at `base` and the radius `height` further along `direction`."""
    return _built(BRepPrimAPI_MakeCone(gp_Ax2(gp_Pnt(*base), gp_Dir(*direction)), *radii, height))


def cut(solid: TopoDS_Shape, *tools: TopoDS_Shape) -> TopoDS_Shape:
    """The solid without the tools."""
    for tool in tools:
        solid = _built(BRepAlgoAPI_Cut(solid, tool))
    return unify(solid)


def fuse(solid: TopoDS_Shape, *others: TopoDS_Shape) -> TopoDS_Shape:
    """The union."""
    for other in others:
        solid = _built(BRepAlgoAPI_Fuse(solid, other))
    return unify(solid)


def common(solid: TopoDS_Shape, other: TopoDS_Shape) -> TopoDS_Shape:
    """The intersection."""
    return unify(_built(BRepAlgoAPI_Common(solid, other)))


def unify(shape: TopoDS_Shape) -> TopoDS_Shape:
    """The same solid with faces of one surface, and edges of one curve, made one."""
    tool = ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    tool.Build()
    return tool.Shape()


def _wire(edges: Sequence[TopoDS_Edge]) -> TopoDS_Wire:
    maker = BRepBuilderAPI_MakeWire()
    for edge in edges:
        maker.Add(edge)
    if not maker.IsDone():
        raise BuildError("the profile does not close")
    return maker.Wire()


def _face(edges: Sequence[TopoDS_Edge]) -> TopoDS_Face:
    maker = BRepBuilderAPI_MakeFace(_wire(edges), True)
    if not maker.IsDone():
        raise BuildError("the profile bounds no plane face")
    return maker.Face()


def line(a: Point, b: Point) -> TopoDS_Edge:
    """The edge from a to b."""
    return BRepBuilderAPI_MakeEdge(gp_Pnt(*a), gp_Pnt(*b)).Edge()


def arc(a: Point, middle: Point, b: Point) -> TopoDS_Edge:
    """The circular arc from a to b through `middle`."""
    return BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(gp_Pnt(*a), gp_Pnt(*middle), gp_Pnt(*b)).Value()).Edge()


def spline(points: Sequence[Point], closed: bool = False) -> TopoDS_Edge:
    """The cubic spline (C2) through the points; `closed` comes back smoothly to the first."""
    array = HArray1_gp_Pnt(1, len(points))
    for i, point in enumerate(points, 1):
        array.SetValue(i, gp_Pnt(*point))
    maker = GeomAPI_Interpolate(array, closed, 1e-7)
    maker.Perform()
    if not maker.IsDone():
        raise BuildError("no spline through the points")
    return BRepBuilderAPI_MakeEdge(maker.Curve()).Edge()


def polygon(points: np.ndarray, radii: Sequence[float] | float = 0.0) -> TopoDS_Face:
    """A plane face from (n, 3) corners, each rounded by an arc of its radius (0: sharp) tangent to both sides."""
    count = len(points)
    radii = np.broadcast_to(radii, count)
    ends, edges = [], []
    for i in range(count):
        corner, before, after = points[i], points[i - 1] - points[i], points[(i + 1) % count] - points[i]
        u, v = before / np.linalg.norm(before), after / np.linalg.norm(after)
        half = math.acos(np.clip(u @ v, -1, 1)) / 2
        reach = radii[i] / math.tan(half)
        if reach > 0.48 * min(np.linalg.norm(before), np.linalg.norm(after)):
            raise BuildError("a corner radius is longer than its sides allow")
        ends.append((corner + reach * u, corner + reach * v))
        if radii[i] > 0:
            inwards = (u + v) / np.linalg.norm(u + v)
            middle = corner + inwards * radii[i] * (1 / math.sin(half) - 1)
            edges.append((i, arc(ends[i][0], middle, ends[i][1])))
    edges += [(i + 0.5, line(ends[i][1], ends[(i + 1) % count][0])) for i in range(count)]
    return _face([edge for _, edge in sorted(edges, key=lambda pair: pair[0])])


def outline(edges: Sequence[TopoDS_Edge]) -> TopoDS_Face:
    """The plane face that a closed run of edges bounds."""
    return _face(edges)


def extrude(face: TopoDS_Face, vector: Point) -> TopoDS_Shape:
    """The prism that the face sweeps along the vector."""
    return _built(BRepPrimAPI_MakePrism(face, gp_Vec(*vector)))


def revolve(face: TopoDS_Face, angle: float = 2 * math.pi) -> TopoDS_Shape:
    """What the face sweeps when it turns about the z axis."""
    axis = gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))
    turned = angle < 2 * math.pi
    return _built(BRepPrimAPI_MakeRevol(face, axis, angle) if turned else BRepPrimAPI_MakeRevol(face, axis))


def frustum(lower: np.ndarray, upper: np.ndarray) -> TopoDS_Shape:
    """The solid with plane sides between two similar plane polygons (n, 3), counter-clockwise seen from `upper`."""
    sewing = BRepBuilderAPI_Sewing()
    sides = [
        np.array([lower[i], lower[i - len(lower) + 1], upper[i - len(lower) + 1], upper[i]]) for i in range(len(lower))
    ]
    for corners in [lower[::-1], upper, *sides]:
        sewing.Add(polygon(corners))
    sewing.Perform()
    maker = BRepBuilderAPI_MakeSolid(TopoDS.Shell(sewing.SewedShape()))
    solid = maker.Solid()
    BRepLib.OrientClosedSolid_s(solid)
    return solid


def fillet(solid: TopoDS_Shape, edges: Sequence[TopoDS_Edge], radius: float) -> TopoDS_Shape:
    """The solid with the edges rolled off by a ball of that radius."""
    return _blend(BRepFilletAPI_MakeFillet(solid), lambda maker, edge: maker.Add(radius, edge), edges)


def chamfer(solid: TopoDS_Shape, edges: Sequence[TopoDS_Edge], length: float) -> TopoDS_Shape:
    """The solid with the edges bevelled, `length` along both faces."""
    return _blend(BRepFilletAPI_MakeChamfer(solid), lambda maker, edge: maker.Add(length, edge), edges)


def _blend(maker, add: Callable, edges: Sequence[TopoDS_Edge]) -> TopoDS_Shape:
    try:
        for edge in edges:
            add(maker, edge)
        return maker.Shape()
    except FAILURES as failure:
        raise BuildError(f"the edges cannot be blended: {failure}") from failure


def turn(solid: TopoDS_Shape, degrees: float) -> TopoDS_Shape:
    """The solid turned about the z axis."""
    trsf = gp_Trsf()
    trsf.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), math.radians(degrees))
    return BRepBuilderAPI_Transform(solid, trsf, True).Shape()


def similar(solid: TopoDS_Shape, rotation: np.ndarray, scale: float, shift: np.ndarray) -> TopoDS_Shape:
    """The solid under x -> scale * rotation @ x + shift; lines stay lines and circles stay circles."""
    trsf = gp_Trsf()
    rows = scale * rotation
    trsf.SetValues(*[float(v) for i in range(3) for v in (*rows[i], shift[i])])
    return BRepBuilderAPI_Transform(solid, trsf, True).Shape()
