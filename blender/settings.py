# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of the extension: where diff3ds is."""

import shutil

import bpy


class Settings(bpy.types.AddonPreferences):
    """What is asked for in the preferences."""

    bl_idname = __package__

    program: bpy.props.StringProperty(
        name="diff3ds",
        description="The program diff3ds, in the environment where it was installed; empty: the one on the PATH",
        subtype="FILE_PATH",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the setting, and what it leads to."""
        self.layout.prop(self, "program")
        found = program(context)
        self.layout.label(
            text=found or "diff3ds was not found: pip install diff3ds", icon="CHECKMARK" if found else "ERROR"
        )


def program(context: bpy.types.Context) -> str:
    """The program that is run; empty where there is none."""
    known = context.preferences.addons.get(__package__)
    named = known.preferences.program if known and known.preferences else ""
    return shutil.which(bpy.path.abspath(named) if named else "diff3ds") or ""


CLASSES = (Settings,)
