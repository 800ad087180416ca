"""STEP: exact curves there and back through OCCT, and what the files say."""

import dataclasses
import importlib.util
import math
import re

import pytest
import torch

import diff3ds as ds
from diff3ds.bezier import evaluate
from diff3ds.formats.cad import step_entities

needs_occt = pytest.mark.skipif(importlib.util.find_spec("OCP") is None, reason="the extra cad is not installed")
pytestmark = pytest.mark.usefixtures("read_here")


def uniform(generator, *shape):
    return torch.rand(*shape, generator=generator, dtype=torch.float64)


def entities(path):
    """Number and text of every entity; fails unless each appears once."""
    found = re.findall(r"^#(\d+)=(.*?);$", path.read_text(), re.DOTALL | re.MULTILINE)
    assert len({number for number, _ in found}) == len(found)
    return dict(found)


@needs_occt
def test_rational_cubics_come_back_exactly(tmp_path, generator):
    weights = 10 ** (4 * uniform(generator, 56, 4) - 2)
    sketch = ds.Sketch(uniform(generator, 56, 4, 3) * 2 - 1, weights, color=uniform(generator, 56, 3))
    ds.save(tmp_path / "a.step", sketch)
    back = ds.load(tmp_path / "a.step")
    assert torch.equal(back.points, sketch.points)
    assert torch.equal(back.weights, sketch.weights)
    assert torch.equal(back.color, sketch.color)


@needs_occt
def test_strokes_of_several_segments_come_back(tmp_path, generator):
    chains = ds.Chains.of([3, 1, 4], [False, False, True])
    points = chains.joined(uniform(generator, 8, 4, 3) * 2 - 1)
    weights = 0.5 + uniform(generator, 8, 4)
    sketch = ds.Sketch(points, weights, color=uniform(generator, 3, 3), chains=chains)
    ds.save(tmp_path / "a.step", sketch)
    assert (tmp_path / "a.step").read_text().count("TRIMMED_CURVE") == 3
    back = ds.load(tmp_path / "a.step")
    assert back.chains.counts.tolist() == [3, 1, 4]
    assert back.chains.closed.tolist() == [False, False, True]
    assert torch.equal(back.points, sketch.points)
    # Over the joints weights go on: those of a segment are scaled by one number, which moves no point.
    ratio = back.weights / weights
    torch.testing.assert_close(ratio, ratio[:, :1].expand_as(ratio), atol=0, rtol=1e-12)
    assert torch.equal(back.color, sketch.color)


@needs_occt
def test_a_whole_circle_is_one_closed_stroke(tmp_path):
    points, weights = ds.bezier.circle((1.0, 2.0, 3.0), 5.0)
    ds.save(tmp_path / "a.step", ds.Sketch(points, weights, chains=ds.Chains.of([4], True)))
    back = ds.load(tmp_path / "a.step")
    assert back.chains.closed.tolist() == [True]
    assert kinds(tmp_path / "a.step") == ["CIRCLE"]
    places = evaluate(back.points, back.weights, torch.linspace(0, 1, 7, dtype=torch.float64))
    radius = (places - torch.tensor([1.0, 2.0, 3.0]).double()).norm(dim=-1)
    torch.testing.assert_close(radius, torch.full_like(radius, 5.0), atol=1e-9, rtol=0)


@needs_occt
def test_lower_degrees_and_float32_come_back_exactly(tmp_path, generator):
    points = (uniform(generator, 9, 3, 3) * 2 - 1).float()
    # Hyperbolas, which are B-splines here.
    weights = (torch.tensor([0.5, 1.5, 0.5]).double() + 0.5 * uniform(generator, 9, 3)).float()
    sketch = ds.Sketch(points, weights)
    ds.save(tmp_path / "a.stp", sketch)
    back = ds.load(tmp_path / "a.stp")
    assert torch.equal(back.points.float(), sketch.points)
    assert torch.equal(back.weights.float(), sketch.weights)
    lines = ds.Sketch(points[:, :2])
    ds.save(tmp_path / "a.stp", lines)
    back = ds.load(tmp_path / "a.stp")
    assert torch.equal(back.points.float(), lines.points)


