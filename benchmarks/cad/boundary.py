"""What bounds a solid: its sharp edges with their exact curves, its smooth edges, and a triangle mesh of its faces."""

import math
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d
from OCP.BRepGProp import BRepGProp_Face
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.collections import IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as AncestorMap
from OCP.GCPnts import GCPnts_UniformAbscissa
from OCP.GeomAbs import GeomAbs_CurveType
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

# Between the angles an edge is neither clearly sharp nor clearly smooth; objects with such edges are not used.
SMOOTH_DEGREES, SHARP_DEGREES = 3.0, 25.0
TYPES = {
    GeomAbs_CurveType.GeomAbs_Line: "line",
    GeomAbs_CurveType.GeomAbs_Circle: "circle",
    GeomAbs_CurveType.GeomAbs_Ellipse: "ellipse",
}


class AmbiguousEdgeError(Exception):
    """An edge is neither clearly sharp nor clearly smooth."""


@dataclass(frozen=True)
class Edge:
    """One edge between two faces: samples (n, 3) along it, and the circle or ellipse that it lies on."""

    type: str
    points: np.ndarray
    radius: float | None = None
    center: np.ndarray | None = None
    normal: np.ndarray | None = None

    @property
    def length(self) -> float:
        """Length of the samples' polyline."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @property
    def angle(self) -> float | None:
        """Angle of a circular arc in radians, None for other curves."""
        if self.type != "circle":
            return None
        chords = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return float(2 * np.arcsin(np.clip(chords / (2 * self.radius), 0, 1)).sum())


def edges_and_faces(solid: TopoDS_Shape) -> list[tuple[TopoDS_Edge, list[TopoDS_Face]]]:
    """Every edge with the distinct faces that meet there (one at a seam)."""
    ancestors = AncestorMap()
    TopExp.MapShapesAndAncestors_s(solid, TopAbs_ShapeEnum.TopAbs_EDGE, TopAbs_ShapeEnum.TopAbs_FACE, ancestors)
    out = []
    for i in range(1, ancestors.Extent() + 1):
        edge = TopoDS.Edge(ancestors.FindKey(i))
        faces: list[TopoDS_Face] = []
        for face in ancestors.FindFromIndex(i):
            if not any(face.IsSame(other) for other in faces):
                faces.append(TopoDS.Face(face))
        if not BRep_Tool.Degenerated_s(edge):
            out.append((edge, faces))
    return out


def dihedral(edge: TopoDS_Edge, faces: list[TopoDS_Face]) -> np.ndarray:
    """Angles in degrees between the outward normals of the two faces, at seven places along the edge."""
    normals = []
    for face in faces:
        curve, surface = BRepAdaptor_Curve2d(edge, face), BRepGProp_Face(face)
        first, last = curve.FirstParameter(), curve.LastParameter()
        point, normal, here = gp_Pnt(), gp_Vec(), []
        for t in np.linspace(first, last, 9)[1:-1]:
            uv = curve.Value(float(t))
            surface.Normal(uv.X(), uv.Y(), point, normal)
            here.append((normal.X(), normal.Y(), normal.Z()))
        rows = np.array(here)
        normals.append(rows / np.linalg.norm(rows, axis=1, keepdims=True))
    return np.degrees(np.arccos(np.clip((normals[0] * normals[1]).sum(1), -1, 1)))


def is_sharp(edge: TopoDS_Edge, faces: list[TopoDS_Face]) -> bool:
    """Whether the faces meet at an angle all along the edge; AmbiguousEdgeError where that is not clear."""
    if len(faces) < 2:
        return False
    angles = dihedral(edge, faces)
    if angles.min() >= SHARP_DEGREES:
        return True
    if angles.max() <= SMOOTH_DEGREES:
        return False
    raise AmbiguousEdgeError(f"an edge turns by {angles.min():.0f} to {angles.max():.0f} degrees")


def edge_curve(edge: TopoDS_Edge, spacing: float = 0.004) -> Edge:
    """The exact curve under an edge, sampled evenly by arc length."""
    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    coarse = np.array([_xyz(curve.Value(float(t))) for t in np.linspace(first, last, 33)])
    count = max(3, math.ceil(np.linalg.norm(np.diff(coarse, axis=0), axis=1).sum() / spacing) + 1)
    even = GCPnts_UniformAbscissa(curve, count, 1e-9)
    points = np.array([_xyz(curve.Value(even.Parameter(i))) for i in range(1, count + 1)])
    kind = TYPES.get(curve.GetType(), "spline")
    if kind == "circle":
        conic = curve.Circle()
        return Edge(kind, points, conic.Radius(), *_centre_and_axis(conic))
    if kind == "ellipse":
        conic = curve.Ellipse()
        return Edge(kind, points, None, *_centre_and_axis(conic))
    return Edge(kind, points)


def _centre_and_axis(conic) -> tuple[np.ndarray, np.ndarray]:
    return _xyz(conic.Location()), _xyz(conic.Axis().Direction())


def _xyz(point) -> np.ndarray:
    return np.array([point.X(), point.Y(), point.Z()])


def sharp_and_smooth(solid: TopoDS_Shape) -> tuple[list[Edge], list[Edge]]:
    """The sharp edges, pieces of one curve joined, and the smooth borders between different surfaces."""
    sharp, smooth = [], []
    for edge, faces in edges_and_faces(solid):
        if len(faces) == 2:
            (sharp if is_sharp(edge, faces) else smooth).append(edge_curve(edge))
    return [_canonical(edge) for edge in joined_edges(sharp)], [_canonical(edge) for edge in smooth]


def joined_edges(edges: list[Edge]) -> list[Edge]:
    """Joins two edges of one line, one circle or one smooth spline where they meet and no third edge does."""
    edges = list(edges)
    joined = True
    while joined:
        joined = False
        ends = np.array([[edge.points[0], edge.points[-1]] for edge in edges]).reshape(-1, 3)
        for i, end in enumerate(ends):
            here = np.flatnonzero(np.linalg.norm(ends - end, axis=1) < 1e-6)
            if len(here) != 2 or here[0] // 2 == here[1] // 2 or i != here[0]:
                continue
            a, b = here // 2
            one = edges[a].points if here[0] % 2 else edges[a].points[::-1]
            two = edges[b].points if not here[1] % 2 else edges[b].points[::-1]
            if _same_curve(edges[a], edges[b], one[-2:], two[:2]):
                whole = Edge(edges[a].type, np.concatenate([one, two[1:]]), *_conic_of(edges[a]))
                edges = [edge for k, edge in enumerate(edges) if k not in (a, b)] + [whole]
                joined = True
                break
    return edges


def _conic_of(edge: Edge) -> tuple:
    return edge.radius, edge.center, edge.normal


def _same_curve(a: Edge, b: Edge, leaving: np.ndarray, arriving: np.ndarray) -> bool:
    """Whether b carries a on; the two last samples of a and the two first of b tell for splines and ellipses."""
    if a.type != b.type:
        return False
    if a.type in ("spline", "ellipse"):
        u, v = leaving[1] - leaving[0], arriving[1] - arriving[0]
        # Samples .004 apart turn by up to 5 degrees on a curve of radius .05.
        return u @ v > math.cos(math.radians(6)) * np.linalg.norm(u) * np.linalg.norm(v)
    if a.type == "line":
        u, v = (edge.points[-1] - edge.points[0] for edge in (a, b))
        return abs(u @ v) > (1 - 1e-9) * np.linalg.norm(u) * np.linalg.norm(v)
    near = np.linalg.norm(a.center - b.center) < 1e-6 and abs(a.radius - b.radius) < 1e-6
    return bool(near and abs(a.normal @ b.normal) > 1 - 1e-9)


def _canonical(edge: Edge) -> Edge:
    """The same edge with its direction, and that of its axis, chosen by the numbers rather than by the kernel."""
    points, normal = edge.points, edge.normal
    if tuple(np.round(points[-1], 6)) < tuple(np.round(points[0], 6)):
        points = points[::-1]
    if normal is not None:
        normal = normal * (1 if normal[np.abs(normal).argmax()] > 0 else -1)
    return Edge(edge.type, points, edge.radius, edge.center, normal)


@dataclass(frozen=True)
class Mesh:
    """Triangles of a solid, counter-clockwise seen from outside.

    vertices and normals (v, 3): exact points and unit normals of the surfaces; triangles (t, 3);
    face (t,): the number of the face that each belongs to.
    """

    vertices: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    face: np.ndarray


def mesh(solid: TopoDS_Shape, deflection: float = 3e-4, angle: float = 0.1) -> Mesh:
    """Triangles at most `deflection` from the faces, turning by at most `angle` (radians) from one to the next."""
    BRepMesh_IncrementalMesh(solid, deflection, False, angle, False)
    vertices, normals, triangles, owner = [], [], [], []
    explorer = TopExp_Explorer(solid, TopAbs_ShapeEnum.TopAbs_FACE)
    count, number = 0, 0
    while explorer.More():
        face = TopoDS.Face(explorer.Current())
        v, n, t = _mesh_of_face(face)
        vertices.append(v)
        normals.append(n)
        triangles.append(t + count)
        owner.append(np.full(len(t), number))
        count, number = count + len(v), number + 1
        explorer.Next()
    return Mesh(*(np.concatenate(parts) for parts in (vertices, normals, triangles, owner)))


def _mesh_of_face(face: TopoDS_Face) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    location = TopLoc_Location()
    net = BRep_Tool.Triangulation_s(face, location)
    move, surface = location.Transformation(), BRepGProp_Face(face)
    point, normal = gp_Pnt(), gp_Vec()
    vertices, normals = [], []
    for i in range(1, net.NbNodes() + 1):
        vertices.append(_xyz(net.Node(i).Transformed(move)))
        uv = net.UVNode(i)
        surface.Normal(uv.X(), uv.Y(), point, normal)
        normals.append(_xyz(normal))
    triangles = np.array([net.Triangle(i).Get() for i in range(1, net.NbTriangles() + 1)]) - 1
    points, rows = np.array(vertices), np.array(normals)
    rows /= np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-12)
    a, b, c = points[triangles].transpose(1, 0, 2)
    inside_out = (np.cross(b - a, c - a) * rows[triangles].sum(1)).sum() < 0
    return points, rows, triangles[:, ::-1] if inside_out else triangles
