"""STEP files of other programs, and broken ones, some of which make OCCT crash."""

import contextlib
import importlib.util
import math
import random
import re

import pytest
import torch

import diff3ds as ds
from diff3ds.bezier import evaluate
from diff3ds.formats import apart

needs_occt = pytest.mark.skipif(importlib.util.find_spec("OCP") is None, reason="the extra cad is not installed")


# OCCT writes 13 digits.
DIGITS = 1e-11


def occt_edges():
    """Curves of another program, with what tells whether a point (M, 3) lies on each, and with their ends."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge as Edge
    from OCP.collections import Array1_double, Array1_gp_Pnt, Array1_int
    from OCP.Geom import Geom_BezierCurve, Geom_BSplineCurve
    from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Elips, gp_Hypr, gp_Parab, gp_Pnt

    axes = gp_Ax2(gp_Pnt(0, 0, 1), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0))

    def filled(kind, values):
        array = kind(1, len(values))
        for i, value in enumerate(values, 1):
            array.SetValue(i, value)
        return array

    poles = [gp_Pnt(i, i * i % 5, i % 2) for i in range(6)]
    knots, counts = filled(Array1_double, [0.0, 1.0, 2.0, 3.0]), filled(Array1_int, [4, 1, 1, 4])
    spline = Geom_BSplineCurve(
        filled(Array1_gp_Pnt, poles), filled(Array1_double, [1, 2, 0.5, 3, 1, 1.0]), knots, counts, 3
    )
    quintic = Geom_BezierCurve(filled(Array1_gp_Pnt, poles))
    edges = [
        Edge(gp_Pnt(1, 2, 3), gp_Pnt(4, 5, 7)).Edge(),
        Edge(gp_Circ(axes, 2.0)).Edge(),
        Edge(gp_Elips(axes, 3.0, 1.0), 0.5, 2.0).Edge(),
        Edge(gp_Parab(axes, 0.25), -1.0, 2.0).Edge(),
        Edge(gp_Hypr(axes, 2.0, 1.0), -1.0, 1.0).Edge(),
        Edge(spline).Edge(),
        Edge(spline, 0.25, 1.5).Edge(),
        Edge(quintic).Edge(),
    ]
    return edges, spline, quintic


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """Strokes loaded from a file that OCCT wrote, by curve; and OCCT's spline and quintic."""
    if importlib.util.find_spec("OCP") is None:
        pytest.skip("the extra cad is not installed")
    from OCP.BRep import BRep_Builder
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
    from OCP.TopoDS import TopoDS_Compound

    edges, spline, quintic = occt_edges()
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    for edge in edges:
        builder.Add(compound, edge)
    path = tmp_path_factory.mktemp("foreign") / "foreign.step"
    writer = STEPControl_Writer()
    writer.Transfer(compound, STEPControl_AsIs)
    writer.Write(str(path))
    sketch = ds.load(path)
    t = torch.linspace(0, 1, 33, dtype=torch.float64)
    samples = evaluate(sketch.points, sketch.weights, t)
    return samples, spline, quintic


@pytest.mark.usefixtures("read_here")
@needs_occt
def test_composite_curves_may_run_against_their_parts(tmp_path):
    corners = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 2, 0]], dtype=torch.float64)
    chain = ds.Sketch(torch.stack([corners[:-1], corners[1:]], 1), chains=ds.Chains.of([2]))
    ds.save(tmp_path / "a.step", chain)
    text = (tmp_path / "a.step").read_text()
    first, second = re.findall(r"#(\d+)=COMPOSITE_CURVE_SEGMENT", text)
    text = text.replace(f"(#{first},#{second}),.F.", f"(#{second},#{first}),.F.")
    text = re.sub(r"(CURVE_SEGMENT\(\.\w+\.),\.T\.", r"\1,.F.", text)
    (tmp_path / "a.step").write_text(text)
    back = ds.load(tmp_path / "a.step")
    assert back.chains.counts.tolist() == [2]
    torch.testing.assert_close(back.points, chain.points.flip(0, 1), atol=1e-15, rtol=0)


@pytest.mark.usefixtures("read_here")
@needs_occt
def test_edges_of_a_solid_are_strokes_of_their_own(tmp_path):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    writer = STEPControl_Writer()
    writer.Transfer(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape(), STEPControl_AsIs)
    writer.Write(str(tmp_path / "a.step"))
    box = ds.load(tmp_path / "a.step")
    assert len(box) == 12
    lengths = (box.points[:, 1] - box.points[:, 0]).norm(dim=-1)
    assert sorted(lengths.tolist()) == pytest.approx([3.0] * 4 + [4.0] * 4 + [5.0] * 4, rel=1e-12)


@needs_occt
def test_conics_of_other_programs_are_exact(foreign):
    samples, *_ = foreign
    x, y, z = samples.unbind(-1)
    on = {
        "line": (y - x - 1).abs() + (z - 3 - (x - 1) * 4 / 3).abs(),
        "circle": (x**2 + y**2 - 4).abs() + (z - 1).abs(),
        "ellipse": (x**2 / 9 + y**2 - 1).abs() + (z - 1).abs(),
        "parabola": (y**2 - x).abs() + (z - 1).abs(),
        "hyperbola": (x**2 / 4 - y**2 - 1).abs() + (z - 1).abs(),
    }
    which = {name: (error.amax(-1) < DIGITS).nonzero()[:, 0] for name, error in on.items()}
    assert all(len(rows) for rows in which.values())
    length = {name: (samples[rows].diff(dim=1).norm(dim=-1)).sum().item() for name, rows in which.items()}
    ends = {name: samples[rows][:, [0, -1]].reshape(-1, 3) for name, rows in which.items()}
    assert math.isclose(length["line"], math.sqrt(9 + 9 + 16), rel_tol=DIGITS)
    # Chords are 1 - (angle / 32)^2 / 24 times as long as an arc of 120 degrees.
    assert math.isclose(length["circle"], 4 * math.pi, rel_tol=5e-4)
    for name, corner in {
        "ellipse": [3 * math.cos(0.5), math.sin(0.5), 1],
        "parabola": [4, 2, 1],
        "hyperbola": [2 * math.cosh(1), math.sinh(1), 1],
    }.items():
        assert (ends[name] - torch.tensor(corner, dtype=torch.float64)).norm(dim=-1).min() < DIGITS


