"""Runs a script, and says all points of what it has made, with their radii, as Blender evaluates them."""

import json
import os
import runpy
import sys

import bpy
import numpy as np

script, file = sys.argv[1:]
sys.argv = ["blender"]
runpy.run_path(script, run_name="__main__")

# Nodes that turn an object into the chords of its curves, with their radii.
group = bpy.data.node_groups.new("chords", "GeometryNodeTree")
group.interface.new_socket("out", in_out="OUTPUT", socket_type="NodeSocketGeometry")
add = group.nodes.new
of, pencil, whole = (
    add("GeometryNodeObjectInfo"),
    add("GeometryNodeGreasePencilToCurves"),
    add("GeometryNodeRealizeInstances"),
)
both, resample, store = (
    add("GeometryNodeJoinGeometry"),
    add("GeometryNodeResampleCurve"),
    add("GeometryNodeStoreNamedAttribute"),
)
radius, mesh, out = add("GeometryNodeInputRadius"), add("GeometryNodeCurveToMesh"), add("NodeGroupOutput")
of.transform_space = "RELATIVE"
if hasattr(resample, "mode"):
    resample.mode = "EVALUATED"
else:
    resample.inputs["Mode"].default_value = "Evaluated"
store.inputs["Name"].default_value = "radius of it"
for source, target in (
    (of.outputs["Geometry"], pencil.inputs[0]),
    (of.outputs["Geometry"], both.inputs[0]),
    (pencil.outputs[0], both.inputs[0]),
    (both.outputs[0], whole.inputs[0]),
    (whole.outputs[0], resample.inputs[0]),
    (resample.outputs[0], store.inputs[0]),
    (radius.outputs[0], store.inputs["Value"]),
    (store.outputs[0], mesh.inputs[0]),
    (mesh.outputs[0], out.inputs[0]),
):
    group.links.new(source, target)
host = bpy.data.objects.new("host", bpy.data.meshes.new("host"))
bpy.context.scene.collection.objects.link(host)
host.modifiers.new("chords", "NODES").node_group = group

found = []
for made in [each for each in bpy.data.objects if each.type in ("CURVE", "GREASEPENCIL")]:
    if made.type == "CURVE":
        made.data.bevel_depth = 0
    of.inputs["Object"].default_value = made
    bpy.context.scene.frame_set(1)
    got = host.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    values = np.zeros(len(got.vertices))
    got.attributes["radius of it"].data.foreach_get("value", values)
    found.append(
        {
            "name": made.name,
            "inside": [each.name for each in made.users_collection],
            "points": [list(made.matrix_world @ vertex.co) for vertex in got.vertices],
            "chords": [list(edge.vertices) for edge in got.edges],
            "radii": values.tolist(),
        }
    )
with open(file, "w") as stream:
    json.dump(found, stream)
# As a module Blender may wait for ever for its own threads when it ends.
sys.stdout.flush()
os._exit(0)
