# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Import > 3D sketch: sketch.json files and the curves of STEP files."""

from pathlib import Path

import bpy
from bpy_extras.io_utils import ImportHelper

from .build import build
from .read_sketch import read_sketch
from .read_step import read_step

_READERS = {".json": read_sketch, ".step": read_step, ".stp": read_step}
# What strokes become.
KINDS = (
    ("CURVES", "Curves", "An object a stroke: a NURBS curve with its weights, and its width as radius"),
    ("PENCIL", "Grease Pencil", "One object with a layer a thing and kind"),
)


class DIFF3DS_OT_import(bpy.types.Operator, ImportHelper):  # noqa: N801
    """Import the strokes of a sketch.json, or the curves of a STEP file."""

    bl_idname = "diff3ds.import_sketch"
    bl_label = "Import 3D Sketch"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    filter_glob: bpy.props.StringProperty(default="*.json;*.step;*.stp", options={"HIDDEN"})
    kind: bpy.props.EnumProperty(name="As", items=KINDS)
    scale: bpy.props.FloatProperty(
        name="Scale", description="Blender units of a unit of the file", default=1.0, min=1e-6, max=1e6
    )

    def execute(self, context: bpy.types.Context) -> set:
        """Reads the file."""
        path = Path(self.filepath)
        reader = _READERS.get(path.suffix.lower())
        try:
            if reader is None:
                raise ValueError(f"{path.name} is neither {', '.join(_READERS)}")
            given = reader(self.filepath)
            build(given, path.stem, self.kind == "PENCIL", self.scale)
        except (OSError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if given.left_out:
            self.report({"WARNING"}, given.left_out)
        self.report({"INFO"}, f"{len(given.strokes)} strokes")
        return {"FINISHED"}


def entry(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """The line in the menu."""
    self.layout.operator(DIFF3DS_OT_import.bl_idname, text="3D Sketch (.json, .step)")


CLASSES = (DIFF3DS_OT_import,)
