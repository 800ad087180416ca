# SPDX-License-Identifier: GPL-3.0-or-later
"""diff3ds Lines: 3D sketches and line drawings of meshes in Blender."""

import bpy

from . import draw_object, import_files, settings

_CLASSES = (*settings.CLASSES, *import_files.CLASSES, *draw_object.CLASSES)


def register() -> None:
    """Adds the operators, their menu entries and the settings."""
    for each in _CLASSES:
        bpy.utils.register_class(each)
    bpy.types.TOPBAR_MT_file_import.append(import_files.entry)
    bpy.types.VIEW3D_MT_object.append(draw_object.entry)


def unregister() -> None:
    """Takes them away again."""
    bpy.types.VIEW3D_MT_object.remove(draw_object.entry)
    bpy.types.TOPBAR_MT_file_import.remove(import_files.entry)
    for each in reversed(_CLASSES):
        bpy.utils.unregister_class(each)
