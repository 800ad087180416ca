"""STEP files with one feature each, for the tables of docs/reference/formats-read.md."""

import re
from pathlib import Path

import pytest
import torch
from read_curves import on_circle, reaches
from read_example import Example

import diff3ds as ds
from diff3ds.formats import save_step

LINES = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 9, 0]]], dtype=torch.float64)
AXES = "#901=CARTESIAN_POINT('',(1.,2.,0.));#902=DIRECTION('',(0.,0.,1.));#903=DIRECTION('',(1.,0.,0.));\
#904=AXIS2_PLACEMENT_3D('',#901,#902,#903);#905=CIRCLE('',#904,3.);"
# A trimmed curve from (4, 2, 0) on, by a point or a parameter, a quarter round.
TRIMMED = (
    AXES
    + "#906=CARTESIAN_POINT('',(4.,2.,0.));#907=CARTESIAN_POINT('',(1.,5.,0.));\
#900=TRIMMED_CURVE('',#905,({}),({}),.T.,.{}.);"
)


def step(change=lambda text: text, count: int = 1, **how):
    """A file of lines, as we write it, with a change of its text."""

    def make(folder: Path) -> Path:
        pytest.importorskip("OCP")
        path = folder / "a.step"
        save_step(path, ds.Sketch(LINES[:count]), **how)
        before = path.read_text()
        path.write_text(change(before))
        assert change(before) != before or how
        return path

    return make


def curve(entities: str, beside: bool = False):
    """A file whose curve is #900 of these entities; the line of the file is there beside it, or not."""

    def change(text: str) -> str:
        text = text.replace("ENDSEC;\nEND-ISO", f"{entities}\nENDSEC;\nEND-ISO")
        kept = r"\1#900," if beside else r"\1#900));"
        return re.sub(r"(GEOMETRIC_CURVE_SET\('\w*',\()" + ("" if beside else r"[^)]*\)\);"), kept, text)

    return step(change)


def hidden(what: str):
    """INVISIBILITY of the second of two lines: of its style, or of the layer that it is on."""

    def change(text: str) -> str:
        number = re.findall(rf"#(\d+)={what}", text)[-1]
        return text.replace("ENDSEC;\nEND-ISO", f"#900=INVISIBILITY((#{number}));\nENDSEC;\nEND-ISO")

    return step(change, 2, layers=["a", "b"])


def assembly(folder: Path) -> Path:
    """An edge of 1 along x in a part, which is twice in an assembly that stands at x 100."""
    pytest.importorskip("OCP")
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.gp import gp_Pnt, gp_Trsf, gp_Vec
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    def at(*place: float) -> TopLoc_Location:
        moved = gp_Trsf()
        moved.SetTranslation(gp_Vec(*place))
        return TopLoc_Location(moved)

    document = TDocStd_Document(TCollection_ExtendedString("a"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    part = shapes.AddShape(BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 0, 0)).Edge(), False)
    inner, outer = shapes.NewShape(), shapes.NewShape()
    for y in (0.0, 5.0):
        shapes.AddComponent(inner, part, at(0, y, 0))
    shapes.AddComponent(outer, inner, at(100, 0, 0))
    shapes.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.Transfer(document)
    writer.Write(str(folder / "a.step"))
    return folder / "a.step"


def solid(folder: Path) -> Path:
    pytest.importorskip("OCP")
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    writer = STEPControl_Writer()
    writer.Transfer(BRepPrimAPI_MakeBox(1, 2, 3).Solid(), STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(folder / "a.step"))
    return folder / "a.step"


UNIT_LINE = reaches([0, 0, 0], [1, 0, 0], 1)
STEP = {
    "curves trimmed by points": Example(
        curve(TRIMMED.format("#906", "#907", "CARTESIAN")), on_circle((1, 2, 0), 3, 90)
    ),
    "curves trimmed by parameters": Example(
        curve(TRIMMED.format("PARAMETER_VALUE(0.)", "PARAMETER_VALUE(1.5707963267948966)", "PARAMETER")),
        on_circle((1, 2, 0), 3, 90),
    ),
    "curves trimmed by both": Example(
        curve(TRIMMED.format("#906,PARAMETER_VALUE(0.)", "#907,PARAMETER_VALUE(1.5707963267948966)", "UNSPECIFIED")),
        on_circle((1, 2, 0), 3, 90),
    ),
    "polylines": Example(
        curve(
            "#901=CARTESIAN_POINT('',(0.,0.,0.));#902=CARTESIAN_POINT('',(2.,0.,0.));"
            "#903=CARTESIAN_POINT('',(2.,3.,0.));#900=POLYLINE('',(#901,#902,#903));"
        ),
        reaches([0, 0, 0], [2, 3, 0], 1),
    ),
    "assemblies in assemblies": Example(assembly, reaches([100, 0, 0], [101, 5, 0], 2)),
    "edges of solids": Example(solid, reaches([0, 0, 0], [1, 2, 3], 12)),
    "units of length": Example(step(unit="in"), reaches([0, 0, 0], [25.4, 0, 0], 1)),
    "what is invisible": Example(hidden("STYLED_ITEM"), UNIT_LINE, "1 hidden"),
    "what is on an invisible layer": Example(hidden("PRESENTATION_LAYER_ASSIGNMENT"), UNIT_LINE, "1 hidden"),
    "points": Example(curve("#900=CARTESIAN_POINT('',(9.,9.,9.));", True), UNIT_LINE, "1 points"),
    "offset curves, to 1e-4": Example(
        curve(AXES + "#900=OFFSET_CURVE_3D('',#905,1.,.F.,#902);"),
        lambda found: abs(float(ds.bezier.length(found.points, found.weights).sum()) - 4 * torch.pi) < 1e-3,
    ),
    "offset curves that are not defined everywhere": Example(
        curve(AXES + "#900=OFFSET_CURVE_3D('',#905,1.,.F.,#903);", True),
        UNIT_LINE,
        "1 curves that are not approximated",
    ),
    "files that are cut off": Example(step(lambda text: text[:-20]), words="cut off"),
}
