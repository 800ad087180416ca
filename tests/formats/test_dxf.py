"""DXF, read back by ezdxf: what kinds of curves there are, and where their points lie."""

import math

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.formats.cad.curve_kinds import Arc, Line, Spline, curves_of

pytestmark = needs("ezdxf")


def read(path):
    """The entities of a file that ezdxf's audit finds nothing wrong with."""
    import ezdxf

    document = ezdxf.readfile(path)
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    return document, list(document.modelspace())


def circle(radius=2.0, dtype=torch.float64, **where):
    points, weights = ds.bezier.circle((1.0, 2.0, 3.0), radius, normal=(0.3, -0.5, 1.0), dtype=dtype, **where)
    closed = not where
    return ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], closed))


def ellipse(**where):
    u, v = (2.0, 0.5, 1.0), (-0.3, 1.0, 0.2)
    points, weights = ds.bezier.ellipse((1.0, 2.0, 3.0), u, v, **where)
    return ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], not where))


def distances(sketch, vertices) -> float:
    """How far points lie from the sketch at most."""
    queries = torch.tensor(np.array([tuple(v) for v in vertices]), dtype=torch.float64)
    points = sketch.points.double()
    found = [
        ds.bezier.closest_point(points[i], sketch.weights[i].double(), queries).distance for i in range(len(points))
    ]
    return float(torch.stack(found).amin(0).max())


@pytest.mark.parametrize(
    ("sketch", "kind"),
    [
        (ds.Sketch(torch.tensor([[[0.0, 0, 0], [1, 2, 3]]], dtype=torch.float64)), "LINE"),
        # A cubic that runs along a line is one.
        (ds.Sketch(torch.tensor([[[0.0, 0, 0], [1, 2, 3], [2, 4, 6], [3, 6, 9]]], dtype=torch.float64)), "LINE"),
        (circle(), "CIRCLE"),
        (circle().elevate(3), "CIRCLE"),
        (circle(dtype=torch.float32), "CIRCLE"),
        (circle(start=20, stop=75), "ARC"),
        (circle(start=75, stop=-140), "ARC"),
        (ellipse(), "ELLIPSE"),
        (ellipse(start=-30, stop=100), "ELLIPSE"),
        (ds.Sketch(ds.bezier.parabola((0.0, 0, 0), (1.0, 0, 0), (0.0, 1, 0), -1, 2)[0]), "SPLINE"),
    ],
)
def test_curves_come_back_as_what_they_are(sketch, kind, tmp_path):
    ds.save(tmp_path / "a.dxf", sketch)
    _, (entity,) = read(tmp_path / "a.dxf")
    assert entity.dxftype() == kind
    single = sketch.points.dtype == torch.float32
    if kind in ("CIRCLE", "ARC"):
        assert entity.dxf.radius == pytest.approx(2, abs=2e-6 if single else 1e-12)
    vertices = sampled(entity)
    assert distances(sketch, vertices) < (2e-6 if single else 1e-9)
    length = np.linalg.norm(np.diff(vertices, axis=0), axis=1).sum()
    exact = float(ds.bezier.length(sketch.points.double(), sketch.weights.double()).sum())
    # Chords of 1/2000 of the curve each.
    assert length == pytest.approx(exact, rel=1e-5)


def sampled(entity) -> np.ndarray:
    """Points from the start of an entity to its end, as ezdxf computes them."""
    s = np.linspace(0, 1, 2001)
    kind = entity.dxftype()
    if kind == "LINE":
        return np.array([tuple(entity.dxf.start.lerp(entity.dxf.end, t)) for t in s])
    if kind == "SPLINE":
        return np.array([tuple(v) for v in entity.construction_tool().points(s * entity.knots[-1])])
    if kind == "CIRCLE":
        return np.array([tuple(v) for v in entity.vertices(s * 360)])
    start, stop = (
        (entity.dxf.start_param, entity.dxf.end_param)
        if kind == "ELLIPSE"
        else (entity.dxf.start_angle, entity.dxf.end_angle)
    )
    turn = 2 * math.pi if kind == "ELLIPSE" else 360
    span = (stop - start) % turn or turn
    return np.array([tuple(v) for v in entity.vertices(start + s * span)])


