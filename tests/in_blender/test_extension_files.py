"""The extension for Blender as files: its manifest, what it imports, and what its readers take, without Blender."""

import ast
import importlib.util
import json
import math
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
import torch

from diff3ds import Chains, Sketch, bezier, save

FOLDER = Path(__file__).parents[2] / "blender"
# What a script in Blender has, but for what lies beside it.
ALLOWED = {"bpy", "bpy_extras", "functools", "itertools", "json", "math", "mathutils", "pathlib"} | {
    "re", "shutil", "subprocess", "tempfile", "typing",
}  # fmt: skip


@pytest.fixture
def readers(monkeypatch):
    """The modules of the extension that need no Blender."""
    package = ModuleType("lines_extension")
    package.__path__ = [str(FOLDER)]
    monkeypatch.setitem(sys.modules, "lines_extension", package)
    for name in ("strokes", "read_sketch", "read_step"):
        spec = importlib.util.spec_from_file_location(f"lines_extension.{name}", FOLDER / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, spec.name, module)
        spec.loader.exec_module(module)
        setattr(package, name, module)
    return package


def test_the_manifest_is_what_blender_asks_for() -> None:
    """The rules of the manual of Blender's extensions; Blender's own validation runs in the slow tests."""
    manifest = tomllib.loads((FOLDER / "blender_manifest.toml").read_text())
    assert manifest["schema_version"] == "1.0.0"
    assert manifest["type"] == "add-on"
    assert re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", manifest["id"])
    for version in (manifest["version"], manifest["blender_version_min"]):
        assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    for said in (manifest["tagline"], *manifest["permissions"].values()):
        assert 0 < len(said) <= 64
        assert said[-1].isalnum()
    assert set(manifest["permissions"]) <= {"files", "network", "clipboard", "camera", "microphone"}
    assert "GNU GENERAL PUBLIC LICENSE" in (FOLDER / "LICENSE").read_text()[:200]


def test_it_imports_no_code_of_the_package() -> None:
    for path in FOLDER.glob("*.py"):
        text = path.read_text()
        assert text.startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n"), path.name
        for node in ast.walk(ast.parse(text)):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            assert {name.split(".")[0] for name in names} <= ALLOWED, path.name


