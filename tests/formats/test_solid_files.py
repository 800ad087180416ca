"""Bodies from STEP, IGES and BREP files: what is read of them, their units and names, and what is refused."""

import math

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.formats.cad.solids import read_solids

pytestmark = needs("OCP")


def _box(*size):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

    return BRepPrimAPI_MakeBox(*map(float, size)).Shape()


def _compound(*shapes):
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def _faces(shape):
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _line():
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.gp import gp_Pnt

    return BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 2, 3)).Edge()


def _step(path, shape, unit="MM"):
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def _iges(path, shape):
    from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer

    IGESControl_Controller.Init_s()
    writer = IGESControl_Writer()
    writer.AddShape(shape)
    writer.Write(str(path))
    return path


def _brep(path, shape):
    from OCP.BRepTools import BRepTools

    BRepTools.Write_s(shape, str(path))
    return path


WRITERS = [("a.step", _step), ("a.STP", _step), ("a.igs", _iges), ("a.brep", _brep)]


@pytest.mark.usefixtures("read_here")
@pytest.mark.parametrize(("name", "write"), WRITERS)
def test_a_box_has_its_twelve_edges_in_millimetres(tmp_path, name, write):
    read = read_solids(write(tmp_path / name, _box(3, 4, 5)))
    assert (len(read.edges), set(read.kinds), len(read.faces), len(read.triangles)) == (12, {"crease"}, 6, 12)
    lengths = ds.bezier.length(read.edges.points, read.edges.weights)
    assert sorted(lengths.tolist()) == pytest.approx([3.0] * 4 + [4.0] * 4 + [5.0] * 4, rel=1e-9)
    # Outwards: from its middle.
    assert (((read.vertices - [1.5, 2, 2.5]) * read.normals).sum(1) > 0).all()
    corners = read.vertices[read.triangles]
    around = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((corners.mean(1) - [1.5, 2, 2.5]) * around).sum(1).min() > 0


@pytest.mark.usefixtures("read_here")
@pytest.mark.parametrize(("unit", "factor"), [("MM", 1.0), ("INCH", 1.0), ("M", 1.0)])
def test_units_of_a_file_come_to_millimetres(tmp_path, unit, factor):
    # OCCT writes a shape of so many millimetres in another unit.
    path = _step(tmp_path / "a.step", _box(25.4, 50, 100), unit)
    assert ("'INCH'" in path.read_text()) == (unit == "INCH")
    read = read_solids(path)
    np.testing.assert_allclose(np.ptp(read.vertices, axis=0), [25.4 * factor, 50, 100], rtol=1e-9)


@pytest.mark.usefixtures("read_here")
def test_a_cylinder_has_two_circles_and_no_seam_and_a_rounded_edge_is_tangent(tmp_path):
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    cylinder = BRepPrimAPI_MakeCylinder(2.0, 5.0).Shape()
    read = read_solids(_brep(tmp_path / "cylinder.brep", cylinder))
    assert read.kinds == ("crease", "crease")
    assert read.edges.chains.closed.tolist() == [True, True]
    assert read.edges.names == ("cylinder/edge 1", "cylinder/edge 3")
    t = torch.linspace(0, 1, 9, dtype=torch.float64)
    radius = ds.bezier.evaluate(read.edges.points, read.edges.weights, t)[..., :2].norm(dim=-1)
    torch.testing.assert_close(radius, torch.full_like(radius, 2.0), rtol=1e-14, atol=0)
    box = _box(9, 9, 9)
    rounding = BRepFilletAPI_MakeFillet(box)
    rounding.Add(2.0, TopoDS.Edge(TopExp_Explorer(box, TopAbs_EDGE).Current()))
    read = read_solids(_step(tmp_path / "a.step", rounding.Shape()))
    lengths = dict.fromkeys(read.kinds, 0.0)
    for kind, edge in zip(read.kinds, ds.losses.lengths(read.edges).tolist(), strict=True):
        lengths[kind] += edge
    # Two arcs in place of two corners, and two lines in place of an edge.
    assert lengths == pytest.approx({"crease": 99.0 - 4 * 2 + 2 * math.pi, "tangent": 18.0}, rel=1e-9)


