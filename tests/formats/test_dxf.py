"""DXF, read back by ezdxf: what kinds of curves there are, and where their points lie."""

import math

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.formats.cad.arcs import Arc
from diff3ds.formats.cad.strokes_as_curves import Line, Spline, curves_of

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


def flat_arcs():
    """Level arcs that run counter-clockwise and clockwise, a clockwise ellipse, and a tilted arc; in four colours."""
    level = [
        {"normal": (0.0, 0.0, 1.0), "start": 10, "stop": 80},
        {"normal": (0.0, 0.0, -1.0), "start": 10, "stop": 80},
    ]
    curves = [ds.bezier.circle((5.0, 1.0, 0.0), 2.0, **how) for how in level]
    curves.append(ds.bezier.ellipse((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0, -20.0))
    curves.append(ds.bezier.circle((0.0, 0.0, 0.0), 2.0, (1.0, 0.0, -1.0), 0.0, 60.0))
    points, weights = (torch.cat([curve[i] for curve in curves]) for i in (0, 1))
    color = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, 0.6, 0], [0, 0, 0]]).double()
    return ds.Sketch(points, weights, color=color)


def test_level_arcs_are_seen_from_above(tmp_path):
    """Programs that pass over the extrusion show the same: the points are those in the plane of the numbers."""
    sketch = flat_arcs()
    ds.save(tmp_path / "a.dxf", sketch)
    _, entities = read(tmp_path / "a.dxf")
    assert [e.dxftype() for e in entities] == ["ARC", "ARC", "ELLIPSE", "ARC"]
    for stroke, entity in enumerate(entities[:3]):
        assert tuple(entity.dxf.extrusion) == (0, 0, 1)
        assert distances(sketch[[stroke]], sampled(entity)) < 1e-9
    assert tuple(entities[3].dxf.extrusion) == pytest.approx((0.5**0.5, 0, -(0.5**0.5)))
    assert distances(sketch[[3]], sampled(entities[3])) < 1e-9


def test_colours_of_autocad_stand_beside_true_ones(tmp_path):
    ds.save(tmp_path / "a.dxf", flat_arcs())
    document, _ = read(tmp_path / "a.dxf")
    layers = {layer.dxf.name: (layer.dxf.color, layer.rgb) for layer in document.layers}
    assert layers["COLOR_FF0000"] == (1, (255, 0, 0))
    assert layers["COLOR_0000FF"] == (5, (0, 0, 255))
    # Black is what AutoCAD shows black on white.
    assert layers["COLOR_000000"] == (7, (0, 0, 0))
    # AutoCAD's 92 is rgb(0, 165, 0), 94 is rgb(0, 124, 0).
    assert layers["COLOR_009900"] == (92, (0, 153, 0))
    ds.formats.save_dxf(tmp_path / "b.dxf", flat_arcs(), layers=["a", "a", "b", "b"])
    _, entities = read(tmp_path / "b.dxf")
    assert [entity.dxf.color for entity in entities] == [1, 5, 92, 7]


@pytest.mark.parametrize("version", ["R2010", "R12"])
def test_extents_and_view_are_those_of_what_is_drawn(version, tmp_path):
    """The curves', not their control points': a half circle of radius 2 ends at 2."""
    points, weights = ds.bezier.circle((100.0, 50.0, 7.0), 2.0, start=0.0, stop=180.0)
    ds.formats.save_dxf(tmp_path / "a.dxf", ds.Sketch(points, weights), version=version)
    document, _ = read(tmp_path / "a.dxf")
    assert tuple(document.header["$EXTMIN"]) == pytest.approx((98, 50, 7))
    assert tuple(document.header["$EXTMAX"]) == pytest.approx((102, 52, 7))
    (view,) = document.viewports.get("*Active")
    assert tuple(view.dxf.center)[:2] == pytest.approx((100, 51))
    assert 4 / view.dxf.aspect_ratio < view.dxf.height < 2 * 4 / view.dxf.aspect_ratio


def test_r12_has_plane_polylines_where_strokes_are_level(tmp_path, capfd):
    sketch = flat_arcs()
    ds.formats.save_dxf(tmp_path / "a.dxf", sketch, version="R12", tolerance=1e-3)
    assert "".join(capfd.readouterr()) == ""
    document, entities = read(tmp_path / "a.dxf")
    assert document.dxfversion == "AC1009"
    assert [e.get_mode() for e in entities] == ["AcDb2dPolyline"] * 3 + ["AcDb3dPolyline"]
    assert [document.layers.get(e.dxf.layer).dxf.color for e in entities] == [1, 5, 92, 7]
    for stroke, entity in enumerate(entities):
        corners = np.array([tuple(p) for p in entity.points()])
        assert 1e-5 < distances(sketch[[stroke]], (corners[1:] + corners[:-1]) / 2) < 1e-3
    with pytest.warns(UserWarning, match="says no unit of length"):
        assert len(ds.load(tmp_path / "a.dxf")) == 4


def test_wrong_versions_and_tolerances_leave_nothing(tmp_path):
    save = getattr(ds.formats.save_dxf, "__wrapped__", ds.formats.save_dxf)
    wrong = [
        ({"version": "R11"}, "version must be one of R2010, R12, got 'R11'"),
        ({"version": "R12", "tolerance": 0.0}, "tolerance of polylines must be positive, got 0"),
        ({"tolerance": -1.0}, "tolerance must be at least 0 and finite, got -1"),
    ]
    for given, said in wrong:
        with pytest.raises(ValueError, match=said):
            save(tmp_path / "a.dxf", circle(), **given)
    assert list(tmp_path.iterdir()) == []