def sketch() -> Sketch:
    """A closed ring, an arc, a cubic with uneven weights, and a line."""
    ring, weights = bezier.circle((0.1, 0.2, 0.3), 0.8, normal=(0.3, 0.2, 1.0))
    loop = Sketch(ring, weights, width=0.02, chains=Chains.of([len(ring)], True), color=(1.0, 0.5, 0.0))
    arc, arc_weights = bezier.ellipse((0.0, 0.0, 0.0), (0.9, 0.0, 0.0), (0.0, 0.5, 0.3), start=20, stop=300)
    bow = Sketch(arc, arc_weights, chains=Chains.of([len(arc)], False))
    generator = torch.Generator().manual_seed(2)
    wild = Sketch(
        torch.rand(1, 4, 3, generator=generator, dtype=torch.float64),
        1 + torch.rand(1, 4, generator=generator, dtype=torch.float64),
    )
    line = Sketch(torch.tensor([[[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]], dtype=torch.float64))
    return Sketch.concatenate([loop, bow, wild, line]).replace(names=["a/ring", "a/arc", "b", "c"])


def places(cubics, count=9):
    """Points of rational cubics (x, y, z, weight)."""
    control = torch.tensor(cubics, dtype=torch.float64)
    return bezier.evaluate(control[..., :3], control[..., 3], torch.linspace(0, 1, count, dtype=torch.float64))


def check(strokes, whole) -> None:
    """All points of strokes lie on those of a sketch, and the other way round."""
    assert len(strokes) == len(whole)
    for n, stroke in enumerate(strokes):
        one = whole[n : n + 1]
        got, exact = places(stroke.segments), bezier.evaluate(one.points, one.weights, torch.linspace(0, 1, 9).double())
        control = torch.tensor(stroke.segments, dtype=torch.float64)
        _, _, away = bezier.closest_point(one.points, one.weights, got.reshape(1, -1, 3))
        _, _, back = bezier.closest_point(control[..., :3], control[..., 3], exact.reshape(1, -1, 3))
        assert away.amin(0).max() < 1e-6
        assert back.amin(0).max() < 1e-6
        assert torch.allclose(torch.tensor(stroke.color).double(), one.color[0].double(), atol=1e-6)


def test_it_reads_what_is_written(readers, tmp_path) -> None:
    whole = sketch()
    save(tmp_path / "a.json", whole)
    given = readers.read_sketch.read_sketch(str(tmp_path / "a.json"))
    check(given.strokes, whole)
    assert [stroke.name for stroke in given.strokes] == list(whole.names)
    assert [stroke.closed for stroke in given.strokes] == [True, False, False, False]
    assert given.strokes[0].widths[0] == pytest.approx([0.02] * 4)
    pytest.importorskip("OCP")
    save(tmp_path / "a.step", whole)
    check(readers.read_step.read_step(str(tmp_path / "a.step")).strokes, whole)


HEAD, END = "ISO-10303-21;HEADER;ENDSEC;DATA;", "ENDSEC;END-ISO-10303-21;"


def test_splines_of_other_programs_are_cut_into_cubics(readers, tmp_path) -> None:
    points = [(0.0, 0.0, 0.0), (1.0, 2.0, 0.0), (3.0, 1.0, 1.0), (4.0, 3.0, 0.0), (6.0, 0.0, 2.0), (7.0, 1.0, 1.0)]
    given = "".join(f"#{n + 1}=CARTESIAN_POINT('',({x},{y},{z}));" for n, (x, y, z) in enumerate(points))
    refs = ",".join(f"#{n + 1}" for n in range(6))
    spline = f"#10=B_SPLINE_CURVE_WITH_KNOTS('it''s',3,({refs}),.UNSPECIFIED.,.F.,.F.,(4,1,1,4),(0.,1.,2.5,4.),.U.);"
    other = "#11=PCURVE('',#1,#2);#12=GEOMETRIC_CURVE_SET('',(#10,#11));"
    (tmp_path / "a.stp").write_text(HEAD + given + spline + other + END)
    found = readers.read_step.read_step(str(tmp_path / "a.stp"))
    assert found.left_out == "1 curves of other kinds were left out"
    (stroke,) = found.strokes
    assert (stroke.name, len(stroke.segments)) == ("it's", 3)
    from scipy.interpolate import BSpline

    spline = BSpline([0, 0, 0, 0, 1, 2.5, 4, 4, 4, 4], points, 3)
    for cubic, (start, stop) in zip(places(stroke.segments), ((0, 1), (1, 2.5), (2.5, 4)), strict=True):
        exact = torch.from_numpy(spline([start + (stop - start) * t / 8 for t in range(9)]))
        assert torch.allclose(cubic, exact, atol=1e-12)


@pytest.mark.parametrize(
    ("key", "value", "what"),
    [
        ("version", 3, "version 1 or 2"),
        ("points", [[[0, 0, math.nan], [1, 0, 0]]], "points must be"),
        ("points", [[[0, 0, 0]]], "2, 3 or 4 points"),
        ("weights", [[1.0, -1.0]], "weights must be positive"),
        ("segments", [2], "add up to 1"),
        ("names", [7], "names must be"),
        ("width_space", "page", "width_space"),
    ],
)
def test_bad_sketches_are_refused(readers, tmp_path, key, value, what) -> None:
    data = {"version": 1, "width_space": "image", "points": [[[0, 0, 0], [1, 0, 0]]], "weights": [[1, 1]]}
    data |= {"width": [0.01], "color": [[0, 0, 0]], "opacity": [1], key: value}
    (tmp_path / "a.json").write_text(json.dumps(data))
    with pytest.raises(ValueError, match=what):
        readers.read_sketch.read_sketch(str(tmp_path / "a.json"))


@pytest.mark.parametrize(
    "text",
    [
        "no STEP file",
        HEAD + "#1=GEOMETRIC_CURVE_SET('',(#2));" + END,
        HEAD
        + "#1=GEOMETRIC_CURVE_SET('',(#2));#2=COMPOSITE_CURVE('',(#3),.F.);#3=COMPOSITE_CURVE_SEGMENT(.C.,.T.,#2);",
        HEAD + "#1=GEOMETRIC_CURVE_SET('',(#2));#2=POLYLINE('',(" + "(" * 100 + "));",
    ],
)
def test_broken_step_files_are_refused(readers, tmp_path, text) -> None:
    (tmp_path / "a.step").write_text(text)
    with pytest.raises(ValueError, match=r"STEP|not in the file|too deep|broken"):
        readers.read_step.read_step(str(tmp_path / "a.step"))