def kinds(path):
    """The kind of curve of each stroke; of a composite one those of its parts."""
    found = entities(path)
    [curves] = [re.findall(r"#(\d+)", t)[0:] for t in found.values() if t.startswith("GEOMETRIC_CURVE_SET")]

    def kind(number):
        name, references = re.split(r"\(", found[number])[0], re.findall(r"#(\d+)", found[number])
        if name == "COMPOSITE_CURVE":
            return [kind(r) for r in references]
        if name in ("COMPOSITE_CURVE_SEGMENT", "TRIMMED_CURVE"):
            return kind(references[0])
        return name or "B_SPLINE"

    return [kind(number) for number in curves]


def mixed_sketch():
    """Whole and half a circle, a whole ellipse, a line, a triangle, a free curve, and all of these in one stroke."""

    def cubic(points, weights=None, closed=False):
        return ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], closed)).elevate()

    g = torch.Generator().manual_seed(0)
    triangle = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 1]], dtype=torch.float64)
    free = torch.rand(1, 4, 3, generator=g, dtype=torch.float64)
    weights = 0.5 + torch.rand(1, 4, generator=g, dtype=torch.float64)
    bend, w = ds.bezier.circle((0.0, 0.0, 0.0), 2.0, normal=(0.0, 1.0, 1.0), start=20.0, stop=130.0)
    free[0, 0] = bend[-1, -1]
    way = torch.stack([bend[0, 0] + torch.tensor([0.0, 1.0, 2.0]).double(), bend[0, 0]])[None]
    way, bend = cubic(way), cubic(bend, w)
    parts = [
        cubic(*ds.bezier.circle((1.0, 2.0, 3.0), 5.0, normal=(1.0, 1.0, 0.0)), True),
        cubic(*ds.bezier.circle((1.0, 2.0, 3.0), 4.0, normal=(1.0, 2.0, 0.0), start=-30.0, stop=150.0)),
        cubic(*ds.bezier.ellipse((0.0, 0.0, 1.0), (3.0, 0.0, 0.0), (0.0, 1.0, 0.0)), True),
        cubic(torch.tensor([[[0.0, 0, 0], [1, 2, 3]]], dtype=torch.float64)),
        cubic(torch.stack([triangle, triangle.roll(-1, 0)], 1), None, True),
        cubic(free, weights),
        cubic(torch.cat([way.points, bend.points, free]), torch.cat([way.weights, bend.weights, weights])),
    ]
    sketch = ds.Sketch.concatenate(parts)
    color = torch.rand(7, 3, generator=g, dtype=torch.float64)
    return dataclasses.replace(sketch, color=color, width=torch.arange(7).double() / 64)


def test_strokes_are_lines_circles_and_ellipses_where_they_are(tmp_path):
    ds.save(tmp_path / "a.step", mixed_sketch())
    simple = ["CIRCLE", "CIRCLE", "ELLIPSE", "LINE", ["LINE"] * 3, "B_SPLINE", ["LINE", "CIRCLE", "B_SPLINE"]]
    assert kinds(tmp_path / "a.step") == simple
    text = (tmp_path / "a.step").read_text()
    # All of a closed chain go on; the last of an open one does not.
    assert text.count("DISCONTINUOUS") == 1
    assert (
        sum(t.startswith("PRESENTATION_LAYER_ASSIGNMENT('COLOR_") for t in entities(tmp_path / "a.step").values()) == 7
    )


