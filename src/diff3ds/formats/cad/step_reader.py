"""The wires and edges of a STEP file as Bézier curves, by OCCT; `reader_process.py` runs it."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from OCP.BRep import BRep_Tool
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.collections import Sequence_TCollection_AsciiString, Sequence_TDF_Label
from OCP.Geom import Geom_BSplineCurve
from OCP.IFSelect import IFSelect_RetDone
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.STEPConstruct import STEPConstruct
from OCP.StepShape import StepShape_GeometricSet
from OCP.StepVisual import (
    StepVisual_ColourRgb,
    StepVisual_CurveStyle,
    StepVisual_OverRidingStyledItem,
    StepVisual_StyledItem,
)
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Iterator
from OCP.XCAFDoc import (
    XCAFDoc_ColorCurv,
    XCAFDoc_ColorGen,
    XCAFDoc_ColorTool,
    XCAFDoc_DocumentTool,
    XCAFDoc_ShapeTool,
)

from diff3ds.formats.cad.edge_curves import beziers, is_tame

# Of the sizes of two segments: how far apart the end of one and the start of the other may be at a joint of a wire.
# [empirical: ends of arcs are computed to 1e-15; other programs write 7 digits and more]
JOINT = 1e-6
# What OCCT calls units of length.
MILLIMETRES = {"millimetre": 1.0, "centimetre": 10.0, "metre": 1000.0, "inch": 25.4, "foot": 304.8}


def found_in(path: str, told: Callable[[int, int], None]) -> tuple[list[dict[str, Any]], list[str]]:
    """All wires and other edges that are shown, and what is said.

    Each has Bézier segments with points (K, 3) in millimetres and weights (K), whether it is closed, its colour (sRGB,
    in [0, 1]), and the width of its curve style (or None): the style's name, the number, and the unit of the file.
    """
    reader, document = transferred(path)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    labels = Sequence_TDF_Label()
    shapes.GetFreeShapes(labels)
    looks, walk = Looks(reader, document), Walk(document)
    strokes: list[dict[str, Any]] = []
    for i in range(1, labels.Length() + 1):
        whole = shapes.GetShape_s(labels.Value(i))
        for found, shape in walk.chains(whole, whole):
            edges = [edge for edge in found if is_tame(edge)]
            walk.left_out["curves that are not approximated"] += len(found) - len(edges)
            strokes += [{**chain, **looks.of(shape, edges[0])} for chain in _joined(edges)]
    counted = _not_transferred(reader) + walk.left_out
    parts = [f"{count} {kind}" for kind, count in sorted(counted.items())]
    return strokes, [f"left out of what is drawn: {', '.join(parts)}"] if parts else []


def transferred(path: str, names: bool = False) -> tuple[STEPCAFControl_Reader, TDocStd_Document]:
    """What reads a file, and the document with its shapes, names, colours and layers.

    Raises:
        ValueError: it is broken, or has no shape.
    """
    reader = STEPCAFControl_Reader()
    reader.SetColorMode(True)
    reader.SetLayerMode(True)
    reader.SetNameMode(names)
    if reader.ReadFile(path) != IFSelect_RetDone:
        raise ValueError("OCCT cannot read this STEP file: it is broken or of an unknown schema")
    document = TDocStd_Document(TCollection_ExtendedString("sketch"))
    if not reader.Transfer(document):
        raise ValueError("OCCT finds no shape in this STEP file")
    return reader, document


def _not_transferred(reader: STEPCAFControl_Reader) -> Counter[str]:
    """What sets of curves hold and OCCT makes nothing of, by kind: points, and curves that it refuses."""
    left_out = Counter[str]()
    session = reader.Reader().WS()
    model, process = session.Model(), session.TransferReader().TransientProcess()
    for i in range(1, model.NbEntities() + 1):
        entity = model.Entity(i)
        if isinstance(entity, StepShape_GeometricSet):
            for k in range(1, entity.NbElements() + 1):
                item = entity.ElementsValue(k).Value()
                if STEPConstruct.FindShape_s(process, item).IsNull():
                    left_out[item.DynamicType().Name().split("_")[-1]] += 1
    return left_out


class Looks:
    """Colours and widths of the shapes of a file."""

    def __init__(self, reader: STEPCAFControl_Reader, document: TDocStd_Document) -> None:
        """Looks for styles that say a colour of curves in so many words: of OCCT's own tool it comes as float32."""
        self._colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
        self._styled, self._styles = ShapeMap(), dict[int, Any]()
        session = reader.Reader().WS()
        model, process = session.Model(), session.TransferReader().TransientProcess()
        for i in range(1, model.NbEntities() + 1):
            entity = model.Entity(i)
            if isinstance(entity, StepVisual_StyledItem) and not isinstance(entity, StepVisual_OverRidingStyledItem):
                style, shape = _curve_style(entity), STEPConstruct.FindShape_s(process, entity.Item())
                if style is not None and not shape.IsNull():
                    self._styles[self._styled.Add(shape)] = style
        lengths, angles, solid_angles = (Sequence_TCollection_AsciiString() for _ in range(3))
        reader.Reader().FileUnits(lengths, angles, solid_angles)
        # Widths are read of files in these units only: those that we write.
        self._unit = MILLIMETRES.get(lengths.Value(1).ToCString().lower(), 1.0) if lengths.Length() else 1.0

    def of(self, *shapes: Any) -> dict[str, Any]:
        """Colour and width of the first of the shapes that has them."""
        for shape in shapes:
            style = self._styles.get(self._styled.FindIndex(shape))
            if style is not None:
                ink, width = style.CurveColour(), style.CurveWidth()
                value = 0.0 if width is None else width.RealValue()
                said = {"name": style.Name().ToCString(), "value": value, "millimetres": self._unit}
                return {"color": (ink.Red(), ink.Green(), ink.Blue()), "width": said}
        color = Quantity_Color()
        for shape in shapes:
            for kind in (XCAFDoc_ColorCurv, XCAFDoc_ColorGen):
                if self._colors.GetColor(shape, kind, color):
                    return {"color": color.Values(Quantity_TOC_sRGB), "width": None}
        return {"color": (0.0, 0.0, 0.0), "width": None}


