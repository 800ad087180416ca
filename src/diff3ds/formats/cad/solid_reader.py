"""The bodies of a STEP, IGES or BREP file, by OCCT: triangles of their faces, curves of their edges.

`reader_process.py` runs it.
"""

import base64
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Sewing
from OCP.BRepLib import BRepLib, BRepLib_ToolTriangulatedShape
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.collections import IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as AncestorMap
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.collections import Sequence_TDF_Label
from OCP.GeomAbs import GeomAbs_C0, GeomAbs_C1, GeomAbs_G1
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESControl import IGESControl_Reader
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from diff3ds.formats.cad.edge_curves import beziers, is_tame
from diff3ds.formats.cad.step_reader import Walk, transferred

# How far triangles may lie off a face, as a share of the longest side of all: a tenth of a pixel of 512. And radians
# by which a face may turn from one to the next.
DEFLECTION, TURN = 2e-4, 0.3
# Faces that meet at less than this go on in each other, radians: programs write some of their fillets so well only.
TANGENT = 0.01
# Faces that bound no solid are sewn together where they are no farther apart than this share of their longest side.
# [empirical: files of IGES have five digits and more]
SEWN = 1e-5
# What is no body.
BARE = "curves that bound no face"
# Names that programs give to parts of an assembly where their users give none.
_NO_NAMES = ("=>[", "NAUO", "SOLID", "COMPOUND", "OPEN CASCADE")


class Part(NamedTuple):
    """A body where it stands.

    Attributes:
        name: of the part or of its place in the assembly; "" where it has none.
        shape: as it was modelled.
        place: of it in space.
    """

    name: str
    shape: TopoDS_Shape
    place: TopLoc_Location


def found_in(path: str, told: Callable[[int, int], None]) -> tuple[dict[str, Any], list[str]]:
    """All bodies that are shown, and what is said. Lengths are millimetres.

    `shapes` are bodies as they were modelled, each once: `points`, with `normals` of the face that each is on, of
    `triangles`, whose faces have numbers (`face`), as bytes in base64; `edges`, each with its number, whether it is a
    "crease", a "border" or "tangent", and Bézier segments, and the count of `faces`. `parts` are their places: a name,
    the number of a shape, and three rows of a matrix. Triangles lie no farther off than `deflection`.
    """
    left_out = Counter[str]()
    parts = [part for found in _parts(path, left_out) if (part := _with_faces(found, left_out))]
    if not parts:
        raise ValueError("no solid and no face in this file: of curves alone diff3ds render draws STEP files")
    known = ShapeMap()
    for part in parts:
        known.Add(part.shape)
    deflection = DEFLECTION * _size(parts)
    shapes = []
    for i in range(1, known.Extent() + 1):
        told(i - 1, known.Extent())
        shapes.append(_body(known.FindKey(i), deflection, left_out))
    places = [
        {"name": part.name, "shape": known.FindIndex(part.shape) - 1, "matrix": _matrix(part.place)} for part in parts
    ]
    said = [f"{kind} ({count})" for kind, count in sorted(left_out.items()) if count]
    found = {"shapes": shapes, "parts": places, "deflection": deflection}
    return found, [f"left out: {', '.join(said)}"] if said else []


def _parts(path: str, left_out: Counter[str]) -> Iterator[Part]:
    """What a file shows."""
    suffix = path.lower().rsplit(".", 1)[-1]
    if suffix in ("brep", "brp"):
        shape, builder = TopoDS_Shape(), BRep_Builder()
        if not BRepTools.Read_s(shape, path, builder) or shape.IsNull():
            raise ValueError("OCCT cannot read this BREP file: it is broken")
        yield _located("", shape, TopLoc_Location())
    elif suffix in ("igs", "iges"):
        reader = IGESControl_Reader()
        if reader.ReadFile(path) != IFSelect_RetDone or not reader.TransferRoots() or reader.OneShape().IsNull():
            raise ValueError("OCCT cannot read this IGES file: it is broken, or has no shape")
        yield _located("", reader.OneShape(), TopLoc_Location())
    else:
        _, document = transferred(path, names=True)
        labels = Sequence_TDF_Label()
        XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(labels)
        walk = Walk(document)
        for i in range(1, labels.Length() + 1):
            yield from _of_label(labels.Value(i), "", TopLoc_Location(), walk, left_out)


