"""`diff3ds mesh` of solids: strokes named by their edges, parts as layers, tangent edges thin."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.cli import FAULT, main

pytestmark = needs("OCP")

FEW = ["--quiet", "--turntable", "0", "--size", "128", "--azimuth", "220"]


@pytest.fixture(scope="module")
def rounded(tmp_path_factory) -> Path:
    """A box with one edge rounded and a pin on it, as an assembly of two parts, in STEP."""
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    box = BRepPrimAPI_MakeBox(30.0, 20.0, 10.0).Shape()
    rounding = BRepFilletAPI_MakeFillet(box)
    rounding.Add(4.0, TopoDS.Edge(TopExp_Explorer(box, TopAbs_EDGE).Current()))
    pin = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(15, 10, 10), gp_Dir(0, 0, 1)), 4.0, 8.0).Shape()
    document = TDocStd_Document(TCollection_ExtendedString("a"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    whole = shapes.NewShape()
    for name, shape in (("base plate", rounding.Shape()), ("pin", pin)):
        part = shapes.AddComponent(whole, shapes.AddShape(shape, False), TopLoc_Location())
        TDataStd_Name.Set_s(part, TCollection_ExtendedString(name))
    shapes.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.Transfer(document)
    path = tmp_path_factory.mktemp("solid") / "rounded.step"
    writer.Write(str(path))
    return path


def test_strokes_say_their_edges_and_faces_and_parts_are_layers(rounded, tmp_path):
    main(["mesh", str(rounded), "-o", str(tmp_path), *FEW])
    sketch = ds.load(tmp_path)
    assert {name.partition("/")[0] for name in sketch.names} == {"base plate", "pin"}
    assert len(set(sketch.names)) == len(sketch) == 15 + 2
    drawing = (tmp_path / "drawing-1.svg").read_text()
    labels = re.findall(r'inkscape:label="([^"]+)"', drawing)
    assert {"base plate, crease", "base plate, tangent", "pin, crease", "pin, contour"} <= set(labels)
    assert sum(label.startswith("pin/face ") for label in labels) == 2
    step = (tmp_path / "sketch.step").read_text()
    assert "PRESENTATION_LAYER_ASSIGNMENT('pin crease'" in step
    assert f"'{sketch.names[0]}'" in step
    assert json.loads((tmp_path / "run.json").read_text())["parts"] == ["base plate", "pin"]


def test_lines_between_smooth_faces_are_thin_drawn_or_hidden(rounded, tmp_path):
    widths = {}
    for how in ("thin", "drawn", "hidden"):
        main(["mesh", str(rounded), "-o", str(tmp_path / how), *FEW, "--tangent", how])
        sketch = ds.load(tmp_path / how)
        widths[how] = (len(sketch), np.unique(sketch.width.numpy()).round(6).tolist())
        drawing = (tmp_path / how / "drawing-1.svg").read_text()
        assert ("base plate, tangent" in drawing) == (how != "hidden")
        assert len(set(re.findall(r'stroke-width="([^"]+)"', drawing))) == (2 if how == "thin" else 1)
    assert widths == {"thin": (17, [0.003, 0.006]), "drawn": (17, [0.006]), "hidden": (15, [0.006])}


@pytest.mark.slow
def test_a_function_of_python_takes_solids_too(rounded):
    sketch = ds.mesh_to_sketch(rounded, turntable=0, size=64, tangent="drawn")
    assert sketch.names[0].startswith("base plate/edge ")
    low, high = ds.bezier.bounding_box(sketch.points, sketch.weights)
    assert (high.amax(0) - low.amin(0)).tolist() == pytest.approx([30, 20, 18], abs=1e-9)


@pytest.mark.parametrize("option", [["--angle", "30"], ["--color"]])
def test_options_of_meshes_are_refused(rounded, tmp_path, option, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["mesh", str(rounded), "-o", str(tmp_path / "out"), *FEW, *option])
    assert ended.value.code == FAULT
    assert f"{option[0]} is for meshes, and this is a file of solids: leave it out" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_solid_hides_the_lines_of_any_sketch(rounded):
    surface = ds.load_surface(rounded)
    along = ds.Sketch(torch.tensor([[[15.0, 10, 5], [15, 10, 30]]]))
    (lines,) = ds.visible_lines(along, ds.orbit(40, 20, 200), surface, contours=False)
    # Out of the pin, whose top is at 18.
    assert lines.strokes(True).points[0, 0, 2] == pytest.approx(18, abs=0.2)


@pytest.mark.slow
@pytest.mark.usefixtures("read_here")
@pytest.mark.parametrize(
    ("options", "contours"), [([], False), pytest.param(["--strokes", "6"], True, marks=pytest.mark.slow)]
)
def test_round_solids_have_their_own_edges_and_others_where_they_are_asked_for(tmp_path, options, contours):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeTorus
    from OCP.BRepTools import BRepTools

    BRepTools.Write_s(BRepPrimAPI_MakeTorus(5.0, 2.0, 4.0).Shape(), str(tmp_path / "a.brep"))
    main(["mesh", str(tmp_path / "a.brep"), "-o", str(tmp_path / "out"), *FEW, *options])
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert run["outlines_drawn"] < 0.5
    assert ("contour" in run["kinds"]) == contours
    assert all(name.startswith("a/") for name in ds.load(tmp_path / "out").names)


@pytest.mark.slow
def test_a_ball_without_an_edge_gets_strokes_for_its_outlines(tmp_path):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere
    from OCP.BRepTools import BRepTools

    BRepTools.Write_s(BRepPrimAPI_MakeSphere(5.0).Shape(), str(tmp_path / "a.brep"))
    main(["mesh", str(tmp_path / "a.brep"), "-o", str(tmp_path / "out"), *FEW, "--strokes", "2"])
    sketch = ds.load(tmp_path / "out")
    assert sketch.names == ("a/face 1",) * len(sketch)
