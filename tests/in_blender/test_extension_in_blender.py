"""The extension for Blender in Blender: its operators run without a window, and Blender's own check takes it."""

import json
import shutil
import sys
from pathlib import Path

import pytest
import torch

from diff3ds import Chains, Sketch, bezier, save

pytestmark = pytest.mark.slow
INSIDE = Path(__file__).with_name("inside")
FOLDER = Path(__file__).parents[2] / "blender"


def test_files_are_imported_and_meshes_drawn(blender, tmp_path) -> None:
    """A ring and a line from both kinds of file; then a cube, a cylinder and a torus by the command diff3ds."""
    ring, weights = bezier.circle((0.0, 0.0, 0.0), 0.8)
    loop = Sketch(ring, weights, chains=Chains.of([len(ring)], True))
    line = Sketch(torch.tensor([[[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]], dtype=torch.float64))
    whole = Sketch.concatenate([loop, line]).replace(names=["lamp/ring", ""], kinds=["crease", "border"])
    save(tmp_path / "a.json", whole)
    save(tmp_path / "a.step", whole)
    program = shutil.which("diff3ds", path=Path(sys.executable).parent)
    assert program, "the command diff3ds is installed beside this Python"
    said = blender(INSIDE / "use_extension.py", FOLDER, program, tmp_path / "a.json", tmp_path / "a.step")
    found = json.loads(next(line for line in said.splitlines() if line.startswith("FOUND ")).removeprefix("FOUND "))
    window = found.pop("window")
    assert all(each["state"] == ["FINISHED"] for each in found.values())
    assert found["a.json CURVES"]["types"] == found["a.step CURVES"]["types"] == ["CURVE"] * 2
    assert found["a.json CURVES"]["inside"] == ["border", "crease"]
    assert found["a.json PENCIL"]["layers"] == ["border", "lamp - crease"]
    assert found["a.json PENCIL"]["strokes"] == found["a.step PENCIL"]["strokes"] == 2
    # Nine edges of a cube are seen; the others are dashes.
    assert len(found["cube"]["types"]) > 9
    assert any(name.startswith("crease, hidden") for name in found["cube"]["inside"])
    assert {"crease", "contour"} <= set(found["cylinder"]["layers"])
    assert any(name.startswith("contour") for name in found["torus"]["inside"])
    assert any(name.startswith("hatching") for name in found["torus"]["inside"])
    # Other events go on to Blender; Escape ends the child and leaves nothing behind.
    assert window["states"] == [["PASS_THROUGH"], ["RUNNING_MODAL"], ["CANCELLED"]]
    assert window["told"] == [1, "diff3ds: edges: 3 of 7 (Escape stops it)", "timer", "end", None]
    assert window["ended"]
    assert not window["left"]


IMPORT = """
import importlib.util, sys
import bpy
spec = importlib.util.spec_from_file_location("lines", "FOLDER/__init__.py", submodule_search_locations=["FOLDER"])
sys.modules["lines"] = module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
module.register()
bpy.ops.diff3ds.import_sketch(filepath="FILE", kind="KIND", scale=2)
module.unregister()
"""


@pytest.mark.parametrize("kind", ["CURVES", "PENCIL"])
def test_weights_and_widths_come_as_they_are(blender, tmp_path, kind) -> None:
    """Also in Grease Pencil, which evaluates the weights of NURBS strokes."""
    generator = torch.Generator().manual_seed(5)
    points = torch.rand(2, 4, 3, generator=generator, dtype=torch.float64)
    weights = torch.tensor([[1.0, 3.0, 0.5, 2.0], [1.0, 1.0, 1.0, 1.0]], dtype=torch.float64)
    whole = Sketch(points, weights, width=0.04, width_space="world")
    save(tmp_path / "a.json", whole)
    text = IMPORT.replace("FOLDER", str(FOLDER)).replace("FILE", str(tmp_path / "a.json")).replace("KIND", kind)
    (tmp_path / "import.py").write_text(text)
    blender(INSIDE / "measure.py", tmp_path / "import.py", tmp_path / "found.json")
    found = json.loads((tmp_path / "found.json").read_text())
    places = torch.tensor([place for each in found for place in each["points"]], dtype=torch.float64) / 2
    radii = torch.tensor([radius for each in found for radius in each["radii"]]) / 2
    assert bezier.closest_point(points, weights, places[None]).distance.amin(0).max() < 1e-6
    assert (radii - 0.02).abs().max() < 1e-6


def test_blender_itself_finds_it_valid(blender, tmp_path) -> None:
    """By the program behind `blender --command extension validate`, and so the zip file that it builds."""
    (tmp_path / "find.py").write_text(
        "import bpy, pathlib, runpy, sys\n"
        "tool = next(pathlib.Path(bpy.utils.system_resource('SCRIPTS')).rglob('bl_pkg/cli/blender_ext.py'))\n"
        "sys.argv = [str(tool), *sys.argv[1:]]\n"
        "runpy.run_path(str(tool), run_name='__main__')\n"
    )
    assert "Success" in blender(tmp_path / "find.py", "validate", FOLDER)
    blender(tmp_path / "find.py", "build", "--source-dir", FOLDER, "--output-dir", tmp_path)
    (archive,) = tmp_path.glob("*.zip")
    assert "Success" in blender(tmp_path / "find.py", "validate", archive)