def _of_label(
    label: TDF_Label, name: str, place: TopLoc_Location, walk: Walk, left_out: Counter[str]
) -> Iterator[Part]:
    """The parts of an assembly, with the names of those that they are in but for the whole."""
    shape = XCAFDoc_ShapeTool.GetShape_s(label)
    if walk.hidden.Contains(shape):
        left_out["hidden parts"] += 1
        return
    if not XCAFDoc_ShapeTool.IsAssembly_s(label):
        yield _located(name or _name(label), shape, place)
        return
    components = Sequence_TDF_Label()
    XCAFDoc_ShapeTool.GetComponents_s(label, components)
    for component in (components.Value(i) for i in range(1, components.Length() + 1)):
        if walk.hidden.Contains(XCAFDoc_ShapeTool.GetShape_s(component)):
            left_out["hidden parts"] += 1
            continue
        part = TDF_Label()
        XCAFDoc_ShapeTool.GetReferredShape_s(component, part)
        called = "/".join(filter(None, [name, _name(component) or _name(part) or "part"]))
        yield from _of_label(part, called, place.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(component)), walk, left_out)


def _name(label: TDF_Label) -> str:
    """The name that a user has given, "" where a program has."""
    found = TDataStd_Name()
    if not label.FindAttribute(TDataStd_Name.GetID_s(), found):
        return ""
    name = found.Get().ToExtString().strip()
    return "" if name.upper().startswith(_NO_NAMES) else name


def _located(name: str, shape: TopoDS_Shape, place: TopLoc_Location) -> Part:
    return Part(name, shape.Located(TopLoc_Location()), place.Multiplied(shape.Location()))


def _with_faces(part: Part, left_out: Counter[str]) -> Part | None:
    """The part, its faces sewn together where they bound no solid; None without faces."""
    faces, solids = ShapeMap(), ShapeMap()
    TopExp.MapShapes_s(part.shape, TopAbs_FACE, faces)
    TopExp.MapShapes_s(part.shape, TopAbs_SOLID, solids)
    if not faces.Extent():
        edges = ShapeMap()
        TopExp.MapShapes_s(part.shape, TopAbs_EDGE, edges)
        left_out[BARE] += edges.Extent()
        return None
    BRepLib.BuildCurves3d_s(part.shape)
    if solids.Extent() or faces.Extent() == 1:
        return part
    sewing = BRepBuilderAPI_Sewing(SEWN * _size([part]))
    sewing.Add(part.shape)
    sewing.Perform()
    return part._replace(shape=sewing.SewedShape())


def _size(parts: list[Part]) -> float:
    """The longest side of the box of parts."""
    box = Bnd_Box()
    for part in parts:
        BRepBndLib.Add_s(part.shape.Located(part.place), box, False)
    if box.IsVoid() or box.IsOpen():
        raise ValueError("its faces have no bounds")
    low, high = box.CornerMin(), box.CornerMax()
    return max(float(b - a) for a, b in ((low.X(), high.X()), (low.Y(), high.Y()), (low.Z(), high.Z())))


def _matrix(place: TopLoc_Location) -> list[list[float]]:
    move = place.Transformation()
    return [[move.Value(row, column) for column in range(1, 5)] for row in range(1, 4)]