def _curve_style(item: StepVisual_StyledItem) -> Any:
    """The curve style of an item, if its colour is given as numbers."""
    for assignment in (item.Styles().Value(i) for i in range(1, item.NbStyles() + 1)):
        for i in range(1, assignment.NbStyles() + 1):
            style = assignment.StylesValue(i).Value()
            if isinstance(style, StepVisual_CurveStyle) and isinstance(style.CurveColour(), StepVisual_ColourRgb):
                return style
    return None


class Walk:
    """Goes through shapes, each once, and passes over what is hidden.

    Attributes:
        left_out: what is no curve, or not shown, by kind.
    """

    def __init__(self, document: TDocStd_Document) -> None:
        self.left_out = Counter[str]()
        self._seen, self.hidden = ShapeMap(), ShapeMap()
        main = document.Main()
        layers, labels = XCAFDoc_DocumentTool.LayerTool_s(main), Sequence_TDF_Label()
        layers.GetLayerLabels(labels)
        for i in range(1, labels.Length() + 1):
            if not layers.IsVisible(labels.Value(i)):
                shown = Sequence_TDF_Label()
                layers.GetShapesOfLayer_s(labels.Value(i), shown)
                for k in range(1, shown.Length() + 1):
                    self.hidden.Add(XCAFDoc_ShapeTool.GetShape_s(shown.Value(k)))
        shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
        labels = Sequence_TDF_Label()
        shapes.GetShapes(labels)
        for i in range(1, labels.Length() + 1):
            self._hide(labels.Value(i))

    def _hide(self, label: Any) -> None:
        """Notes what is hidden of a shape, its components and its parts."""
        parts = Sequence_TDF_Label()
        XCAFDoc_ShapeTool.GetComponents_s(label, parts)
        inner = Sequence_TDF_Label()
        XCAFDoc_ShapeTool.GetSubShapes_s(label, inner)
        parts.Append(inner)
        for one in [label, *(parts.Value(i) for i in range(1, parts.Length() + 1))]:
            if not XCAFDoc_ColorTool.IsVisible_s(one):
                self.hidden.Add(XCAFDoc_ShapeTool.GetShape_s(one))

    def chains(self, shape: Any, local: Any, face: bool = False) -> Iterator[tuple[list[Any], Any]]:
        """Edges of wires that bound no face, and other edges each by itself, once; with the shape that they make up.

        Args:
            local: the shape where what it is a part of has it, by which it is known to be hidden.
            face: whether the shape is one or within one.
        """
        if self.hidden.Contains(local):
            self.left_out["hidden (themselves or by their layers)"] += 1
            return
        kind = shape.ShapeType()
        parts = list(zip(_inner(shape, True), _inner(shape, False), strict=True))
        if kind == TopAbs_VERTEX:
            self.left_out["points"] += 1
        elif kind == TopAbs_EDGE:
            if not self._seen.Contains(shape):
                self._seen.Add(shape)
                yield [TopoDS.Edge(shape)], shape
        elif kind == TopAbs_WIRE and not face:
            edges = [TopoDS.Edge(part) for part, _ in parts if not self._seen.Contains(part)]
            for edge in edges:
                self._seen.Add(edge)
            if edges:
                yield edges, shape
        else:
            for part, within in parts:
                yield from self.chains(part, within, face or kind == TopAbs_FACE)


def _inner(shape: Any, placed: bool) -> Iterator[Any]:
    """What a shape is made of, in space or as the shape has it."""
    inner = TopoDS_Iterator(shape, True, placed)
    while inner.More():
        yield inner.Value()
        inner.Next()


def _joined(edges: list[Any]) -> Iterator[dict[str, Any]]:
    """The segments of edges; a new chain begins wherever one does not begin where the one before it ends."""
    chain: list[dict[str, Any]] = []
    exact = False
    for edge in edges:
        segments: list[dict[str, Any]] = [{"points": points, "weights": weights} for points, weights in beziers(edge)]
        spline = isinstance(BRep_Tool.Curve_s(edge, 0.0, 0.0), Geom_BSplineCurve)
        if chain and segments and not _meet(chain[-1], segments[0]):
            yield _chain(chain)
            chain = []
        if chain and segments:
            # The ends of lines and conics are computed; the control points of splines are what the file says.
            if exact:
                segments[0]["points"][0] = chain[-1]["points"][-1]
            else:
                chain[-1]["points"][-1] = segments[0]["points"][0]
        chain += segments
        exact = spline
    if chain:
        yield _chain(chain)


def _chain(segments: list[dict[str, Any]]) -> dict[str, Any]:
    # One segment that ends where it begins stays open, as it was written.
    return {"segments": segments, "closed": len(segments) > 1 and _meet(segments[-1], segments[0])}


def _meet(before: dict[str, Any], after: dict[str, Any]) -> bool:
    """Whether a segment begins where another ends."""
    a, b = before["points"], after["points"]
    size = max(math.dist(a[0], p) for p in a[1:]) + max(math.dist(b[0], p) for p in b[1:])
    return math.dist(a[-1], b[0]) <= JOINT * size
