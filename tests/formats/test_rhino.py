"""3DM, read back by rhino3dm: control points, weights, knots, names, layers and units."""

import math

import pytest
import torch
from needs import needs

import diff3ds as ds

pytestmark = needs("rhino3dm")


def read(path):
    import rhino3dm

    return rhino3dm.File3dm.Read(str(path))


def test_homogeneous_control_points_are_exact(tmp_path, generator):
    points = torch.rand(30, 4, 3, generator=generator, dtype=torch.float64) * 200 - 100
    weights = 0.2 + torch.rand(30, 4, generator=generator, dtype=torch.float64)
    ds.save(tmp_path / "a ü.3dm", ds.Sketch(points, weights))
    objects = read(tmp_path / "a ü.3dm").Objects
    assert len(objects) == 30
    expected = torch.cat([points * weights[..., None], weights[..., None]], -1)
    for stroke, found in enumerate(objects):
        curve = found.Geometry
        assert curve.IsValid
        assert found.Attributes.Name == f"stroke {stroke}"
        assert [[p.X, p.Y, p.Z, p.W] for p in curve.Points] == expected[stroke].tolist()
        assert list(curve.Knots) == [0, 0, 0, 1, 1, 1]


def test_a_circle_of_several_segments_is_one_closed_curve(tmp_path):
    points, weights = ds.bezier.circle((1.0, 2.0, 3.0), 2.0, normal=(0.3, -0.5, 1.0))
    ds.save(tmp_path / "a.3dm", ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], True)))
    (found,) = read(tmp_path / "a.3dm").Objects
    curve = found.Geometry
    assert curve.IsClosed
    domain = curve.Domain
    for i in range(50):
        p = curve.PointAt(domain.T0 + (domain.T1 - domain.T0) * i / 50)
        assert math.dist((p.X, p.Y, p.Z), (1, 2, 3)) == pytest.approx(2, abs=1e-12)


@pytest.mark.parametrize(("unit", "name"), [("mm", "Millimeters"), ("m", "Meters"), ("in", "Inches"), ("ft", "Feet")])
def test_layers_and_units(unit, name, tmp_path):
    color = torch.tensor([[1.0, 0.5, 0], [0, 0, 0], [1.0, 0.5, 0]])
    points = torch.arange(18.0).reshape(3, 2, 3) + torch.eye(3)[:2]
    ds.save(tmp_path / "a.3dm", ds.Sketch(points, color=color), unit=unit)
    model = read(tmp_path / "a.3dm")
    assert model.Settings.ModelUnitSystem.name == name
    assert [layer.Color for layer in model.Layers] == [(255, 128, 0, 255), (0, 0, 0, 255)]
    assert [found.Attributes.LayerIndex for found in model.Objects] == [0, 1, 0]


def test_no_strokes_and_no_rhino3dm(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="needs at least one stroke"):
        ds.save(tmp_path / "a.3dm", ds.Sketch(torch.zeros(0, 4, 3)))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'diff3ds\[cad\]'"):
        ds.save(tmp_path / "a.3dm", ds.Sketch(torch.rand(1, 4, 3)))
    assert list(tmp_path.iterdir()) == []


def test_lines_and_arcs_are_told_far_from_the_origin_too(tmp_path):
    """A circle 10 km away, an ellipse, and a closed slot of two lines and two arcs."""
    import rhino3dm

    far = torch.tensor([1e7, -1e7, 2e6]).double()
    ring, of_ring = ds.bezier.circle((0.0, 0.0, 0.0), 8.0, normal=(1.0, 2.0, 0.5))
    oval, of_oval = ds.bezier.ellipse((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 1.0, 0.0), 20.0, 150.0)
    right, of_right = ds.bezier.circle((10.0, 0.0, 0.0), 3.0, start=-90.0, stop=90.0)
    left, of_left = ds.bezier.circle((0.0, 0.0, 0.0), 3.0, start=90.0, stop=270.0)
    below, above = (torch.stack(ends)[None] for ends in ((left[-1, -1], right[0, 0]), (right[-1, -1], left[0, 0])))
    parts = [(ring, of_ring), (oval, of_oval), (below, None), (right, of_right), (above, None), (left, of_left)]
    raised = [ds.bezier.elevate(*part) for part in parts]
    points, weights = (torch.cat([part[i] for part in raised]) for i in (0, 1))
    chains = ds.Chains.of([len(ring), len(oval), len(points) - len(ring) - len(oval)], [True, False, True])
    ds.save(tmp_path / "a.3dm", ds.Sketch(points + far, weights, chains=chains))
    circle, ellipse, slot = (item.Geometry for item in read(tmp_path / "a.3dm").Objects)
    assert isinstance(circle, rhino3dm.ArcCurve)
    assert circle.Radius == pytest.approx(8, abs=1e-7)
    assert circle.IsClosed
    assert isinstance(ellipse, rhino3dm.NurbsCurve)
    assert isinstance(slot, rhino3dm.PolyCurve)
    kinds = [type(slot.SegmentCurve(i)).__name__ for i in range(slot.SegmentCount)]
    assert kinds == ["LineCurve", "ArcCurve", "LineCurve", "ArcCurve"]
    assert slot.IsClosed
    assert not slot.HasGap
    back = ds.load(tmp_path / "a.3dm")
    assert back.chains.closed.tolist() == [True, False, True]
    sketch = ds.Sketch(points + far, weights, chains=chains)
    low, high = ds.bezier.bounding_box(back.points, back.weights)
    for found, whole in ((low.amin(0), 0), (high.amax(0), 1)):
        expected = ds.bezier.bounding_box(sketch.points, sketch.weights)[whole]
        expected = expected.amax(0) if whole else expected.amin(0)
        torch.testing.assert_close(found, expected, atol=1e-6, rtol=0)