def _body(shape: TopoDS_Shape, deflection: float, left_out: Counter[str]) -> dict[str, Any]:
    """A shape's triangles and edges."""
    BRepMesh_IncrementalMesh(shape, deflection, False, TURN, True)
    faces = ShapeMap()
    TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
    points, normals, triangles, face = array("d"), array("d"), array("i"), array("i")
    for number in range(1, faces.Extent() + 1):
        one = TopoDS.Face(faces.FindKey(number))
        if not _add_triangles(one, number, points, normals, triangles, face):
            # Of a few faces it makes triangles only as splines, such as of a cone from a half turn to one and a half.
            spline = BRepBuilderAPI_NurbsConvert(one, True)
            if spline.IsDone():
                one = TopoDS.Face(spline.Shape())
                BRepMesh_IncrementalMesh(one, deflection, False, TURN)
            if not _add_triangles(one, number, points, normals, triangles, face):
                left_out["faces that OCCT makes no triangles of"] += 1
    return {
        "points": _packed(points),
        "normals": _packed(normals),
        "triangles": _packed(triangles),
        "face": _packed(face),
        "faces": faces.Extent(),
        "edges": list(_edges(shape, left_out)),
    }


def _packed(values: "array[Any]") -> str:
    return base64.b64encode(values.tobytes()).decode()


def _add_triangles(
    face: Any, number: int, points: "array[float]", normals: "array[float]", triangles: "array[int]", of: "array[int]"
) -> bool:
    """Adds the triangles of a face, which run round it as seen from outside; False where there are none."""
    place = TopLoc_Location()
    found = BRep_Tool.Triangulation_s(face, place)
    if found is None or not found.NbTriangles():
        return False
    BRepLib_ToolTriangulatedShape.ComputeNormals_s(face, found)
    move, back = place.Transformation(), face.Orientation() == TopAbs_REVERSED
    first = len(points) // 3 - 1
    for i in range(1, found.NbNodes() + 1):
        point, normal = found.Node(i).Transformed(move), found.Normal(i).Transformed(move)
        points.extend((point.X(), point.Y(), point.Z()))
        normals.extend((-normal.X(), -normal.Y(), -normal.Z()) if back else (normal.X(), normal.Y(), normal.Z()))
    for i in range(1, found.NbTriangles() + 1):
        a, b, c = found.Triangle(i).Get()
        triangles.extend((first + a, first + c, first + b) if back else (first + a, first + b, first + c))
        of.append(number)
    return True


def _edges(shape: TopoDS_Shape, left_out: Counter[str]) -> Iterator[dict[str, Any]]:
    """The edges that are drawn, by their numbers in the shape; without seams, over which a face goes on in itself."""
    around = AncestorMap()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, around)
    edges = ShapeMap()
    TopExp.MapShapes_s(shape, TopAbs_EDGE, edges)
    for number in range(1, edges.Extent() + 1):
        edge = TopoDS.Edge(edges.FindKey(number))
        if BRep_Tool.Degenerated_s(edge):
            continue
        kind = _kind(edge, around)
        if kind is None:
            continue
        if kind == "curve":
            left_out[BARE] += 1
            continue
        segments = _segments(edge)
        if segments:
            yield {"edge": number, "kind": kind, "segments": segments}
        else:
            left_out["edges that are not approximated"] += 1


def _segments(edge: Any) -> list[dict[str, Any]]:
    """The Bézier segments of an edge; none of one that is not approximated."""
    try:
        found = beziers(edge) if is_tame(edge) else ()
        return [{"points": points, "weights": weights} for points, weights in found]
    except ValueError:
        return []


def _kind(edge: Any, around: AncestorMap) -> str | None:
    """What an edge is; None for one over which curvature goes on, as between the halves of a cylinder."""
    faces = ShapeMap()
    for face in around.FindFromKey(edge):
        faces.Add(face)
    count = faces.Extent()
    if count == 0:
        return "curve"
    one, other = TopoDS.Face(faces.FindKey(1)), TopoDS.Face(faces.FindKey(min(count, 2)))
    if count == 1 and not BRep_Tool.IsClosed_s(edge, one):
        return "border"
    if count > 2:
        return "crease"
    meet = BRepLib.ContinuityOfFaces_s(edge, one, other, TANGENT)
    if meet == GeomAbs_C0:
        return "crease"
    return "tangent" if meet in (GeomAbs_G1, GeomAbs_C1) else None
