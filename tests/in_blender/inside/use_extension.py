"""Loads the extension, imports files with it, and has it draw meshes; says what came."""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from types import SimpleNamespace

import bpy

folder, program, *files = sys.argv[1:]
spec = importlib.util.spec_from_file_location(
    "diff3ds_lines", f"{folder}/__init__.py", submodule_search_locations=[folder]
)
module = importlib.util.module_from_spec(spec)
sys.modules["diff3ds_lines"] = module
spec.loader.exec_module(module)
module.register()
module.settings.program = module.draw_object.program = lambda context: program


def came(before: set) -> dict:
    """The kinds of the new objects, the layers of Grease Pencil, and the collections."""
    new = [each for each in bpy.data.objects if each.name not in before]
    pencils = [each.data for each in new if each.type == "GREASEPENCIL"]
    return {
        "types": sorted(each.type for each in new),
        "layers": sorted({layer.name for data in pencils for layer in data.layers}),
        "strokes": sum(len(layer.frames[0].drawing.strokes) for data in pencils for layer in data.layers),
        "inside": sorted({inside.name for each in new for inside in each.users_collection}),
    }


def in_a_window(*events: str) -> dict:
    """What a drawing does at events of a window while its child works, and what it tells the window."""
    drawing, told = module.draw_object.DIFF3DS_OT_draw, []
    manager = SimpleNamespace(
        progress_update=told.append, progress_end=lambda: told.append("end"), event_timer_remove=told.append
    )
    workspace = SimpleNamespace(status_text_set=told.append)
    context = SimpleNamespace(window_manager=manager, workspace=workspace)
    # Operators are made by Blender alone: their methods work on what stands for one.
    own = {name: value for name, value in vars(drawing).items() if callable(value)}
    one = type("Drawing", (), own)()
    one.folder, one.timer, one.steps, one.left = tempfile.TemporaryDirectory(), "timer", 2, ["the view"]
    one.child, one.report = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]), lambda *_: None
    with open(f"{one.folder.name}/said.txt", "w") as file:
        file.write("edges: 3 of 7\r")
    states = [sorted(one.modal(context, SimpleNamespace(type=event))) for event in events]
    return {
        "states": states,
        "told": told,
        "ended": one.child.poll() is not None,
        "left": os.path.exists(one.folder.name),
    }


found = {}
for file in files:
    for kind in ("CURVES", "PENCIL"):
        before = {each.name for each in bpy.data.objects}
        state = bpy.ops.diff3ds.import_sketch(filepath=file, kind=kind)
        found[f"{file.rpartition('/')[2]} {kind}"] = came(before) | {"state": sorted(state)}
meshes = {
    "cube": lambda: None,
    "cylinder": lambda: bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=1, depth=2),
    "torus": lambda: bpy.ops.mesh.primitive_torus_add(major_segments=24, minor_segments=12),
}
options = {"cube": {"hidden": "DASHED"}, "cylinder": {"kind": "PENCIL", "hidden": "FAINT"}, "torus": {"hatch": "LIGHT"}}
if program:
    for name, make in meshes.items():
        bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
        make()
        before = {each.name for each in bpy.data.objects}
        state = bpy.ops.diff3ds.draw_object(**options[name])
        found[name] = came(before) | {"state": sorted(state)}
    found["window"] = in_a_window("MOUSEMOVE", "TIMER", "ESC")
module.unregister()
print("FOUND " + json.dumps(found))
# As a module Blender may wait for ever for its own threads when it ends.
sys.stdout.flush()
os._exit(0)