def off(sketch, back):
    """How far the strokes read lie off those written, and those written off those read; both for strokes alone."""
    t = torch.linspace(0, 1, 9, dtype=torch.float64)

    def farthest(a, b):
        worst = 0.0
        for stroke in range(len(a)):
            one, other = a[[stroke]], b[[stroke]].elevate()
            places = evaluate(one.points, one.weights, t).reshape(-1, 3)
            gap = ds.bezier.closest_point(other.points, other.weights, places).distance
            worst = max(worst, gap.amin(0).max().item())
        return worst

    return max(farthest(sketch, back), farthest(back, sketch))


@needs_occt
@pytest.mark.parametrize(("space", "unit", "size"), [("image", "mm", 1.0), ("world", "in", 25.4)])
def test_lines_and_conics_come_back_as_the_same_curves(tmp_path, space, unit, size):
    sketch = dataclasses.replace(mixed_sketch(), width_space=space)
    ds.save(tmp_path / "a.step", sketch, unit=unit)
    back = ds.load(tmp_path / "a.step")
    assert back.chains.closed.tolist() == sketch.chains.closed.tolist()
    assert torch.equal(back.color, sketch.color)
    assert back.width_space == space
    torch.testing.assert_close(back.width, sketch.width * (size if space == "world" else 1), atol=0, rtol=1e-15)
    assert (
        off(sketch.transform(torch.diag(torch.tensor([size, size, size, 1.0], dtype=torch.float64))), back)
        < 1e-12 * size
    )


@needs_occt
def test_circles_have_their_radius_and_lines_their_ends_in_occt(tmp_path):
    from OCP.BRep import BRep_Tool
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    ds.save(tmp_path / "a.step", mixed_sketch())
    reader = STEPControl_Reader()
    reader.ReadFile(str(tmp_path / "a.step"))
    reader.TransferRoots()
    found = []
    explorer = TopExp_Explorer(reader.OneShape(), TopAbs_EDGE)
    while explorer.More():
        found.append(BRep_Tool.Curve_s(TopoDS.Edge(explorer.Current()), 0.0, 0.0))
        explorer.Next()
    names = [
        "Circle",
        "Circle",
        "Ellipse",
        "Line",
        "Line",
        "Line",
        "Line",
        "BSplineCurve",
        "Line",
        "Circle",
        "BSplineCurve",
    ]
    assert [type(curve).__name__.removeprefix("Geom_") for curve in found] == names
    radii = [found[i].Radius() for i in (0, 1, 9)] + [found[2].MajorRadius(), found[2].MinorRadius()]
    assert radii == pytest.approx([5, 4, 2, 3, 1], abs=1e-9, rel=0)


@needs_occt
def test_float32_chains_stay_whole(tmp_path, generator):
    # A rounded square, whose arcs are round up to float32 only.
    corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
    segments = []
    for i, (x, y) in enumerate(corners):
        bend, w = ds.bezier.circle((x, y, 0.1), 0.3, start=90.0 * i, stop=90.0 * i + 90, dtype=torch.float32)
        segments.append((bend, w))
        nx, ny = corners[(i + 1) % 4]
        after, _ = ds.bezier.circle((nx, ny, 0.1), 0.3, start=90.0 * i + 90, stop=90.0 * i + 180, dtype=torch.float32)
        line = torch.stack([bend[-1, -1] * (1 - k / 2) + after[0, 0] * k / 2 for k in range(3)])
        segments.append((line[None], torch.ones(1, 3)))
    chains = ds.Chains.of([8], True)
    points = chains.joined(torch.cat([s[0] for s in segments]))
    sketch = ds.Sketch(points, torch.cat([s[1] for s in segments]), chains=chains)
    ds.save(tmp_path / "a.step", sketch)
    assert kinds(tmp_path / "a.step") == [["CIRCLE", "LINE"] * 4]
    back = ds.load(tmp_path / "a.step")
    assert back.chains.counts.tolist() == [8]
    assert back.chains.closed.tolist() == [True]
    ends, starts = back.chains.joints
    assert (back.points[ends, -1] - back.points[starts, 0]).abs().max() < 1e-14