@pytest.mark.usefixtures("read_here")
def test_faces_that_bound_no_solid_are_sewn_and_their_borders_told(tmp_path):
    loose = _compound(*list(_faces(_box(3, 4, 5)))[:5])
    read = read_solids(_brep(tmp_path / "a.brep", loose))
    assert sorted(read.kinds) == ["border"] * 4 + ["crease"] * 8


@pytest.mark.usefixtures("read_here")
def test_halves_of_a_cylinder_have_no_line_between_them(tmp_path):
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    sewing = BRepBuilderAPI_Sewing()
    for across in (1, -1):
        half = gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(across, 0, 0))
        sewing.Add(next(_faces(BRepPrimAPI_MakeCylinder(half, 2.0, 5.0, math.pi).Shape())))
    sewing.Perform()
    read = read_solids(_brep(tmp_path / "a.brep", sewing.SewedShape()))
    assert set(read.kinds) == {"border"}
    assert ds.losses.lengths(read.edges).sum() == pytest.approx(8 * math.pi, rel=1e-9)


@pytest.mark.slow
def test_what_is_left_out_is_said(tmp_path):
    path = _step(tmp_path / "a.step", _compound(_box(1, 1, 1), _line()))
    with pytest.warns(UserWarning, match=r"a\.step: left out: curves that bound no face \(1\)"):
        read = read_solids(path)
    assert len(read.edges) == 12


@pytest.mark.usefixtures("read_here")
@pytest.mark.parametrize(("name", "write"), WRITERS)
def test_curves_alone_are_no_solid(tmp_path, name, write):
    path = write(tmp_path / name, _line())
    with pytest.raises(ValueError, match=r"no solid and no face in this file: .*diff3ds render"):
        read_solids(path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        pytest.param("a.step", "", "not a STEP file", marks=pytest.mark.slow),
        pytest.param("a.step", "ISO-10303-21;\nHEADER;", "cut off", marks=pytest.mark.slow),
        ("a.step", "ISO-10303-21;\nrubbish\nEND-ISO-10303-21;", "OCCT"),
        pytest.param("a.igs", "", "OCCT cannot read this IGES file", marks=pytest.mark.slow),
        pytest.param("a.iges", "rubbish\n" * 9, "OCCT cannot read this IGES file", marks=pytest.mark.slow),
        pytest.param("a.brep", "", "OCCT cannot read this BREP file", marks=pytest.mark.slow),
        pytest.param(
            "a.brep", "DBRep_DrawableShape\n\nCASCADE Topology V1\nLocations 9999999", "OCCT", marks=pytest.mark.slow
        ),
    ],
)
def test_broken_files_are_told(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=message):
        ds.load_surface(tmp_path / name)


@pytest.mark.parametrize("share", [0.5, *(pytest.param(share, marks=pytest.mark.slow) for share in (0.1, 0.9))])
def test_files_cut_off_anywhere_are_an_error_or_a_solid(tmp_path, share):
    content = _brep(tmp_path / "a.brep", _box(1, 2, 3)).read_bytes()
    (tmp_path / "b.brep").write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match=r"b\.brep"):
        read_solids(tmp_path / "b.brep")


@pytest.mark.usefixtures("read_here")
def test_up_is_turned_for_faces_and_edges_alike(tmp_path):
    from diff3ds.surfaces.form.solid_mesh import load_solid

    solid = load_solid(_brep(tmp_path / "a.brep", _box(1, 2, 3)), "y")
    assert np.ptp(solid.mesh.vertices, axis=0).tolist() == [3, 1, 2]
    assert np.ptp(solid.edges.points.reshape(-1, 3).numpy(), axis=0).tolist() == [3, 1, 2]
