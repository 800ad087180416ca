"""STL and IGES files, as trimesh and OCCT read them."""

import numpy as np
import pytest
import torch

import diff3ds as ds


def strokes():
    """A circle, a line and a rational cubic."""
    ring, weights = ds.bezier.circle((0.1, 0.0, 0.2), 0.4, (0.3, 0.2, 1.0))
    ring = ds.Sketch(ring, weights, chains=ds.Chains.of([len(ring)], True))
    line = ds.Sketch(torch.tensor([[[0.0, 0.0, 0.0], [0.2, 0.6, 0.5]]], dtype=torch.float64))
    points = torch.tensor([[[1.0, 0, 0], [1, 1, 0], [2, 1, 1], [2, 0, 3]]], dtype=torch.float64)
    free = ds.Sketch(points, torch.tensor([[1, 0.5, 2, 1.0]], dtype=torch.float64))
    return ds.Sketch.concatenate([ring, line, free]).replace(width=0.02, width_space="world")


def test_stl_files_are_closed_tubes(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    ds.save(tmp_path / "a.stl", strokes()[[0, 1]])
    mesh = trimesh.load(tmp_path / "a.stl")
    assert mesh.is_watertight
    tubes = sorted(part.volume for part in mesh.split())
    line = 0.01**2 * np.pi * (np.sqrt(0.04 + 0.36 + 0.25) + 4 / 3 * 0.01)
    # The surface is within 5 % of the radius of the tube.
    assert tubes == pytest.approx([line, 0.01**2 * np.pi * 0.8 * np.pi], rel=0.1)
    wanted = np.cross(*np.moveaxis(np.diff(mesh.triangles, axis=1), 1, 0))
    assert (np.einsum("fi,fi->f", mesh.face_normals, wanted) > 0).all()
    with pytest.raises(ValueError, match="an STL file needs at least one stroke with a width"):
        ds.save(tmp_path / "b.stl", strokes().replace(width=0.0))
    with pytest.raises(ValueError, match="says no unit of length"):
        ds.save(tmp_path / "b.stl", strokes(), unit="mm")


@pytest.mark.parametrize(("unit", "mm"), [(None, 1.0), ("m", 1000.0), ("in", 25.4)])
def test_iges_files_have_the_curves(tmp_path, unit, mm):
    """To the digits that OCCT writes."""
    pytest.importorskip("OCP", reason="takes the extra cad")
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.IGESControl import IGESControl_Reader
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    ds.save(tmp_path / "a.igs", strokes(), unit=unit)
    reader = IGESControl_Reader()
    reader.ReadFile(str(tmp_path / "a.igs"))
    reader.TransferRoots()
    edges, found = TopExp_Explorer(reader.OneShape(), TopAbs_EDGE), []
    while edges.More():
        found.append(BRepAdaptor_Curve(TopoDS.Edge(edges.Current())))
        edges.Next()
    assert [curve.GetType().name for curve in found] == ["GeomAbs_Circle", "GeomAbs_Line", "GeomAbs_BSplineCurve"]
    circle, _, free = found
    assert circle.Circle().Radius() == pytest.approx(0.4 * mm, rel=1e-9)
    for t in (0.0, 0.3, 1.0):
        wanted = (
            ds.bezier.evaluate(strokes().points[-1:], strokes().weights[-1:], torch.tensor([t]).double())[0, 0] * mm
        )
        point = free.Value(t)
        assert (point.X(), point.Y(), point.Z()) == pytest.approx(wanted.tolist(), rel=1e-7, abs=1e-7 * mm)