@needs_occt
def test_splines_are_cut_at_their_knots_and_trimmed(foreign):
    samples, spline, _ = foreign

    def at(u):
        p = spline.Value(u)
        return torch.tensor([p.X(), p.Y(), p.Z()], dtype=torch.float64)

    # Bézier pieces between knots keep the spline's own parametrisation.
    spans = [(0, 1), (1, 2), (2, 3), (0.25, 1), (1, 1.5)]
    for a, b in spans:
        expected = torch.stack([at(a + (b - a) * i / 32) for i in range(33)])
        assert (samples - expected).norm(dim=-1).amax(-1).min() < DIGITS


@needs_occt
def test_higher_degrees_are_approximated_to_the_stated_tolerance(foreign):
    samples, _, quintic = foreign
    exact = torch.tensor(
        [[p.X(), p.Y(), p.Z()] for p in (quintic.Value(i / 4000) for i in range(4001))], dtype=torch.float64
    )
    # The line, 3 + 1 + 1 + 1 arcs of conics (the circle in three), 3 + 2 pieces of the spline; then the quintic.
    mine = samples[12:].reshape(-1, 3)
    size = max((exact[0] - p).norm().item() for p in torch.tensor([[i, i * i % 5, i % 2] for i in range(6)]).double())
    distance = torch.cdist(mine, exact)
    # Samples of the exact curve are .003 apart, those of the approximation a few hundredths.
    assert distance.amin(1).max() < 1e-4 * size + 0.002
    assert distance.amin(0).max() < 0.1


GOOD = ds.Sketch(torch.rand(3, 4, 3, generator=torch.Generator().manual_seed(0)), torch.full((3, 4), 0.5))


def damaged(path, old, new):
    ds.save(path, GOOD)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


@needs_occt
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        # The first three make OCCT 8.0 call itself without end, or read past an array, and die.
        ("GEOMETRIC_CURVE_SET('a',(#25", "GEOMETRIC_CURVE_SET('a',(#17", "OCCT failed on this STEP file"),
        pytest.param(
            "TRIMMED_CURVE('stroke 0',#24",
            "TRIMMED_CURVE('stroke 0',#25",
            "OCCT failed on this STEP file",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "RATIONAL_B_SPLINE_CURVE((0.5,",
            "RATIONAL_B_SPLINE_CURVE((0.5),(",
            "OCCT failed on this STEP file",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "#20=CARTESIAN_POINT('',(0.",
            "#20=CARTESIAN_POINT('',(1.E400,0.",
            "points of stroke 0 must be finite",
            marks=pytest.mark.slow,
        ),
        pytest.param("'a',(#17),#14", "'a',(#16),#14", "no curves in this STEP file", marks=pytest.mark.slow),
        pytest.param("DATA;", "ATAD;", "OCCT", marks=pytest.mark.slow),
    ],
)
def test_files_that_break_occt_give_an_error(tmp_path, old, new, message):
    path = damaged(tmp_path / "a.step", old, new)
    with pytest.raises(ValueError, match=message) as error:
        ds.load(path)
    assert "a.step" in str(error.value)


@needs_occt
def test_a_reader_that_hangs_is_stopped(tmp_path, monkeypatch):
    ds.save(tmp_path / "a.step", GOOD)
    monkeypatch.setattr(apart, "SECONDS", 0.001)
    with pytest.raises(ValueError, match="OCCT has not read this STEP file in 0 s"):
        ds.load(tmp_path / "a.step")


@pytest.mark.slow
@needs_occt
def test_damaged_files_give_a_sketch_or_a_value_error(tmp_path):
    ds.save(tmp_path / "a.step", GOOD)
    good = (tmp_path / "a.step").read_bytes()
    rng = random.Random(0)
    for _ in range(3):
        content = bytearray(good)
        for _ in range(20):
            content[rng.randrange(300, len(content) - 20)] = rng.choice(b"#(),;.$*0E'")
        (tmp_path / "a.step").write_bytes(content)
        with contextlib.suppress(ValueError):
            ds.load(tmp_path / "a.step").check_values()


def test_cut_off_and_other_files_are_refused(tmp_path):
    ds.save(tmp_path / "a.step", GOOD)
    good = (tmp_path / "a.step").read_bytes()
    for content, message in [
        (good[: len(good) // 2], "cut off"),
        (good[:-30], "cut off"),
        (b"", "must begin with ISO-10303-21"),
        (b"solid cube", "must begin with ISO-10303-21"),
    ]:
        (tmp_path / "a.step").write_bytes(content)
        with pytest.raises(ValueError, match=message):
            ds.load(tmp_path / "a.step")


def test_giant_files_are_refused_unread(tmp_path, monkeypatch):
    ds.save(tmp_path / "a.step", GOOD)
    monkeypatch.setattr(apart, "MAX_BYTES", 100)
    with pytest.raises(ValueError, match="more than the 100 that are read"):
        ds.load(tmp_path / "a.step")


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        ds.load(tmp_path / "none.step")
