"""Differentiable rendering of 3D rational Bézier strokes, and what is built on it: 3D sketches from pictures."""

from diff3ds import bezier
from diff3ds.camera import Cameras, look_at, orbit
from diff3ds.fit import FitConfig, Rates, Step, fit
from diff3ds.formats import load, save
from diff3ds.project import Strokes2D, project
from diff3ds.refine import NoiseDeletion
from diff3ds.render import Rendering, available_backends, get_num_threads, rasterize, render, set_num_threads
from diff3ds.sketch import Sketch
from diff3ds.transforms import load_transforms, save_transforms

__version__ = "0.1.0"

__all__ = [
    "Cameras",
    "FitConfig",
    "NoiseDeletion",
    "Rates",
    "Rendering",
    "Sketch",
    "Step",
    "Strokes2D",
    "__version__",
    "available_backends",
    "bezier",
    "fit",
    "get_num_threads",
    "load",
    "load_transforms",
    "look_at",
    "orbit",
    "project",
    "rasterize",
    "render",
    "save",
    "save_transforms",
    "set_num_threads",
]
