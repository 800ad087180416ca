"""Scripts for Blender: what they build, read by SciPy, and by Blender itself where there is one."""

import ast
import importlib.util
import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import torch
from scipy.interpolate import BSpline

from diff3ds import Chains, Sketch, bezier, save
from diff3ds.bezier import evaluate
from diff3ds.formats.scenes.blender import FRAMES

CHECK = """
import bpy, json
found = {}
for made in bpy.data.objects:
    if made.type == "CURVE":
        made.data.bevel_depth = 0
        mesh = made.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        found[made.name] = [list(v.co) for v in mesh.vertices]
materials = sum(m.name.startswith("stroke") for m in bpy.data.materials)
names = sorted(c.name for c in bpy.data.collections), materials, bpy.context.scene.camera.name
print("FOUND " + json.dumps([found, names]))
"""


def sketch() -> Sketch:
    """A closed chain of a circle, rational cubics, and translucent lines that taper."""
    points, weights = bezier.circle((0.0, 0.0, 0.2), 0.8)
    ring = Sketch(points.float(), weights.float(), width=0.02, chains=Chains.of([len(points)], True))
    generator = torch.Generator().manual_seed(0)
    bent = Sketch(
        torch.rand(3, 4, 3, generator=generator) - 0.5,
        0.4 + torch.rand(3, 4, generator=generator),
        width=0.01,
        color=(0.8, 0.1, 0.1),
    )
    lines = Sketch(
        torch.rand(2, 2, 3, generator=generator) - 0.5,
        width=torch.tensor([[0.02, 0.0], [0.01, 0.03]]),
        color=(0.1, 0.1, 0.8),
        opacity=0.5,
    )
    return Sketch.concatenate([ring, bent, lines])


def along(whole: Sketch, stroke: int, count: int) -> np.ndarray:
    """Points of a stroke, and the full widths there."""
    chains = whole.chains
    assert chains is not None
    rows = slice(int(chains.first[stroke]), int(chains.first[stroke + 1]))
    return evaluate(whole.points[rows].double(), whole.weights[rows].double(), torch.linspace(0, 1, count)).numpy()


def scene_of(path) -> dict:
    text = path.read_text()
    ast.parse(text)
    found = re.search(r'json\.loads\(r"""(.*?)"""\)', text)
    assert found is not None
    return json.loads(found[1])


def test_the_numbers_are_the_sketch(tmp_path) -> None:
    whole = sketch()
    save(tmp_path / "scene.py", whole)
    scene = scene_of(tmp_path / "scene.py")
    assert len(scene["strokes"]) == len(whole)
    assert scene["frames"] == FRAMES
    for n, stroke in enumerate(scene["strokes"]):
        points = np.array(stroke["points"])
        # As Blender evaluates a spline of order 4 with Bezier ends: knots of multiplicity 3.
        segments = (len(points) - 1) // 3
        knots = np.repeat(np.arange(segments + 1.0), [4, *[3] * (segments - 1), 4])
        homogeneous = np.concatenate([points[:, :3] * points[:, 3:], points[:, 3:]], 1)
        curve = BSpline(knots, homogeneous, 3)
        expected = along(whole, n, 9)
        at = np.linspace(0, 1, 9) + np.arange(segments)[:, None]
        got = curve(np.minimum(at, segments))
        np.testing.assert_allclose(got[..., :3] / got[..., 3:], expected, atol=1e-12)
        assert stroke["color"] == pytest.approx([*whole.color[n].tolist(), float(whole.opacity[n])])
    taper = scene["strokes"][-2]["radii"]
    # Straight from its thick end to nothing.
    assert np.allclose(np.diff(taper), taper[-1] / 3 - taper[0] / 3)
    assert taper[-1] == 0
    assert taper[0] > 0


def test_world_widths_are_diameters(tmp_path) -> None:
    save(tmp_path / "scene.py", Sketch(torch.rand(1, 4, 3), width=0.25, width_space="world"))
    assert scene_of(tmp_path / "scene.py")["strokes"][0]["radii"] == [0.125] * 4


def test_a_sketch_that_has_become_invalid_leaves_the_old_file(tmp_path) -> None:
    whole = sketch()
    (tmp_path / "scene.py").write_text("old")
    whole.opacity.data[1] = 3.0
    with pytest.raises(ValueError, match="opacity of stroke 1"):
        save(tmp_path / "scene.py", whole)
    assert (tmp_path / "scene.py").read_text() == "old"


def test_blender_builds_the_curves(tmp_path) -> None:
    blender = shutil.which("blender")
    if not blender and not importlib.util.find_spec("bpy"):
        pytest.skip("no Blender: neither `blender` on the PATH nor bpy")
    whole = sketch()
    path = tmp_path / "scene.py"
    save(path, whole)
    path.write_text(path.read_text() + CHECK)
    command = [blender, "-b", "--factory-startup", "--python"] if blender else [sys.executable]
    done = subprocess.run([*command, str(path)], capture_output=True, text=True, check=True)
    line = next(line for line in done.stdout.splitlines() if line.startswith("FOUND "))
    found, (collections, materials, camera) = json.loads(line.removeprefix("FOUND "))
    assert len(found) == len(whole)
    assert (collections[:3], materials, camera) == (["#000000", "#1a1acc", "#cc1a1a"], 3, "camera")
    for n in range(len(whole)):
        vertices, exact = np.array(found[f"stroke {n}"]), along(whole, n, 4001).reshape(-1, 3)
        away = np.sqrt(((vertices[:, None] - exact[None]) ** 2).sum(-1)).min(1)
        # Half a step of the sampled curve.
        assert away.max() < 5e-4
        np.testing.assert_allclose(vertices[[0, -1]], exact[[0, -1]], atol=1e-6)
