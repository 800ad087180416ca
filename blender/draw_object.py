# SPDX-License-Identifier: GPL-3.0-or-later
"""Object > Draw Lines: an installed diff3ds draws the active mesh as the camera sees it, and its strokes come back."""

import subprocess
import tempfile
from pathlib import Path

import bpy
from mathutils import Vector

from . import hand_over
from .build import build
from .import_files import KINDS
from .read_sketch import read_sketch
from .settings import program

# Seconds between looks at the child process.
_WAIT = 0.2
# Of what it says, the end tells why it failed.
_TOLD = 400
_HIDDEN = (
    ("DROP", "Left out", ""),
    ("DASHED", "Dashed", ""),
    ("FAINT", "Faint", ""),
    ("SHOW", "Drawn", ""),
)
_HATCH = (("NONE", "None", ""), ("LIGHT", "By light", ""), ("DEPTH", "By depth", ""))


class DIFF3DS_OT_draw(bpy.types.Operator):  # noqa: N801
    """Draw the outlines, creases and hidden lines of the active mesh, as the camera sees it. Escape stops it."""

    bl_idname = "diff3ds.draw_object"
    bl_label = "Draw Lines"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    kind: bpy.props.EnumProperty(name="As", items=KINDS)
    hidden: bpy.props.EnumProperty(name="Hidden lines", items=_HIDDEN)
    hatch: bpy.props.EnumProperty(name="Hatching", items=_HATCH)
    angle: bpy.props.FloatProperty(
        name="Crease angle",
        description="Faces that meet at more than this make a crease; 0: as diff3ds thinks",
        subtype="ANGLE",
        min=0.0,
        max=3.1,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Whether a mesh is selected."""
        return context.object is not None and context.object.type == "MESH" and context.mode == "OBJECT"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set:
        """Asks how."""
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context: bpy.types.Context) -> set:
        """Begins; without a window it waits for the end."""
        found = program(context)
        if not found:
            self.report({"ERROR"}, "diff3ds was not found: pip install diff3ds, and say where in the preferences")
            return {"CANCELLED"}
        self.folder = tempfile.TemporaryDirectory(prefix="diff3ds-")
        folder = Path(self.folder.name)
        try:
            hand_over.write_mesh(context.object, folder / "object.obj", context)
            half = hand_over.write_camera(context.scene, folder / "camera.json")
        except (OSError, ValueError) as error:
            self.folder.cleanup()
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        corners = [context.object.matrix_world @ Vector(corner) for corner in context.object.bound_box]
        middle = sum(corners, Vector()) / len(corners)
        # Widths are shares of the picture's height where the object is.
        self.height = 2 * half * (middle - context.scene.camera.matrix_world.translation).length
        self.drawn = context.object.name
        self.left = hand_over.commands(found, folder, self.hidden, self.hatch, self.angle)
        self.steps, self.child = len(self.left), None
        if bpy.app.background:
            while not (state := self._looked(context)):
                pass
            return state
        self.timer = context.window_manager.event_timer_add(_WAIT, window=context.window)
        context.window_manager.progress_begin(0, self.steps)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set:
        """Looks at the child process; Escape ends it."""
        if event.type == "ESC":
            self._stop()
            self.report({"INFO"}, "stopped")
            state: set = {"CANCELLED"}
        elif event.type == "TIMER":
            state = self._looked(context)
        else:
            return {"PASS_THROUGH"}
        if not state:
            context.window_manager.progress_update(self.steps - len(self.left))
            context.workspace.status_text_set(f"diff3ds: {self._said()[-80:] or 'drawing'} (Escape stops it)")
            return {"RUNNING_MODAL"}
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        return state

    def _looked(self, context: bpy.types.Context) -> set:
        """Begins what is next; how it ended, and nothing while it goes on."""
        if self.child is not None:
            try:
                code = self.child.wait(_WAIT if bpy.app.background else 0)
            except subprocess.TimeoutExpired:
                return set()
            if code:
                said = self._said()
                self._stop()
                self.report({"ERROR"}, f"diff3ds failed: {said[-_TOLD:]}")
                return {"CANCELLED"}
        if self.left:
            with (Path(self.folder.name) / "said.txt").open("wb") as said:
                # A list of words, which no shell reads.
                self.child = subprocess.Popen(self.left.pop(0), stdin=subprocess.DEVNULL, stdout=said, stderr=said)
            return set()
        return self._come_back()

    def _come_back(self) -> set:
        """The strokes of the view, as objects."""
        try:
            given = read_sketch(str(Path(self.folder.name) / "seen.json"))
            build(given, f"lines of {self.drawn}", self.kind == "PENCIL", height=self.height)
        except (OSError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            self._stop()
        self.report({"INFO"}, f"{len(given.strokes)} lines")
        return {"FINISHED"}

    def _said(self) -> str:
        """What the child process has said last."""
        path = Path(self.folder.name) / "said.txt"
        lines = (
            path.read_text(encoding="utf-8", errors="replace").replace("\r", "\n").split("\n") if path.exists() else []
        )
        return " ".join(line.strip() for line in lines[-4:] if line.strip())

    def _stop(self) -> None:
        """Ends the child process, and drops what was written."""
        if self.child is not None and self.child.poll() is None:
            self.child.terminate()
            try:
                self.child.wait(5)
            except subprocess.TimeoutExpired:
                self.child.kill()
        self.folder.cleanup()


def entry(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """The line in the menu."""
    self.layout.separator()
    self.layout.operator(DIFF3DS_OT_draw.bl_idname)


CLASSES = (DIFF3DS_OT_draw,)
