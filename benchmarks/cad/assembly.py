"""A bracket with its bolts and washers as a STEP assembly of named parts, by OCCT."""

import math
from pathlib import Path

from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_DocumentTool

from cad.boundary import edge_curve
from cad.families import flat, regular, straight_convex_edges, upright
from cad.solids import chamfer, common, cone, cut, cylinder, extrude, fillet, fuse, polygon

# Millimetres.
LENGTH, DEPTH, HEIGHT, THICK = 80.0, 50.0, 60.0, 10.0
BASE_HOLES = [(x, y) for x in (30.0, 66.0) for y in (12.0, 38.0)]
WALL_HOLES = [(12.0, 42.0), (38.0, 42.0)]


def bracket() -> TopoDS_Shape:
    """An angle with a rolled inner corner, rounded ends, four counterbores and two holes."""
    profile = [(0, 0), (LENGTH, 0), (LENGTH, THICK), (THICK, THICK), (THICK, HEIGHT), (0, HEIGHT)]
    solid = extrude(polygon(upright(profile), [0, 0, 0, 8, 0, 0]), (0, DEPTH, 0))
    ends = [
        edge
        for edge in straight_convex_edges(solid, THICK - 0.1)
        if edge_curve(edge).length < THICK + 0.1 and edge_curve(edge).points[:, [0, 2]].max() > 55
    ]
    solid = fillet(solid, ends, 7)
    for x, y in BASE_HOLES:
        solid = cut(cut(solid, cylinder((x, y, -1), 3.3, 20)), cylinder((x, y, 4), 5.5, 20))
    for y, z in WALL_HOLES:
        solid = cut(solid, cylinder((-1, y, z), 3.3, 20, (1, 0, 0)))
    return solid


def socket_bolt() -> TopoDS_Shape:
    """A cap screw along z, its head's seat at 0."""
    solid = fuse(cylinder((0, 0, -14), 3, 14), cylinder((0, 0, 0), 5, 6))
    solid = cut(solid, extrude(polygon(flat(regular(6, 2.9), 3), [0] * 6), (0, 0, 10)))
    rim = [edge for edge in _rings(solid) if abs(edge_curve(edge).radius - 5) < 1e-6]
    return fillet(solid, rim[-1:], 0.8)


def hex_bolt() -> TopoDS_Shape:
    """A hexagon bolt along z, its head's seat at 0; the corners of the head are turned off, the end is bevelled."""
    head = extrude(polygon(flat(regular(6, 5.8)), [0] * 6), (0, 0, 4))
    head = common(head, fuse(cylinder((0, 0, 0), 6, 3.2), cone((0, 0, 3.2), (6, 4.6), 0.8)))
    solid = fuse(head, cylinder((0, 0, -16), 3, 16))
    end = [edge for edge in _rings(solid) if abs(edge_curve(edge).points[0, 2] + 16) < 1e-6]
    return chamfer(solid, end, 0.7)


def washer() -> TopoDS_Shape:
    """A flat washer along z, from 0 on."""
    return cut(cylinder((0, 0, 0), 6.2, 1.6), cylinder((0, 0, -1), 3.2, 5))


def _rings(solid: TopoDS_Shape) -> list:
    from cad.boundary import edges_and_faces

    edges = [edge for edge, _ in edges_and_faces(solid) if edge_curve(edge).type == "circle"]
    return sorted(edges, key=lambda edge: edge_curve(edge).points[0, 2])


def _at(x: float, y: float, z: float, along_x: bool = False) -> TopLoc_Location:
    """A place; what stands along z may lie along x."""
    move = gp_Trsf()
    if along_x:
        move.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 1, 0)), math.pi / 2)
    move.SetTranslationPart(gp_Vec(x, y, z))
    return TopLoc_Location(move)


def write_assembly(path: Path) -> TopoDS_Shape:
    """Writes the STEP file; returns what it shows, as one shape."""
    document = TDocStd_Document(TCollection_ExtendedString("assembly"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    whole = _named(shapes.NewShape(), "holder")
    places = [(bracket(), "bracket", [_at(0, 0, 0)])]
    places += [(socket_bolt(), "cap screw", [_at(x, y, 4) for x, y in BASE_HOLES])]
    places += [(washer(), "washer", [_at(THICK, y, z, True) for y, z in WALL_HOLES])]
    places += [(hex_bolt(), "hex bolt", [_at(THICK + 1.6, y, z, True) for y, z in WALL_HOLES])]
    for shape, name, standing in places:
        part = _named(shapes.AddShape(shape, False), name)
        for place in standing:
            _named(shapes.AddComponent(whole, part, place), name)
    shapes.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.SetNameMode(True)
    assert writer.Transfer(document, STEPControl_AsIs)
    writer.Write(str(path))
    return shapes.GetShape_s(whole)


def _named(label: TDF_Label, name: str) -> TDF_Label:
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))
    return label
