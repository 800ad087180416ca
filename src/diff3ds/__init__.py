"""Differentiable rendering of 3D rational Bézier strokes, and what is built on it: 3D sketches from pictures.

The public names are imported when they are first used: torch takes seconds, and the command line must answer at once.
"""

import sys
from types import ModuleType

from diff3ds import _shown
from diff3ds._version import __version__

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from diff3ds import bezier, constraints, guidance, library, losses, pydiffvg, styles
    from diff3ds.camera import Cameras, look_at, orbit, sheet
    from diff3ds.chains import Chains
    from diff3ds.formats import load
    from diff3ds.notebook import show
    from diff3ds.optimize import density
    from diff3ds.optimize.config import FitConfig, Rates
    from diff3ds.optimize.fit import Step, fit
    from diff3ds.optimize.strokes import NoiseDeletion
    from diff3ds.project import Strokes2D, project
    from diff3ds.render import (
        Analytic,
        MonteCarlo,
        Rendering,
        available_backends,
        get_num_threads,
        rasterize,
        render_batch,
        set_num_threads,
    )
    from diff3ds.sketch import Sketch
    from diff3ds.surfaces.draw import contours, draw, visible_lines
    from diff3ds.surfaces.hatching.tones import Hatch
    from diff3ds.surfaces.seen_around import by_importance
    from diff3ds.surfaces.shape.load_surface import load_surface
    from diff3ds.surfaces.shape.quadrics import Quadrics
    from diff3ds.surfaces.shape.smooth_surface import smooth_surface
    from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
    from diff3ds.tasks.functions import (
        image_to_sketch,
        mesh_to_sketch,
        points_to_sketch,
        recognise,
        text_to_sketch,
        views_to_sketch,
    )
    from diff3ds.transforms import load_transforms, save_transforms
    from diff3ds.with_surface import render, save

__all__ = [
    "Analytic",
    "Cameras",
    "Chains",
    "FitConfig",
    "Hatch",
    "MonteCarlo",
    "NoiseDeletion",
    "Quadrics",
    "Rates",
    "Rendering",
    "Sketch",
    "Step",
    "Strokes2D",
    "TriangleMesh",
    "__version__",
    "available_backends",
    "bezier",
    "by_importance",
    "constraints",
    "contours",
    "density",
    "draw",
    "fit",
    "get_num_threads",
    "guidance",
    "image_to_sketch",
    "library",
    "load",
    "load_surface",
    "load_transforms",
    "look_at",
    "losses",
    "mesh_to_sketch",
    "orbit",
    "points_to_sketch",
    "project",
    "pydiffvg",
    "rasterize",
    "recognise",
    "render",
    "render_batch",
    "save",
    "save_transforms",
    "set_num_threads",
    "sheet",
    "show",
    "smooth_surface",
    "styles",
    "text_to_sketch",
    "views_to_sketch",
    "visible_lines",
]

# In which module each public name is; the others are modules, one of which lies in a room.
_HOMES = {
    **dict.fromkeys(("Cameras", "look_at", "orbit", "sheet"), "camera"),
    **dict.fromkeys(("FitConfig", "Rates"), "optimize.config"),
    **dict.fromkeys(("Step", "fit"), "optimize.fit"),
    "load": "formats",
    **dict.fromkeys(("render", "save"), "with_surface"),
    **dict.fromkeys(("Strokes2D", "project"), "project"),
    "NoiseDeletion": "optimize.strokes",
    "show": "notebook",
    **dict.fromkeys(
        (
            "Rendering",
            "available_backends",
            "get_num_threads",
            "rasterize",
            "render_batch",
            "set_num_threads",
        ),
        "render",
    ),
    **dict.fromkeys(("Analytic", "MonteCarlo"), "render.antialiasing"),
    "Chains": "chains",
    "Sketch": "sketch",
    "Quadrics": "surfaces.shape.quadrics",
    "TriangleMesh": "surfaces.shape.triangle_mesh",
    "load_surface": "surfaces.shape.load_surface",
    "smooth_surface": "surfaces.shape.smooth_surface",
    **dict.fromkeys(("contours", "draw", "visible_lines"), "surfaces.draw"),
    "Hatch": "surfaces.hatching.tones",
    "by_importance": "surfaces.seen_around",
    **dict.fromkeys(
        ("image_to_sketch", "mesh_to_sketch", "points_to_sketch", "recognise", "text_to_sketch", "views_to_sketch"),
        "tasks.functions",
    ),
    **dict.fromkeys(("load_transforms", "save_transforms"), "transforms"),
}


def __getattr__(name: str) -> "Any":
    """Imports what a public name stands for, at its first use."""
    from importlib import import_module

    if name in _HOMES:
        value = getattr(import_module(f"diff3ds.{_HOMES[name]}"), name)
    elif name in __all__:
        value = import_module("diff3ds.optimize.density" if name == "density" else f"diff3ds.{name}")
    else:
        raise AttributeError(f"module 'diff3ds' has no attribute {name!r}")
    globals()[name] = value
    return value


def _png_of(thing: "Any") -> bytes:
    from diff3ds.notebook import png_of

    return png_of(thing)


_shown.png_of = _png_of


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    """`fit`, `project` and `render` are functions here: the import system does not put the modules in their places."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
