# SPDX-License-Identifier: GPL-3.0-or-later
"""What diff3ds is handed: a mesh as OBJ, a camera as transforms.json, and the commands that draw it."""

import json
import math
from pathlib import Path

import bpy


def write_mesh(made: bpy.types.Object, path: Path, context: bpy.types.Context) -> None:
    """Writes an object as it is shown, with its modifiers, in world coordinates.

    Raises:
        ValueError: it has no faces.
    """
    shown = made.evaluated_get(context.evaluated_depsgraph_get())
    mesh = shown.to_mesh()
    try:
        if not len(mesh.polygons):
            raise ValueError(f"{made.name} has no faces")
        corners = [made.matrix_world @ vertex.co for vertex in mesh.vertices]
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
        # What is mirrored is inside out.
        step = -1 if made.matrix_world.determinant() < 0 else 1
        lines += ["f " + " ".join(str(n + 1) for n in list(face.vertices)[::step]) for face in mesh.polygons]
    finally:
        shown.to_mesh_clear()
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def write_camera(scene: bpy.types.Scene, path: Path) -> float:
    """Writes the camera of a scene; gives the tangent of half its vertical view.

    Raises:
        ValueError: there is none, or one without perspective.
    """
    camera = scene.camera
    if camera is None or camera.data.type != "PERSP":
        raise ValueError("the scene needs a perspective camera")
    lens, picture = camera.data, scene.render
    width = max(int(picture.resolution_x * picture.resolution_percentage / 100), 1)
    height = max(int(picture.resolution_y * picture.resolution_percentage / 100), 1)
    wide, high = width * picture.pixel_aspect_x, height * picture.pixel_aspect_y
    # The side of the sensor that the view is as wide as, and that side of the picture.
    across = lens.sensor_fit == "HORIZONTAL" or (lens.sensor_fit == "AUTO" and wide >= high)
    sensor = lens.sensor_height if lens.sensor_fit == "VERTICAL" else lens.sensor_width
    side = wide if across else high
    focal = lens.lens / sensor * side
    view = {
        "w": width,
        "h": height,
        "fl_x": focal / picture.pixel_aspect_x,
        "fl_y": focal / picture.pixel_aspect_y,
        "cx": width / 2 - lens.shift_x * side / picture.pixel_aspect_x,
        "cy": height / 2 + lens.shift_y * side / picture.pixel_aspect_y,
        "frames": [
            {"file_path": "view.png", "transform_matrix": [list(row) for row in camera.matrix_world.normalized()]}
        ],
    }
    path.write_text(json.dumps(view), encoding="ascii")
    return high / 2 / focal


def commands(program: str, folder: Path, hidden: str, hatch: str, angle: float) -> list:
    """What is run, one after the other: the mesh's lines, and those of the view."""
    creases = [f"--angle={math.degrees(angle):g}"] if angle > 0 else []
    run, camera = folder / "run", folder / "camera.json"
    # Its own drawings are not needed: one is the least that it makes.
    mesh = [program, "mesh", str(folder / "object.obj"), "-o", str(run), "--azimuth=0", "--turntable=0", *creases]
    tone = [] if hatch == "NONE" else [f"--hatch={hatch.lower()}"]
    view = [program, "render", str(run), "-o", str(folder / "seen.json"), f"--cameras={camera}"]
    return [mesh, [*view, f"--hidden={hidden.lower()}", *tone]]
