"""A 3D sketch by diff3ds @VERSION@, built in Blender.

blender --python THIS                                   opens it
blender -b --python THIS -- picture.png [WIDTH HEIGHT]  renders a picture
blender -b --python THIS -- turn.mp4 [WIDTH HEIGHT] --turntable
"""

import json
import math
import os
import sys
from collections.abc import Sequence
from functools import cache
from typing import Any

import bpy
from mathutils import Vector

SCENE: dict[str, Any] = json.loads(r"""@SCENE@""")

# What Blender begins with: name, kind, and where it stands.
BEGUN = {
    "Cube": ("MESH", (0.0, 0.0, 0.0)),
    "Light": ("LIGHT", (4.0762, 1.0055, 5.9039)),
    "Camera": ("CAMERA", (7.3589, -6.9258, 4.9583)),
}
# Of the sketch's radius: how far the surface is drawn back behind Grease Pencil, whose flat strokes lie on it.
BEHIND = 0.004


def linear(value: float) -> float:
    """Turns sRGB into the linear light of Blender's colours."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def sized(values: Sequence[float]) -> list[float]:
    """Lengths or a place of the sketch in Blender's units."""
    return [value * size for value in values]


def nodes_of(made: Any) -> Any:
    """The nodes of a material or world, which have them from the start since Blender 5.0."""
    if not made.node_tree:
        made.use_nodes = True
    return made.node_tree.nodes


def named(color: Sequence[float]) -> str:
    """What the material of a colour and opacity is called."""
    return "stroke " + " ".join(f"{value:.3f}" for value in color)


@cache
def material_of(color: tuple[float, ...]) -> Any:
    """A material a colour and opacity."""
    made = bpy.data.materials.new(named(color))
    surface = nodes_of(made)["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (*(linear(value) for value in color[:3]), 1.0)
    surface.inputs["Roughness"].default_value = 0.6
    surface.inputs["Alpha"].default_value = color[3]
    made.diffuse_color = color
    if color[3] < 1 and hasattr(made, "blend_method"):
        made.blend_method = "BLEND"
    return made


@cache
def collection_of(layers: tuple[str, ...]) -> Any:
    """A collection within those before it."""
    if not layers:
        return sketch
    made = bpy.data.collections.new(layers[-1])
    collection_of(layers[:-1]).children.link(made)
    return made


def add_stroke(stroke: dict[str, Any]) -> None:
    """A stroke as a curve object."""
    curve = bpy.data.curves.new(stroke["name"], "CURVE")
    curve.dimensions = "3D"
    curve.bevel_depth = 1.0
    curve.bevel_resolution = 4
    curve.resolution_u = stroke["steps"]
    curve.use_fill_caps = True
    spline = curve.splines.new("NURBS")
    spline.points.add(len(stroke["points"]) - 1)
    for point, place, radius in zip(spline.points, stroke["points"], sized(stroke["radii"]), strict=False):
        point.co = (*sized(place[:3]), place[3])
        point.radius = radius
    spline.order_u = 4
    spline.use_endpoint_u = True
    spline.use_bezier_u = True
    curve.materials.append(material_of(tuple(stroke["color"])))
    collection_of(tuple(stroke["layers"])).objects.link(bpy.data.objects.new(stroke["name"], curve))


def add_pencil(layers: list[dict[str, Any]]) -> None:
    """All strokes as one object of Grease Pencil, whose data were called otherwise before Blender 5.0."""
    pencil = getattr(bpy.data, "grease_pencils_v3" if bpy.app.version < (5, 0, 0) else "grease_pencils").new("sketch")
    pencil.stroke_depth_order = "3D"
    materials: dict[tuple[float, ...], int] = {}
    for layer in layers:
        made = pencil.layers.new(layer["name"])
        made.use_lights = False
        for number, strokes in enumerate(layer["frames"]):
            drawing = made.frames.new(number + 1).drawing
            if strokes:
                looks = [tuple(stroke["color"][:3]) for stroke in strokes]
                draw(drawing, strokes, [materials.setdefault(look, len(materials)) for look in looks])
    for look in materials:
        material = bpy.data.materials.new(named(look))
        bpy.data.materials.create_gpencil_data(material)
        material.grease_pencil.color = (*(linear(value) for value in look), 1.0)
        pencil.materials.append(material)
    sketch.objects.link(bpy.data.objects.new("sketch", pencil))


def draw(drawing: Any, strokes: list[dict[str, Any]], materials: list[int]) -> None:
    """Bézier strokes in a drawing; Blender 4.3 and 4.4 let scripts make no others than polylines."""
    bent = hasattr(drawing, "set_types")
    lines = strokes if bent else [as_polyline(stroke) for stroke in strokes]
    counts = [len(line["radii"]) for line in lines]
    drawing.add_strokes(counts)
    if bent:
        drawing.set_types(type="BEZIER", indices=tuple(range(len(lines))))

    def keep(name: str, kind: str, domain: str, values: list[Any], key: str = "value") -> None:
        attribute = drawing.attributes.get(name) or drawing.attributes.new(name, kind, domain)
        attribute.data.foreach_set(key, values)

    knots = [knot for line in lines for knot in line["points"]]
    for part, name in enumerate(("handle_left", "position", "handle_right")):
        if bent or name == "position":
            places = [value for knot in knots for value in sized(knot[part])]
            keep(name, "FLOAT_VECTOR", "POINT", places, "vector")
        if bent and name != "position":
            keep(name.replace("handle", "handle_type"), "INT8", "POINT", [0] * len(knots))
    keep("radius", "FLOAT", "POINT", [value for line in lines for value in sized(line["radii"])])
    opacities = [line["color"][3] for line, count in zip(lines, counts, strict=True) for _ in range(count)]
    keep("opacity", "FLOAT", "POINT", opacities)
    keep("cyclic", "BOOLEAN", "CURVE", [line["cyclic"] for line in lines])
    keep("material_index", "INT", "CURVE", materials)
    keep("resolution", "INT", "CURVE", [line["steps"] for line in lines])
    drawing.tag_positions_changed()


def as_polyline(stroke: dict[str, Any]) -> dict[str, Any]:
    """The same stroke in chords."""
    knots, radii, steps = stroke["points"], stroke["radii"], stroke["steps"]
    if stroke["cyclic"]:
        knots, radii = [*knots, knots[0]], [*radii, radii[0]]
    points, along = [], []
    for number in range(len(knots) - 1):
        control = [Vector(place) for place in (*knots[number][1:], *knots[number + 1][:2])]
        for step in range(steps):
            t = step / steps
            weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3)
            points.append(tuple(sum((w * p for w, p in zip(weights, control, strict=True)), Vector())))
            along.append(radii[number] + t * (radii[number + 1] - radii[number]))
    if not stroke["cyclic"]:
        points.append(knots[-1][1])
        along.append(radii[-1])
    return stroke | {"points": [(point,) * 3 for point in points], "radii": along}