def test_control_points_and_weights_of_splines_are_exact(tmp_path, generator):
    points = torch.rand(20, 4, 3, generator=generator, dtype=torch.float64) * 200 - 100
    weights = 0.2 + torch.rand(20, 4, generator=generator, dtype=torch.float64)
    ds.save(tmp_path / "a.dxf", ds.Sketch(points, weights))
    _, entities = read(tmp_path / "a.dxf")
    for stroke, entity in enumerate(entities):
        assert (np.array(entity.control_points) == points[stroke].numpy()).all()
        assert (np.array(entity.weights) == weights[stroke].numpy()).all()
        assert entity.dxf.degree == 3
        assert list(entity.knots) == [0, 0, 0, 0, 1, 1, 1, 1]


def test_layers_units_and_numbers_of_strokes(tmp_path):
    color = torch.tensor([[1.0, 0, 0], [0, 0, 0.5], [1.0, 0, 0]])
    points = torch.arange(18.0).reshape(3, 2, 3) + torch.eye(3)[:2]
    ds.save(tmp_path / "ü b.dxf", ds.Sketch(points, color=color), unit="in")
    document, entities = read(tmp_path / "ü b.dxf")
    assert document.header["$INSUNITS"] == 1
    assert [e.dxf.layer for e in entities] == ["COLOR_FF0000", "COLOR_000080", "COLOR_FF0000"]
    assert document.layers.get("COLOR_000080").rgb == (0, 0, 128)
    assert [e.get_xdata("DIFF3DS")[-1].value for e in entities] == [0, 1, 2]


@pytest.mark.parametrize("closed", [False, True])
def test_polylines_stay_near_the_curve(closed, tmp_path):
    sketch = circle() if closed else circle(start=0, stop=250)
    ds.formats.save_dxf(tmp_path / "a.dxf", sketch, polylines=True)
    _, (entity,) = read(tmp_path / "a.dxf")
    assert entity.dxftype() == "POLYLINE"
    assert entity.is_closed is closed
    corners = np.array([tuple(v.dxf.location) for v in entity.vertices])
    corners = np.concatenate([corners, corners[:1]]) if closed else corners
    middles = (corners[1:] + corners[:-1]) / 2
    assert 0 < distances(sketch, middles) < 2e-4 * 2
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()
    assert length == pytest.approx(2 * math.radians(360 if closed else 250), rel=1e-3)


def test_a_stroke_of_a_line_an_arc_and_a_free_curve(generator):
    """A line, a quarter circle in two parts, and two cubics: three curves in this order."""
    arc, weights = ds.bezier.circle((0.0, 0, 0), 1.0, start=-90, stop=60)
    free = torch.rand(2, 4, 3, generator=generator, dtype=torch.float64)
    raised = ds.Sketch(arc, weights).elevate(3)
    line = ds.Sketch(torch.stack([torch.tensor([-2.0, -1, 0]).double(), raised.points[0, 0]])[None]).elevate(3)
    points = torch.cat([line.points, raised.points, free])
    chains = ds.Chains.of([len(points)])
    sketch = ds.Sketch(
        chains.joined(points), torch.cat([line.weights, raised.weights, 1 + free[..., 0]]), chains=chains
    )
    ((first, second, third),) = curves_of(sketch)
    assert isinstance(first, Line)
    assert isinstance(second, Arc)
    assert second.circular
    assert second.stop - second.start == pytest.approx(math.radians(150))
    assert isinstance(third, Spline)
    assert len(third.points) == 7


def test_no_strokes_and_no_ezdxf(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="needs at least one stroke"):
        ds.save(tmp_path / "a.dxf", ds.Sketch(torch.zeros(0, 4, 3)))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'diff3ds\[cad\]'"):
        ds.save(tmp_path / "a.dxf", circle())
    assert list(tmp_path.iterdir()) == []
