"""Strokes to pixels, differentiably: `render` for sketches and cameras, `rasterize` for strokes already projected."""

from dataclasses import dataclass
from importlib import import_module
from typing import cast

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, Size, check_size
from diff3ds.project import Strokes2D, check_devices, project
from diff3ds.render import autograd, montecarlo, reference
from diff3ds.render.arguments import (
    Antialiasing,
    Background,
    InvalidStrokeError,
    canvas_from,
    check_blur,
    check_stroke_values,
    check_strokes,
    seed_from,
    strata_from,
)
from diff3ds.render.backends import (
    Backend,
    available_backends,
    choose_backend,
    get_num_threads,
    set_num_threads,
)
from diff3ds.sketch import Sketch

__all__ = [
    "Antialiasing",
    "Backend",
    "Rendering",
    "available_backends",
    "get_num_threads",
    "rasterize",
    "render",
    "set_num_threads",
]


@dataclass(frozen=True, eq=False)
class Rendering:
    """Images of V views, in the dtype of the strokes' colours.

    Attributes:
        color: RGB over the background.
        alpha: share of the pixel covered by ink, 0 to 1.
        depth: mean camera depth of the ink, world units; 0 where alpha < 1e-6.
    """

    color: Float[Tensor, "V H W 3"]
    alpha: Float[Tensor, "V H W"]
    depth: Float[Tensor, "V H W"]


def render(
    sketch: Sketch,
    cameras: Cameras,
    *,
    background: Background = 1.0,
    antialiasing: Antialiasing = "analytic",
    blur: float = 0.0,
    samples: int = 4,
    generator: torch.Generator | None = None,
    backend: Backend | None = None,
) -> Rendering:
    """Draws a sketch as all cameras see it.

    Differentiable with respect to every tensor of the sketch, the cameras' poses and intrinsics, and the background.
    Strokes are sorted by depth in every pixel, where they cross as well. No gradient knows of two things: of the places
    where overlapping strokes change their order in depth, and of where the near plane cuts a stroke.

    Args:
        background: gray or RGB value, or a tensor that broadcasts to (V, H, W, 3).
        antialiasing: "analytic" (exact for strips along the axes; elsewhere within about .05 of the share of a pixel
            along an edge, .09 for lines thinner than a pixel) or "montecarlo" (the paper's estimator:
            noisy, unbiased in colour and alpha).
        blur: standard deviation of a normal filter in pixels; gradients then reach 3.5 times as far beyond the strokes.
            0 is the box of a pixel. Analytic only.
        samples: samples per pixel, a square number. Monte Carlo only.
        generator: source of the samples; None is torch's default generator. Monte Carlo only.
        backend: "reference", "cpu", "cuda", or None for the best there is for these tensors.

    Raises:
        TypeError, ValueError: arguments that do not fit each other, or values out of range; the message names the
            argument, the stroke, the value and what was expected.
    """
    if not isinstance(sketch, Sketch) or not isinstance(cameras, Cameras):
        got = f"{type(sketch).__name__} and {type(cameras).__name__}"
        raise TypeError(f"render takes a Sketch and Cameras, got {got}")
    check_devices(sketch, cameras)
    chosen = choose_backend(backend, sketch.points.device, sketch.points.dtype)
    strokes = autograd.project(sketch, cameras) if chosen == "cpu" else project(sketch, cameras)
    try:
        return rasterize(
            strokes,
            cameras.size,
            background=background,
            antialiasing=antialiasing,
            blur=blur,
            samples=samples,
            generator=generator,
            backend=chosen,
        )
    except InvalidStrokeError:
        sketch.check_values()
        raise


def rasterize(
    strokes: Strokes2D,
    size: Size,
    *,
    background: Background = 1.0,
    antialiasing: Antialiasing = "analytic",
    blur: float = 0.0,
    samples: int = 4,
    generator: torch.Generator | None = None,
    backend: Backend | None = None,
) -> Rendering:
    """Draws projected strokes; `size` is that of the images, an int or (height, width). The rest as `render`.

    Raises:
        TypeError, ValueError: as `render`.
    """
    size = check_size(size)
    check_strokes(strokes)
    chosen = choose_backend(backend, strokes.color.device, strokes.color.dtype)
    canvas = canvas_from(background, strokes.color, (len(strokes.cubics), *size, 3))
    check_blur(blur, antialiasing)
    strata, seed = (strata_from(samples), seed_from(generator)) if antialiasing == "montecarlo" else (0, 0)
    if chosen != "reference":
        return Rendering(*_drawn_by_kernels(chosen, strokes, size, canvas, blur, strata, seed))
    check_stroke_values(strokes)
    if strata:
        return Rendering(*montecarlo.rasterize(strokes, size, canvas, strata, seed))
    return Rendering(*reference.rasterize(strokes, size, canvas, blur))


def _drawn_by_kernels(
    backend: Backend, strokes: Strokes2D, size: tuple[int, int], canvas: Tensor, blur: float, strata: int, seed: int
) -> autograd.Images:
    # Imported by those who draw with it only.
    draw = autograd.rasterize if backend == "cpu" else import_module("diff3ds.render.cuda.rasterize").rasterize
    try:
        return cast(autograd.Images, draw(strokes, size, canvas, blur, strata, seed))
    except ValueError:
        # The kernels only know that some value is bad; say which.
        check_stroke_values(strokes)
        raise