def add_surface(corners: list[list[float]], faces: list[list[int]]) -> None:
    """What hides lines: a mesh that looks like the world behind it."""
    mesh = bpy.data.meshes.new("surface")
    mesh.from_pydata([sized(corner) for corner in corners], [], faces)
    material = bpy.data.materials.new("hides lines")
    nodes = nodes_of(material)
    nodes.clear()
    light, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    ground = nodes_of(scene.world).get("Background") if scene.world.node_tree else None
    color = tuple(ground.inputs["Color"].default_value) if ground else (1.0, 1.0, 1.0, 1.0)
    light.inputs["Color"].default_value = color
    light.inputs["Strength"].default_value = ground.inputs["Strength"].default_value if ground else 1.0
    material.node_tree.links.new(light.outputs[0], output.inputs["Surface"])
    material.diffuse_color = color
    mesh.materials.append(material)
    made = bpy.data.objects.new("surface", mesh)
    if "layers" in SCENE:
        back = made.modifiers.new("behind the strokes", "DISPLACE")
        back.mid_level, back.strength = 0.0, -BEHIND * SCENE["radius"] * size
    sketch.objects.link(made)


def is_begun(made: Any) -> bool:
    """Whether an object is one that Blender begins with, as it was then."""
    kind, place = BEGUN.get(made.name, ("", ()))
    if made.type != kind or made.animation_data or made.parent or made.modifiers or made.constraints:
        return False
    if max(abs(a - b) for a, b in zip(made.location, place, strict=True)) > 1e-3 or tuple(made.scale) != (1, 1, 1):
        return False
    corners = made.data.vertices if kind == "MESH" else ()
    return kind != "MESH" or (len(corners) == 8 and all(abs(value) == 1 for corner in corners for value in corner.co))


def clear_default() -> None:
    """Clears the scene that Blender begins with, as long as it is exactly that: a cube, a light and a camera."""
    objects = list(bpy.data.objects)
    if bpy.data.filepath or len(bpy.data.scenes) != 1 or {made.name for made in objects} != set(BEGUN):
        return
    if not all(is_begun(made) for made in objects):
        return
    for made in objects:
        bpy.data.objects.remove(made)
    scene.world = None
    scene.view_settings.view_transform = "Standard"
    scene.frame_start, scene.frame_end, scene.render.fps = 1, SCENE["frames"], SCENE["fps"]
    for layer in scene.view_layers:
        layer.use_pass_z = True


