"""Runs a script in a file with work in it, and says what of the work is not as it was."""

import os
import runpy
import sys

import bpy

SCRIPT = sys.argv[1]
# What Blender itself counts up, and the lists of what is linked, which are looked at by themselves.
COUNTED = {"users", "session_uid", "is_evaluated", "rna_type", "bl_rna", "tag", "is_embedded_data", "use_extra_user"}
# What a render works out, and a name that is empty until the format of pictures is first set.
COUNTED |= {"depsgraph", "linear_colorspace_settings"}


def told(item, depth=0) -> object:
    """What a datablock says of itself: its values, and those of what belongs to it alone."""
    if item is None:
        return None
    found = {}
    for known in item.bl_rna.properties:
        name = known.identifier
        if name in COUNTED or name.startswith("is_"):
            continue
        try:
            value = getattr(item, name)
        except (AttributeError, RuntimeError, TypeError):
            continue
        if known.type == "POINTER":
            inner = isinstance(value, bpy.types.bpy_struct) and not isinstance(value, bpy.types.ID)
            found[name] = told(value, depth + 1) if inner and depth < 3 else getattr(value, "name_full", None)
        elif known.type == "COLLECTION":
            if depth < 3 and len(value) < 5000:
                found[name] = [
                    each.name_full if isinstance(each, bpy.types.ID) else told(each, depth + 1) for each in value
                ]
        elif getattr(known, "is_array", False):
            found[name] = str([list(row) if hasattr(row, "__len__") else row for row in value])
        else:
            found[name] = repr(value)
    return found


def all_of_it() -> dict:
    """Every datablock by its kind and name."""
    # Not what an interface shows.
    shown = {"screens", "window_managers", "workspaces", "brushes"}
    lists = [each.identifier for each in bpy.data.bl_rna.properties if each.type == "COLLECTION"]
    lists = [kind for kind in lists if kind not in shown]
    return {(kind, each.name_full): told(each) for kind in lists for each in getattr(bpy.data, kind)}


def different(before, after, path="") -> list[str]:
    if type(before) is not type(after):
        return [path]
    if isinstance(before, dict):
        return [line for key in before for line in different(before[key], after.get(key), f"{path}.{key}")]
    if isinstance(before, list):
        if len(before) != len(after):
            return [f"{path}: {len(before)} became {len(after)}"]
        pairs = enumerate(zip(before, after, strict=True))
        return [line for n, (a, b) in pairs for line in different(a, b, f"{path}[{n}]")]
    return [] if before == after else [f"{path}: {before} became {after}"]


bpy.ops.mesh.primitive_monkey_add()
bpy.context.object.name = "three weeks of work"
bpy.context.object.modifiers.new("smooth", "SUBSURF")
other = bpy.data.scenes.new("another scene")
other.collection.objects.link(bpy.data.objects.new("object of another scene", None))
bpy.data.texts.new("notes").write("to do")
bpy.data.collections.new("sketch")
bpy.data.materials.new("stroke 0.000 0.000 0.000 1.000").diffuse_color = (1, 0, 0, 1)
bpy.context.object.keyframe_insert("location", frame=7)
bpy.context.scene.frame_end = 999
bpy.context.scene.unit_settings.scale_length = 0.001
before = all_of_it()
sys.argv = ["blender", *sys.argv[2:]]
for _ in range(2):
    runpy.run_path(SCRIPT, run_name="__main__")
after = all_of_it()
lines = [line for key, value in before.items() for line in different(value, after.get(key), " ".join(key))]
print("\n".join(f"CHANGED {line}" for line in lines))
print("NEW", sorted({kind for kind, _ in set(after) - set(before)}))
# As a module Blender may wait for ever for its own threads when it ends.
sys.stdout.flush()
os._exit(0)
