"""Scripts for Blender: strokes as exact NURBS curves, with thickness, materials, camera, light and a turn."""

import json
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import write_text
from diff3ds._version import __version__
from diff3ds.bezier import to_nurbs
from diff3ds.camera import Cameras
from diff3ds.formats.framing import FILLED, FOV, ball_of, framed
from diff3ds.sketch import Sketch

# Of the turntable that the script makes.
FRAMES = 120
# The view of the script's camera, degrees.
AZIMUTH, ELEVATION = 30.0, 20.0


def save_blender(path: str | Path, sketch: Sketch) -> None:
    """Writes a Python script that builds the sketch in Blender (3.6 or newer), whole or not at all.

    `blender --python scene.py` opens it; `blender -b --python scene.py -- picture.png` renders one picture, and
    `... -- turn.mp4 --turntable` a turn of 120 frames. Each stroke is a curve object called "stroke 0" and so on: one
    NURBS spline of order 4 with the stroke's control points and weights in the float32 that Blender keeps, its widths
    as radii. Materials are one a colour and opacity, and collections one a colour, in a collection "sketch" of the open
    scene. What else there is stays as it is: camera, light and world are made where there are none, and only the
    cube, light and camera that Blender begins with give way.

    Raises:
        ValueError: values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    sketch.check_values()
    write_text(Path(path), blender_script(sketch, framed(sketch, AZIMUTH, ELEVATION)))


def blender_script(sketch: Sketch, cameras: Cameras, fov: float = FOV, frames: int = FRAMES, fps: int = 24) -> str:
    """The script, whose camera stands where the first of these does and looks at the sketch's middle.

    Args:
        fov: its vertical field of view, degrees.
        frames: of a turn.
        fps: frames a second.
    """
    view = {"eye": cameras.centers[0].tolist(), "fov": fov, "frames": frames, "fps": fps}
    content = json.dumps(_scene(sketch) | view, separators=(",", ":"))
    return _SCRIPT.replace("@VERSION@", __version__).replace("@SCENE@", content)


def _scene(sketch: Sketch) -> dict[str, Any]:
    """All that the script builds but the camera, in numbers."""
    middle, radius = ball_of(sketch)
    wide = 1.0 if sketch.width_space == "world" else 2 * radius / FILLED
    raised = sketch.detach().to("cpu").to(torch.float64).elevate(3).with_widths_along()
    first = range(len(raised) + 1) if raised.chains is None else raised.chains.first.tolist()
    strokes = []
    for n in range(len(raised)):
        rows = slice(first[n], first[n + 1])
        points, weights, _ = to_nurbs(raised.points[rows], raised.weights[rows])
        radii = raised.width[rows] * wide / 2
        strokes.append(
            {
                "points": torch.cat([points, weights[:, None]], 1).tolist(),
                "radii": torch.cat([radii[:1, 0], radii[:, 1:].flatten()]).tolist(),
                "color": [*raised.color[n].clamp(0, 1).tolist(), float(raised.opacity[n])],
            }
        )
    return {"strokes": strokes, "middle": middle.tolist(), "radius": radius}


_SCRIPT = '''"""A 3D sketch by diff3ds @VERSION@, built in Blender.

    blender --python THIS                                   opens it
    blender -b --python THIS -- picture.png [WIDTH HEIGHT]  renders a picture
    blender -b --python THIS -- turn.mp4 [WIDTH HEIGHT] --turntable
"""

import json
import math
import os
import sys
from functools import cache

import bpy
from mathutils import Vector

SCENE = json.loads(r"""@SCENE@""")


def linear(value):
    """sRGB to the linear light of Blender's colours."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def with_nodes(made):
    """Materials and worlds have nodes from the start since Blender 5.0."""
    if not made.node_tree:
        made.use_nodes = True
    return made.node_tree.nodes