def add_camera() -> Any:
    """A camera that turns round the sketch."""
    middle, eye, radius = Vector(sized(SCENE["middle"])), Vector(sized(SCENE["eye"])), SCENE["radius"] * size
    turn = bpy.data.objects.new("turntable", None)
    turn.location = middle
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit = "VERTICAL"
    lens.angle = math.radians(SCENE["fov"])
    lens.clip_start, lens.clip_end = radius / 1000, 1000 * radius
    camera = bpy.data.objects.new("camera", lens)
    camera.location = eye - middle
    camera.rotation_euler = (middle - eye).to_track_quat("-Z", "Y").to_euler()
    camera.parent = turn
    for made in (turn, camera):
        sketch.objects.link(made)
    for frame, degrees in ((1, 0), (SCENE["frames"] + 1, 360)):
        turn.rotation_euler = (0, 0, math.radians(degrees))
        turn.keyframe_insert("rotation_euler", frame=frame)
    for curve in curves_of(turn.animation_data.action):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    return camera


def add_light(above: Any) -> None:
    """A sun that turns with the camera."""
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 3.0
    sun.rotation_euler = (math.radians(40), math.radians(15), math.radians(60))
    sun.parent = above
    sketch.objects.link(sun)


def add_world() -> None:
    """White paper all around."""
    scene.world = bpy.data.worlds.new("paper")
    nodes_of(scene.world)["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)


def curves_of(action: Any) -> list[Any]:
    """The animated values, of Blender before and since 5.0."""
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    strips = [strip for layer in action.layers for strip in layer.strips]
    return [curve for strip in strips for bag in strip.channelbags for curve in bag.fcurves]


def render(file: str, resolution: tuple[int, ...], camera: Any) -> None:
    """A picture, or with a camera that turns a film; the settings of the scene are afterwards what they were."""
    picture, image, turntable = scene.render, scene.render.image_settings, camera is not None
    settings = [
        (picture, "engine", "CYCLES"),
        (scene.cycles, "samples", 32),
        (scene.cycles, "device", "CPU"),
        (picture, "resolution_x", resolution[0]),
        (picture, "resolution_y", resolution[1]),
        (picture, "resolution_percentage", 100),
        (picture, "filepath", os.path.abspath(file)),
        # Since Blender 5.0 it comes before the format.
        (image, "media_type", "VIDEO" if turntable else "IMAGE"),
        (image, "file_format", "FFMPEG" if turntable else "PNG"),
        # By their depth Grease Pencil knows what hides it.
        *((layer, "use_pass_z", True) for layer in scene.view_layers),
    ]
    if turntable:
        settings += [
            (picture.ffmpeg, "format", "MPEG4"),
            (picture, "fps", SCENE["fps"]),
            (scene, "frame_start", 1),
            (scene, "frame_end", SCENE["frames"]),
            (scene, "camera", camera),
        ]
    settings = [(owner, name, value) for owner, name, value in settings if hasattr(owner, name)]
    # A format of files changes what else is said of them.
    told = [(owner, name) for owner, name, _ in settings] + [
        (owner, known.identifier)
        for owner in (image, picture.ffmpeg)
        for known in owner.bl_rna.properties
        if not known.is_readonly and known.type not in ("POINTER", "COLLECTION")
    ]
    before, frame = [(owner, name, getattr(owner, name)) for owner, name in told], scene.frame_current
    try:
        for owner, name, value in settings:
            setattr(owner, name, value)
        bpy.ops.render.render(animation=turntable, write_still=not turntable)
    finally:
        for owner, name, value in before:
            if getattr(owner, name) != value:
                setattr(owner, name, value)
        scene.frame_set(frame)


if "layers" in SCENE and bpy.app.version < (4, 3, 0):
    raise SystemExit("Grease Pencil strokes need Blender 4.3 or newer: export the sketch as curves")
arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
scene = bpy.context.scene
size = 1.0 if SCENE["metres"] is None else SCENE["metres"] / scene.unit_settings.scale_length
clear_default()
sketch = bpy.data.collections.new("sketch")
scene.collection.children.link(sketch)
turning = None
if scene.camera is None or SCENE["turns"] or "--turntable" in arguments:
    turning = add_camera()
scene.camera = scene.camera or turning
if not any(made.type == "LIGHT" for made in scene.objects):
    add_light(turning and turning.parent)
if scene.world is None:
    add_world()
for stroke in SCENE.get("strokes", ()):
    add_stroke(stroke)
if "layers" in SCENE:
    add_pencil(SCENE["layers"])
if "surface" in SCENE:
    add_surface(**SCENE["surface"])
if arguments:
    words = [word for word in arguments if word != "--turntable"]
    resolution = tuple(int(word) for word in words[1:3]) if len(words) > 2 else (1024, 1024)
    render(words[0], resolution, turning if "--turntable" in arguments else None)
