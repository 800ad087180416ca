"""USD: curves there and back, what other programs see, validity, and broken files."""

import dataclasses
import importlib.util

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.bezier import evaluate

needs_usd = pytest.mark.skipif(importlib.util.find_spec("pxr") is None, reason="the extra usd is not installed")
pytestmark = pytest.mark.usefixtures("read_here")


def sketch(space="world", along=True, **others):
    """Six free strokes of one segment, float32, as files have them."""
    g = torch.Generator().manual_seed(0)
    width = torch.rand(*((6, 4) if along else (6,)), generator=g)
    looks = {"color": torch.rand(6, 3, generator=g), "opacity": torch.rand(6, generator=g)}
    weights = 0.1 + torch.rand(6, 4, generator=g)
    return ds.Sketch(torch.randn(6, 4, 3, generator=g), weights, width=width, width_space=space, **looks, **others)


def ring():
    points, weights = ds.bezier.circle((1.0, 2.0, 3.0), 5.0, (1.0, 1.0, 0.0), dtype=torch.float32)
    return ds.Sketch(points, weights, width=0.02, chains=ds.Chains.of([len(points)], True))


@needs_usd
@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
@pytest.mark.parametrize(("space", "along"), [("world", True), ("image", False)])
def test_everything_comes_back_bit_for_bit(tmp_path, suffix, space, along):
    expected = sketch(space, along)
    ds.save(tmp_path / f"a{suffix}", expected)
    back = ds.load(tmp_path / f"a{suffix}")
    assert back.width_space == space
    for name, value in expected.tensors().items():
        assert torch.equal(getattr(back, name).float(), value), name


@needs_usd
def test_a_closed_stroke_comes_back_closed(tmp_path):
    ds.save(tmp_path / "a.usdc", ring(), unit="mm")
    back = ds.load(tmp_path / "a.usdc")
    assert back.chains.closed.tolist() == [True]
    assert back.width.tolist() == pytest.approx([0.02])
    # The file says that a unit is a millimetre, and what is read is in metres.
    points = evaluate(back.points, back.weights, torch.linspace(0, 1, 7, dtype=torch.float64)) * 1000
    radius = (points - torch.tensor([1.0, 2.0, 3.0]).double()).norm(dim=-1)
    torch.testing.assert_close(radius, torch.full_like(radius, 5.0), atol=1e-5, rtol=0)


@needs_usd
def test_programs_see_exact_curves_and_polylines_for_viewers(tmp_path):
    from pxr import Usd, UsdGeom

    ds.save(tmp_path / "a.usda", ring(), unit="cm")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == pytest.approx(0.01)
    assert stage.GetDefaultPrim().GetPath() == "/sketch"
    curve = UsdGeom.NurbsCurves(stage.GetPrimAtPath("/sketch/strokes/stroke_0"))
    assert curve.GetPurposeAttr().Get() == "render"
    assert list(curve.GetOrderAttr().Get()) == [3]
    assert len(curve.GetKnotsAttr().Get()) == curve.GetCurveVertexCountsAttr().Get()[0] + 3
    lines = UsdGeom.BasisCurves(stage.GetPrimAtPath("/sketch/polylines"))
    assert (lines.GetPurposeAttr().Get(), lines.GetTypeAttr().Get()) == ("proxy", "linear")
    vertices = np.array(lines.GetPointsAttr().Get())
    assert len(vertices) == lines.GetCurveVertexCountsAttr().Get()[0]
    np.testing.assert_allclose(np.linalg.norm(vertices - [1, 2, 3], axis=1), 5, atol=1e-5)
    np.testing.assert_allclose(vertices[0], vertices[-1])
    for prim in (curve, lines):
        low, high = np.array(prim.GetExtentAttr().Get())
        assert (vertices >= low).all()
        assert (vertices <= high).all()


@needs_usd
def test_files_are_valid(tmp_path):
    from pxr import Usd, UsdValidation

    ds.save(tmp_path / "a.usda", sketch())
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert validators
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetMessage() for error in errors] == []


@needs_usd
def test_places_of_prims_count_and_curves_of_one_prim_are_strokes(tmp_path):
    (tmp_path / "a.usda").write_text(
        """#usda 1.0
(metersPerUnit = 1
 upAxis = "Z")
def Xform "a" {
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def NurbsCurves "b" {
        int[] curveVertexCounts = [2, 3]
        int[] order = [2, 3]
        double[] knots = [0, 0, 1, 1, 0, 0, 0, 1, 1, 1]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1)]
        color3f[] primvars:displayColor = [(0.5, 0, 1)]
    }
}
"""
    )
    back = ds.load(tmp_path / "a.usda")
    assert len(back) == 2
    assert back.points[:, 0].tolist() == [[10, 0, 0], [10, 0, 1]]
    assert back.points[:, -1].tolist() == [[11, 0, 0], [11, 1, 1]]
    assert back.color.tolist() == [[0.5, 0, 1]] * 2
    assert back.width.tolist() == [0.006] * 2


@needs_usd
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("#usda 1.0", "#usda 1.x", "usd-core cannot read this USD file"),
        ("[4]", "[5]", "do not fit together"),
        ("int[] order = [4]", "int[] order = [9]", "there must be 13 knots, got 8"),
        ("int[] order = [4]", "int[] order = [0]", "there must be 4 knots, got 8"),
        ('def Xform "sketch"', 'def Xform "sketch" (references = @other.usda@)', "refers to others"),
        ('"strokes"', '"strokes" (active = false)', "no curves in this USD file"),
    ],
)
def test_broken_files_give_an_error(tmp_path, old, new, message):
    ds.save(tmp_path / "a.usda", sketch()[[0]])
    text = (tmp_path / "a.usda").read_text()
    assert old in text
    (tmp_path / "a.usda").write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=message) as error:
        ds.load(tmp_path / "a.usda")
    assert "a.usda" in str(error.value)


def test_missing_extra_says_how_to_install_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'diff3ds\[usd\]'"):
        ds.save(tmp_path / "a.usda", sketch())
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "a.usda").write_text("#usda 1.0\n")
    with pytest.raises(ImportError, match=r"pip install 'diff3ds\[usd\]'"):
        ds.load(tmp_path / "a.usda")


def test_no_strokes_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="a USD file needs at least one stroke, got none"):
        ds.save(tmp_path / "a.usda", dataclasses.replace(ring())[[]])
    assert list(tmp_path.iterdir()) == []