def check_random_strokes(path, count, seed):
    """Strokes of all degrees, of one segment and of three: B-splines to the last bit, the others to 1e-12."""
    g = torch.Generator().manual_seed(seed)
    for controls in (2, 3, 4):
        points = uniform(g, count, controls, 3) * 2 - 1
        weights = 10 ** (2 * uniform(g, count, controls) - 1)
        chains = ds.Chains.of([3, 1] * (count // 4) + [1] * (count % 4))
        color = uniform(g, len(chains), 3)
        sketch = ds.Sketch(chains.joined(points), weights, color=color, chains=chains)
        ds.save(path, sketch)
        back = ds.load(path)
        assert torch.equal(back.color, color)
        if controls == 4:
            assert back.chains.counts.tolist() == chains.counts.tolist()
            single = chains.counts[chains.stroke] == 1
            assert torch.equal(back.points, sketch.points)
            assert torch.equal(back.weights[single], weights[single])
        else:
            some = torch.randperm(len(sketch), generator=g)[:100]
            assert off(sketch[some], back[some]) < 1e-12


@pytest.mark.slow
@needs_occt
def test_random_strokes_come_back(tmp_path):
    check_random_strokes(tmp_path / "a.step", 20, 0)


@needs_occt
@pytest.mark.slow
def test_many_random_strokes_come_back(tmp_path):
    check_random_strokes(tmp_path / "a.step", 4_000, 1)


@needs_occt
def test_special_strokes_come_back(tmp_path):
    # A closed one with different end weights, a point, one of equal weights, one of zero width, one of 3e9 and 1e-5.
    g = torch.Generator().manual_seed(1)
    points, weights = uniform(g, 6, 4, 3), 0.5 + uniform(g, 6, 4)
    points[0, 3] = points[0, 0]
    points[1] = points[1, :1]
    weights[2] = 3.0
    points[4] *= 3e9
    points[5] *= 1e-5
    sketch = ds.Sketch(points, weights, width=torch.tensor([0.1, 0.1, 0.1, 0.0, 0.1, 0.1]).double())
    ds.save(tmp_path / "a.step", sketch)
    back = ds.load(tmp_path / "a.step")
    assert torch.equal(back.points, points)
    # Equal weights are no weights.
    weights[2] = 1.0
    assert torch.equal(back.weights, weights)


@needs_occt
def test_name_of_the_file_is_the_name_of_the_product(tmp_path):
    from OCP.STEPControl import STEPControl_Reader

    stem = "it's \\X2\\ a Möbius 漢 sketch"
    ds.save(tmp_path / f"{stem}.step", ds.Sketch(torch.eye(3)[None, :2]))
    assert len(ds.load(tmp_path / f"{stem}.step")) == 1
    reader = STEPControl_Reader()
    reader.ReadFile(str(tmp_path / f"{stem}.step"))
    model = reader.WS().Model()
    named = [model.Entity(i) for i in range(1, model.NbEntities() + 1)]
    [product] = [e for e in named if type(e).__name__ == "StepBasic_Product"]
    assert product.Name().ToCString() == stem
    [curve] = [e for e in named if type(e).__name__ == "StepGeom_TrimmedCurve"]
    assert curve.Name().ToCString() == "stroke 0"


def test_strings_are_escaped():
    assert step_entities.string("it's") == "'it''s'"
    assert step_entities.string("a\\b") == "'a\\\\b'"
    assert (
        step_entities.string("ö漢😀\n")
        == "'\\X4\\000000F6\\X0\\\\X4\\00006F22\\X0\\\\X4\\0001F600\\X0\\\\X4\\0000000A\\X0\\'"
    )


@pytest.mark.parametrize(
    "value", [0.0, -0.0, 1.0, 0.1, 1e22, 1e-7, -5e-324, 1.7976931348623157e308, 123456789.0, 1 / 3]
)
def test_reals_have_a_point_and_keep_their_bits(value):
    written = step_entities.reals([value])
    assert re.fullmatch(r"-?\d+\.\d*(E[+-]?\d+)?", written)
    assert math.copysign(1, float(written)) == math.copysign(1, value)
    assert float(written) == value


@pytest.mark.parametrize("controls", [2, 3, 4])
def test_every_reference_is_defined_and_every_stroke_styled(tmp_path, controls):
    sketch = ds.Sketch(torch.rand(5, controls, 3, generator=torch.Generator().manual_seed(0)), width=0.25)
    ds.save(tmp_path / "a.step", sketch)
    found = entities(tmp_path / "a.step")
    for text in found.values():
        assert set(re.findall(r"#(\d+)", text)) <= set(found)
    curves = re.findall(r"#(\d+)", next(t for t in found.values() if t.startswith("GEOMETRIC_CURVE_SET")))
    styled = [t for t in found.values() if t.startswith("STYLED_ITEM")]
    assert [re.findall(r"#(\d+)", t)[-1] for t in styled] == curves
    assert [found[c].split(",")[0] for c in curves] == [f"TRIMMED_CURVE('stroke {i}'" for i in range(5)]
    assert sum("POSITIVE_LENGTH_MEASURE(0.25)" in t for t in found.values()) == 5


def test_no_strokes_is_an_error_and_no_file(tmp_path):
    with pytest.raises(ValueError, match="at least one stroke"):
        ds.save(tmp_path / "a.step", ds.Sketch(torch.zeros(0, 4, 3)))
    assert list(tmp_path.iterdir()) == []


def test_missing_extra_says_how_to_install(tmp_path, monkeypatch):
    ds.save(tmp_path / "a.step", ds.Sketch(torch.eye(3)[None, :2]))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'diff3ds\[cad\]'"):
        ds.load(tmp_path / "a.step")


@needs_occt
@pytest.mark.parametrize(("far", "unit"), [(0.0, "mm"), (1e7, "mm"), (1e7, "m")])
def test_corners_of_a_closed_stroke_are_single_vertices_of_a_closed_wire(far, unit, tmp_path):
    """Of a slot of two lines and two half circles, which 10,000 km away are known to 2e-6 mm."""
    from OCP.BRep import BRep_Tool
    from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX, TopAbs_WIRE
    from OCP.TopExp import TopExp, TopExp_Explorer

    right, weights = ds.bezier.circle((10.0, 0.0, 0.0), 3.0, start=-90.0, stop=90.0)
    left, _ = ds.bezier.circle((0.0, 0.0, 0.0), 3.0, start=90.0, stop=270.0)
    below, above = (torch.stack(ends)[None] for ends in ((left[-1, -1], right[0, 0]), (right[-1, -1], left[0, 0])))
    raised = [ds.bezier.elevate(*part) for part in ((below, None), (right, weights), (above, None), (left, weights))]
    points, weights = (torch.cat([part[i] for part in raised]) for i in (0, 1))
    turn = torch.linalg.qr(torch.tensor([[1.0, 2, 3], [0, 1, 5], [4, 1, 1]]).double())[0]
    slot = ds.Sketch(points @ turn.T + far, weights, chains=ds.Chains.of([len(points)], True))
    ds.save(tmp_path / "a.step", slot, unit=unit)
    reader = STEPControl_Reader()
    reader.ReadFile(str(tmp_path / "a.step"))
    reader.TransferRoots()
    wires = TopExp_Explorer(reader.OneShape(), TopAbs_WIRE)
    counts = []
    for kind in (TopAbs_EDGE, TopAbs_VERTEX):
        found = ShapeMap()
        TopExp.MapShapes_s(wires.Current(), kind, found)
        counts.append(found.Extent())
    assert counts == [4, 4]
    assert BRep_Tool.IsClosed_s(wires.Current())
