"""DXF and 3DM read: what we wrote comes back, curves of other programs are exact, broken files are named."""

import dataclasses
import importlib.util

import pytest
import torch

import diff3ds as ds
from diff3ds.bezier import evaluate

needs_ezdxf = pytest.mark.skipif(importlib.util.find_spec("ezdxf") is None, reason="the extra cad is not installed")
needs_rhino = pytest.mark.skipif(importlib.util.find_spec("rhino3dm") is None, reason="the extra cad is not installed")
pytestmark = pytest.mark.usefixtures("read_here")
BOTH = [pytest.param(".dxf", marks=needs_ezdxf), pytest.param(".3dm", marks=needs_rhino)]
T = torch.linspace(0, 1, 9, dtype=torch.float64)


def on(sketch, stroke):
    """Points along a stroke, (P, 3)."""
    one = sketch[[stroke]]
    return evaluate(one.points, one.weights, T).reshape(-1, 3)


def sketch_of_all_kinds():
    """A line, a tilted arc, a whole circle, a free curve, a chain of a line and an arc; in colours of eight bits."""
    g = torch.Generator().manual_seed(0)
    line = torch.tensor([[[0.0, 0, 0], [1, 2, 3]]], dtype=torch.float64)
    arc, of_arc = ds.bezier.circle((1.0, 2.0, 3.0), 4.0, (1.0, 2.0, 0.5), start=-30.0, stop=80.0)
    ring, of_ring = ds.bezier.circle((1.0, 2.0, 3.0), 5.0, (1.0, 1.0, 0.0))
    free = torch.rand(1, 4, 3, generator=g, dtype=torch.float64)
    of_free = 0.5 + torch.rand(1, 4, generator=g, dtype=torch.float64)
    bend, of_bend = ds.bezier.circle((0.0, 0.0, 0.0), 2.0, start=10.0, stop=100.0)
    way = torch.stack([torch.tensor([5.0, 5.0, 1.0]).double(), bend[0, 0]])[None]
    plain = [(line, None), (arc, of_arc), (ring, of_ring), (free, of_free), (way, None), (bend, of_bend)]
    raised = [ds.bezier.elevate(p, w) for p, w in plain]
    counts = [1, len(arc), len(ring), 1, 1 + len(bend)]
    chains = ds.Chains.of(counts, [False, False, True, False, False])
    points, weights = (torch.cat([part[i] for part in raised]) for i in (0, 1))
    color = (torch.rand(5, 3, generator=g, dtype=torch.float64) * 255).round() / 255
    return ds.Sketch(points, weights, color=color, chains=chains)


def off(a, b):
    """How far points of each stroke of one sketch lie off that stroke of the other."""
    found = []
    for stroke in range(len(a)):
        other = b[[stroke]].elevate()
        found.append(ds.bezier.closest_point(other.points, other.weights, on(a, stroke)).distance.amin(0).max())
    return max(found).item()


@pytest.mark.parametrize("suffix", BOTH)
@pytest.mark.parametrize(("unit", "millimetres"), [("mm", 1.0), pytest.param("in", 25.4, marks=pytest.mark.slow)])
def test_curves_come_back(tmp_path, suffix, unit, millimetres):
    sketch = sketch_of_all_kinds()
    ds.save(tmp_path / f"a{suffix}", sketch, unit=unit)
    back = ds.load(tmp_path / f"a{suffix}")
    assert len(back) == 5
    assert back.chains.closed.tolist() == [False, False, True, False, False]
    torch.testing.assert_close(back.color, sketch.color, atol=1e-12, rtol=0)
    scaled = sketch.transform(torch.diag(torch.tensor([millimetres] * 3 + [1.0], dtype=torch.float64)))
    assert off(scaled, back) < 1e-10 * millimetres
    assert off(back, scaled) < 1e-10 * millimetres
    # Free curves keep their control points and weights.
    free = back[[3]]
    torch.testing.assert_close(free.points, scaled[[3]].points, atol=0, rtol=1e-15)
    torch.testing.assert_close(free.weights, sketch[[3]].weights, atol=0, rtol=0)


