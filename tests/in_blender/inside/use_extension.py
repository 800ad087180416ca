"""Loads the extension, imports files with it, and has it draw meshes; says what came."""

import importlib.util
import json
import os
import sys

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
options = {"cube": {"hidden": "DASHED"}, "cylinder": {"kind": "PENCIL", "hidden": "FAINT"}, "torus": {}}
if program:
    for name, make in meshes.items():
        bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
        make()
        before = {each.name for each in bpy.data.objects}
        state = bpy.ops.diff3ds.draw_object(**options[name])
        found[name] = came(before) | {"state": sorted(state)}
module.unregister()
print("FOUND " + json.dumps(found))
# As a module Blender may wait for ever for its own threads when it ends.
sys.stdout.flush()
os._exit(0)