@cache
def material_of(color):
    made = bpy.data.materials.new("stroke " + " ".join(f"{value:.3f}" for value in color))
    surface = with_nodes(made)["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (*(linear(value) for value in color[:3]), 1.0)
    surface.inputs["Roughness"].default_value = 0.6
    surface.inputs["Alpha"].default_value = color[3]
    made.diffuse_color = color
    if color[3] < 1 and hasattr(made, "blend_method"):
        made.blend_method = "BLEND"
    return made


@cache
def collection_of(color):
    made = bpy.data.collections.new("#" + "".join(f"{round(255 * value):02x}" for value in color))
    sketch.children.link(made)
    return made


def add_stroke(number, stroke):
    curve = bpy.data.curves.new(f"stroke {number}", "CURVE")
    curve.dimensions = "3D"
    curve.bevel_depth = 1.0
    curve.bevel_resolution = 4
    curve.resolution_u = 24
    curve.use_fill_caps = True
    spline = curve.splines.new("NURBS")
    spline.points.add(len(stroke["points"]) - 1)
    for point, place, radius in zip(spline.points, stroke["points"], stroke["radii"]):
        point.co = place
        point.radius = radius
    spline.order_u = 4
    spline.use_endpoint_u = True
    spline.use_bezier_u = True
    color = tuple(stroke["color"])
    curve.materials.append(material_of(color))
    collection_of(color[:3]).objects.link(bpy.data.objects.new(curve.name, curve))


def clear_default():
    """Clears the scene that Blender begins with, as long as it is that: a cube, a light and a camera, never saved."""
    objects = {made.name: made for made in bpy.data.objects}
    begun = set(objects) == {"Cube", "Light", "Camera"} and len(bpy.data.scenes) == 1 and not bpy.data.filepath
    if not begun or objects["Cube"].type != "MESH" or len(objects["Cube"].data.vertices) != 8:
        return
    for made in objects.values():
        bpy.data.objects.remove(made)
    scene.world = None
    scene.view_settings.view_transform = "Standard"
    scene.frame_start, scene.frame_end, scene.render.fps = 1, SCENE["frames"], SCENE["fps"]


def add_camera():
    """A camera that turns round the sketch."""
    middle, radius = Vector(SCENE["middle"]), SCENE["radius"]
    turn = bpy.data.objects.new("turntable", None)
    turn.location = middle
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit = "VERTICAL"
    lens.angle = math.radians(SCENE["fov"])
    lens.clip_start, lens.clip_end = radius / 1000, 1000 * radius
    camera = bpy.data.objects.new("camera", lens)
    eye = Vector(SCENE["eye"])
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


def add_light(above):
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 3.0
    sun.rotation_euler = (math.radians(40), math.radians(15), math.radians(60))
    sun.parent = above
    sketch.objects.link(sun)


def add_world():
    scene.world = bpy.data.worlds.new("paper")
    with_nodes(scene.world)["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)


def curves_of(action):
    """The animated values, of Blender before and since 5.0."""
    if hasattr(action, "fcurves"):
        return action.fcurves
    strips = [strip for layer in action.layers for strip in layer.strips]
    return [curve for strip in strips for bag in strip.channelbags for curve in bag.fcurves]


def render(file, size, camera):
    """A picture, or with a camera that turns a film; the settings of the scene are afterwards what they were."""
    picture, image, turntable = scene.render, scene.render.image_settings, camera is not None
    settings = [
        (picture, "engine", "CYCLES"),
        (scene.cycles, "samples", 32),
        (scene.cycles, "device", "CPU"),
        (picture, "resolution_x", size[0]),
        (picture, "resolution_y", size[1]),
        (picture, "resolution_percentage", 100),
        (picture, "filepath", os.path.abspath(file)),
        # Since Blender 5.0 it comes before the format.
        (image, "media_type", "VIDEO" if turntable else "IMAGE"),
        (image, "file_format", "FFMPEG" if turntable else "PNG"),
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
    before, frame = [(owner, name, getattr(owner, name)) for owner, name, _ in settings], scene.frame_current
    try:
        for owner, name, value in settings:
            setattr(owner, name, value)
        bpy.ops.render.render(animation=turntable, write_still=not turntable)
    finally:
        for owner, name, value in before:
            setattr(owner, name, value)
        scene.frame_set(frame)


arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
scene = bpy.context.scene
clear_default()
sketch = bpy.data.collections.new("sketch")
scene.collection.children.link(sketch)
for number, stroke in enumerate(SCENE["strokes"]):
    add_stroke(number, stroke)
turning = add_camera() if scene.camera is None or "--turntable" in arguments else None
scene.camera = scene.camera or turning
if not any(made.type == "LIGHT" for made in scene.objects):
    add_light(turning and turning.parent)
if scene.world is None:
    add_world()
if arguments:
    words = [word for word in arguments if word != "--turntable"]
    size = tuple(int(word) for word in words[1:3]) if len(words) > 2 else (1024, 1024)
    render(words[0], size, turning if "--turntable" in arguments else None)
'''
