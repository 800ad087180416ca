"""Solids against OCCT's own exact removal of hidden lines, and what their lines are called."""

import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.page.picture import Picture
from diff3ds.surfaces.hidden.mesh_view import MeshView
from diff3ds.surfaces.shape.nearest import Nearest

pytestmark = needs("OCP")
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))


@pytest.fixture(scope="module")
def assembly(tmp_path_factory):
    """The bracket with its bolts and washers: the file, OCCT's shape, and what is read."""
    from cad.assembly import write_assembly

    from diff3ds.surfaces.form.solid_mesh import load_solid

    path = tmp_path_factory.mktemp("assembly") / "assembly.step"
    return path, write_assembly(path), load_solid(path, "z")


def _share(rows, name):
    return sum(row[name] * row["pixels of OCCT's"] for row in rows) / sum(row["pixels of OCCT's"] for row in rows)


@pytest.mark.slow
def test_a_view_of_an_assembly_is_as_occt_draws_it(assembly):
    from solid_views import compare, views_of

    _, shape, solid = assembly
    (row,) = compare(solid, shape, views_of(solid, 12)[4])
    assert row["drawn"] > 0.99
    assert row["true"] > 0.99


@pytest.mark.slow
def test_twelve_views_of_an_assembly_are_as_occt_draws_them(assembly):
    from solid_views import compare, views_of

    _, shape, solid = assembly
    rows = compare(solid, shape, views_of(solid, 12))
    assert _share(rows, "drawn") > 0.999
    assert _share(rows, "true") > 0.999
    assert min(min(row["drawn"], row["true"]) for row in rows) > 0.99


@pytest.mark.slow
@pytest.mark.skipif("cpu" not in ds.available_backends(), reason="installed without the compiled kernels")
def test_what_the_kernel_knows_beforehand_is_what_numpy_says(assembly, monkeypatch):
    mesh = assembly[2].mesh
    rng = np.random.default_rng(3)
    picture = Picture.of(ds.orbit(35.0, 20.0, 2 * mesh.size, size=300).to(torch.float64), 0)
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh), size=3000)]]
    # Many at corners and on edges of faces, where surfaces meet.
    points = (corners * rng.dirichlet([0.1] * 3, 3000)[..., None]).sum(1)
    moved, own = Nearest.of(mesh, mesh.near).places(points)
    view = MeshView(mesh, picture)
    found = [view.in_front(moved, own, rings) for rings in (1, 2)]
    monkeypatch.setattr("diff3ds.surfaces.hidden.mesh_view.kernels", lambda: None)
    for rings, hidden in zip((1, 2), found, strict=True):
        assert (hidden == view.in_front(moved, own, rings)).all()
        assert 0.1 < hidden.mean() < 0.9


def test_parts_have_their_names_and_places(assembly):
    solid = assembly[2]
    screws, washers, bolts = (
        [kind if i == 0 else f"{kind} {i + 1}" for i in range(count)]
        for kind, count in (("cap screw", 4), ("washer", 2), ("hex bolt", 2))
    )
    assert solid.mesh.parts == ("bracket", *screws, *washers, *bolts)
    # The same edge of the four screws, which stand as far apart as their holes.
    rows = [solid.edges.names.index(f"{name}/edge 2") for name in screws]
    first, second = (solid.edges[row].points.reshape(-1, 3) for row in rows[:2])
    torch.testing.assert_close(second - first, torch.tensor([0.0, 26, 0]).double().expand_as(first), atol=1e-9, rtol=0)
    assert set(solid.kinds) == {"crease", "tangent"}


def test_edges_of_the_assembly_are_exact(assembly):
    solid = assembly[2]
    # The rims of counterbores: circles of radius 5.5 round the holes.
    t = torch.linspace(0, 1, 9, dtype=torch.float64)
    found = 0
    for name, edge in zip(solid.edges.names, (solid.edges[i] for i in range(len(solid.edges))), strict=True):
        points = ds.bezier.evaluate(edge.points, edge.weights, t).reshape(-1, 3)
        radius = (points[:, :2] - torch.tensor([30.0, 12.0]).double()).norm(dim=1)
        if name.startswith("bracket") and bool((abs(radius - 5.5) < 1e-3).all()):
            found += 1
            assert float((radius - 5.5).abs().max()) < 1e-9
    assert found == 2


def test_contours_are_called_by_their_faces(assembly):
    from diff3ds.tasks.mesh.solid_lines import with_faces

    solid = assembly[2]
    lines = ds.visible_lines(solid.edges, ds.orbit(40, 30, 300), solid.mesh, kinds=solid.kinds)[0]
    names = with_faces(lines.sketch, solid.mesh).names
    own = [i for i, kind in enumerate(lines.kinds) if kind == "contour"]
    assert own
    assert all("/face " in names[i] for i in own)
    assert names[: len(solid.edges)] == solid.edges.names


@pytest.mark.usefixtures("read_here")
def test_outlines_of_a_cylinder_are_lines_on_it(tmp_path):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.BRepTools import BRepTools

    from diff3ds.surfaces.form.solid_mesh import load_solid

    BRepTools.Write_s(BRepPrimAPI_MakeCylinder(2.0, 5.0).Shape(), str(tmp_path / "a.brep"))
    solid = load_solid(tmp_path / "a.brep", "z")
    (lines,) = ds.visible_lines(solid.edges, ds.orbit(33, 20, 30, height=8), solid.mesh, kinds=solid.kinds)
    outlines = lines.strokes(True, "contour")
    assert len(outlines) == 2
    assert len(lines.strokes(False, "contour")) == 0
    points = outlines.points.reshape(-1, 3)
    # To the deflection of the triangles, and across the view.
    torch.testing.assert_close(points[:, :2].norm(dim=1), torch.full((len(points),), 2.0).double(), atol=2e-3, rtol=0)
    angle = torch.rad2deg(torch.atan2(points[:, 1], points[:, 0])) - 33
    torch.testing.assert_close(angle.abs(), torch.full_like(angle, 90), atol=0.5, rtol=0)


@pytest.mark.usefixtures("read_here")
@pytest.mark.parametrize(("radius", "seams"), [(2.0, False), (2.5, True)])
def test_a_shaft_that_fits_its_bore_has_no_seam_and_one_that_is_too_thick_has(tmp_path, radius, seams):
    from cad.solids import box, cut, cylinder
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Compound

    from diff3ds.surfaces.form.solid_mesh import load_solid

    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    builder.Add(whole, cut(box((-5, -5, 0), (10, 10, 4)), cylinder((0, 0, -1), 2.0, 9)))
    # From another seam on, so that the triangles are others.
    builder.Add(whole, cylinder((0, 0, -3), radius, 11.5))
    BRepTools.Write_s(whole, str(tmp_path / "a.brep"))
    solid = load_solid(tmp_path / "a.brep", "z")
    (lines,) = ds.visible_lines(solid.edges, ds.orbit(33, 20, 40), solid.mesh, kinds=solid.kinds)
    assert ("intersection" in lines.kinds) == seams