@needs_ezdxf
def test_entities_of_other_programs(tmp_path):
    import ezdxf

    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 5
    space = document.modelspace()
    document.layers.add("red", color=1)
    space.add_lwpolyline([(0, 0, 1.0), (2, 0, 0.0), (2, 3, 0.0)], format="xyb", dxfattribs={"layer": "red"})
    space.add_circle((1, 2), 3, dxfattribs={"extrusion": (0, 0, -1), "true_color": 0x0000FF})
    block = document.blocks.new("part")
    block.add_line((0, 0), (1, 0))
    space.add_blockref("part", (10, 0), dxfattribs={"xscale": 2.0, "yscale": 2.0})
    space.add_text("no curve")
    document.saveas(tmp_path / "a.dxf")
    with pytest.warns(UserWarning, match=r"a\.dxf: left out of what is drawn: 1 TEXT$"):
        sketch = ds.load(tmp_path / "a.dxf")
    # A half circle and a line of the polyline, the circle, and the line of the block; centimetres.
    assert len(sketch) == 4
    bulge = on(sketch, 0)
    torch.testing.assert_close(
        (bulge - torch.tensor([10.0, 0, 0])).norm(dim=-1), torch.full((len(bulge),), 10.0).double(), atol=1e-10, rtol=0
    )
    circle = on(sketch, 2)
    radius = (circle - torch.tensor([-10.0, 20.0, 0])).norm(dim=-1)
    torch.testing.assert_close(radius, torch.full_like(radius, 30.0), atol=1e-10, rtol=0)
    assert on(sketch, 3)[[0, -1]].tolist() == [[100, 0, 0], [120, 0, 0]]
    assert sketch.color.tolist() == [[1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 0]]


@needs_rhino
def test_curves_of_other_programs(tmp_path):
    import rhino3dm

    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    model.Objects.AddLine(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 2, 3))
    model.Objects.AddCircle(rhino3dm.Circle(rhino3dm.Point3d(1, 0, 0), 2.0))
    model.Objects.AddPoint(1, 2, 3)
    model.Write(str(tmp_path / "a.3dm"), 7)
    with pytest.warns(UserWarning, match=r"a\.3dm: left out of what is drawn: 1 Point$"):
        sketch = ds.load(tmp_path / "a.3dm")
    assert len(sketch) == 2
    assert on(sketch, 0)[[0, -1]].tolist() == [[0, 0, 0], [1000, 2000, 3000]]
    radius = (on(sketch, 1) - torch.tensor([1000.0, 0, 0])).norm(dim=-1)
    torch.testing.assert_close(radius, torch.full_like(radius, 2000.0), atol=1e-9, rtol=0)
    assert sketch.chains.closed.tolist() == [False, True]


@needs_rhino
def test_a_higher_degree_is_an_error_that_names_the_curve(tmp_path):
    import rhino3dm

    model = rhino3dm.File3dm()
    points = [rhino3dm.Point3d(i, i * i % 5, 0) for i in range(6)]
    model.Objects.AddCurve(rhino3dm.NurbsCurve.Create(False, 5, points))
    model.Write(str(tmp_path / "a.3dm"), 7)
    with pytest.raises(
        ValueError, match=r"a.3dm: curve 0: of degree 5, and only up to 3 is read: rebuild it as a cubic"
    ):
        ds.load(tmp_path / "a.3dm")


@pytest.mark.parametrize("suffix", BOTH)
@pytest.mark.parametrize("content", [b"", b"solid cube", b"\0" * 1000])
def test_other_files_are_refused(tmp_path, suffix, content):
    (tmp_path / f"a{suffix}").write_bytes(content)
    with pytest.raises(ValueError, match=f"a{suffix}: "):
        ds.load(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", BOTH)
def test_missing_extra_says_how_to_install(tmp_path, suffix, monkeypatch):
    (tmp_path / f"a{suffix}").write_bytes(b"")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'diff3ds\[cad\]'"):
        ds.load(tmp_path / f"a{suffix}")


def test_widths_are_the_defaults(tmp_path):
    pytest.importorskip("ezdxf")
    ds.save(tmp_path / "a.dxf", dataclasses.replace(sketch_of_all_kinds(), width=torch.full((5,), 0.5).double()))
    assert ds.load(tmp_path / "a.dxf").width.tolist() == [0.006] * 5
