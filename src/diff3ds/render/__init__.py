"""Strokes to pixels, differentiably: `render` and `render_batch` for sketches, `rasterize` for projected strokes."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import cast

import torch

from diff3ds import _shown
from diff3ds._modes import in_graph, outside_of_graph
from diff3ds._shapes import Float, Tensor
from diff3ds._with_torch import known_to_torch
from diff3ds.camera import Cameras, Size, check_size
from diff3ds.project import Strokes2D, check_devices, project
from diff3ds.render import montecarlo, reference
from diff3ds.render.antialiasing import Analytic, Antialiasing, MonteCarlo, antialiasing_from
from diff3ds.render.autograd import refuse_recording
from diff3ds.render.backends import (
    Backend,
    available_backends,
    choose_backend,
    drawing_device,
    get_num_threads,
    kernel_dtype,
    set_num_threads,
)
from diff3ds.render.checks import Background, canvas_from, check_scene, check_stroke_values, check_strokes
from diff3ds.render.kernel_inputs import Images, kind, of_sketch, of_sketches, of_strokes
from diff3ds.render.kernels import drawn_by
from diff3ds.sketch import Sketch

__all__ = [
    "Analytic",
    "Antialiasing",
    "Backend",
    "MonteCarlo",
    "Rendering",
    "available_backends",
    "get_num_threads",
    "rasterize",
    "render",
    "render_batch",
    "set_num_threads",
]


@known_to_torch
@dataclass(frozen=True, eq=False)
class Rendering:
    """Images of V views, in the dtype of the strokes' colours.

    Attributes:
        color: RGB over the background.
        alpha: fraction of the pixel covered by ink, 0 to 1.
        depth: mean camera depth of the ink, world units; 0 where alpha < 1e-6.
    """

    color: Float[Tensor, "V H W 3"]
    alpha: Float[Tensor, "V H W"]
    depth: Float[Tensor, "V H W"]

    def _repr_png_(self) -> bytes:
        """The views side by side, for notebooks."""
        return _shown.png_of(self)


def render(
    sketch: Sketch,
    cameras: Cameras,
    *,
    background: Background = 1.0,
    antialiasing: Antialiasing = "analytic",
    backend: Backend | None = None,
) -> Rendering:
    """Draws a sketch as all cameras see it: `ds.render` without a surface, which says what the arguments are.

    Raises:
        TypeError, ValueError, RuntimeError: as `ds.render`.
    """
    check_scene(sketch, cameras)
    how = antialiasing_from(antialiasing)
    if in_graph():
        # Imported by those who make graphs only: operators load a second of torch.
        from diff3ds.render import compiled

        if operator := compiled.kernels_for(sketch.points.device.type, sketch.points.dtype, backend):
            return Rendering(*compiled.render(sketch, cameras, background, how, operator))
        if torch.compiler.is_compiling():
            return outside_of_graph(render, sketch, cameras, background=background, antialiasing=how, backend=backend)
    check_devices(sketch, cameras)
    home = sketch.points.device
    place = drawing_device(home)
    chosen = _drawing(len(cameras), choose_backend(backend, place, sketch.points.dtype))
    shape = (len(cameras), *cameras.size, 3)
    canvas = canvas_from(background, sketch.color, shape)
    dtype = sketch.points.dtype
    drawn = dtype if chosen == "reference" else kernel_dtype(dtype)
    if place != home:
        sketch, cameras, canvas = sketch.to(place), cameras.to(place), canvas.to(place)
    if drawn != dtype:
        sketch, canvas = sketch.to(drawn), canvas.to(drawn)
    try:
        if chosen == "reference":
            images = _by_reference(project(sketch, cameras), cameras.size, canvas, how)
        else:
            images = drawn_by(chosen, of_sketch(sketch, cameras, canvas, how, chosen))
        as_given = place == home and drawn == dtype
        return Rendering(*(images if as_given else (image.to(home, dtype) for image in images)))
    except ValueError:
        # The kernels only know that some value is bad; say which.
        sketch.check_values()
        check_stroke_values(project(sketch, cameras))
        raise


def render_batch(
    sketches: Sequence[Sketch],
    cameras: Cameras | Sequence[Cameras],
    *,
    background: Background = 1.0,
    antialiasing: Antialiasing = "analytic",
    backend: Backend | None = None,
) -> list[Rendering]:
    """Draws many sketches, each as its own cameras see it: what a loop over `render` gives to the last bit, but faster.

    Sketches may have any number of strokes, none as well, and each any number of views. Those that agree in degree,
    kind of width, dtype, device, size of the images and kind of camera are drawn by one call of the kernels. The
    reference, and Monte Carlo antialiasing, draw one sketch after the other.

    Args:
        sketches: B of them.
        cameras: B, or one for all.
        background: of every sketch, as of `render`.
        antialiasing: as of `render`; sketches draw from a generator of `MonteCarlo` one after the other.
        backend: as of `render`, of all sketches.

    Raises:
        TypeError, ValueError, RuntimeError: as `render`; the message names the sketch by its place among them.
    """
    how = antialiasing_from(antialiasing)
    if torch.compiler.is_compiling():
        return outside_of_graph(
            render_batch, sketches, cameras, background=background, antialiasing=how, backend=backend
        )
    seen = [cameras] * len(sketches) if isinstance(cameras, Cameras) else list(cameras)
    if len(seen) != len(sketches):
        raise ValueError(f"there must be as many cameras as sketches, {len(sketches)}, or one for all, got {len(seen)}")
    groups: dict[tuple[object, ...], list[int]] = {}
    for k, (sketch, views) in enumerate(zip(sketches, seen, strict=True)):
        with _naming(k):
            groups.setdefault(_together(sketch, views, how, backend) or (k,), []).append(k)
    drawn: dict[int, Rendering] = {}
    for group in groups.values():
        if len(group) > 1:
            parts = [sketches[k] for k in group], [seen[k] for k in group]
            try:
                drawn |= dict(
                    zip(group, _drawn_together(*parts, background, cast(Analytic, how), backend), strict=True)
                )
                continue
            except ValueError:
                # One after the other, they say which it was.
                pass
        for k in group:
            with _naming(k):
                drawn[k] = render(sketches[k], seen[k], background=background, antialiasing=how, backend=backend)
    return [drawn[k] for k in range(len(sketches))]


def _together(
    sketch: Sketch, cameras: Cameras, antialiasing: Analytic | MonteCarlo, backend: Backend | None
) -> tuple[object, ...] | None:
    """What sketches that are drawn in one call have in common; None for one that is drawn by itself."""
    if not isinstance(sketch, Sketch) or not isinstance(cameras, Cameras):
        got = f"{type(sketch).__name__} and {type(cameras).__name__}"
        raise TypeError(f"render_batch takes sketches and Cameras, got {got}")
    check_devices(sketch, cameras)
    home = sketch.points.device
    chosen = choose_backend(backend, drawing_device(home), sketch.points.dtype)
    alone = chosen == "reference" or not len(cameras) or drawing_device(home) != home
    return None if alone or isinstance(antialiasing, MonteCarlo) else kind(sketch, cameras)


def _drawn_together(
    sketches: list[Sketch],
    cameras: list[Cameras],
    background: Background,
    antialiasing: Analytic,
    backend: Backend | None,
) -> list[Rendering]:
    points, size = sketches[0].points, cameras[0].size
    counts = [len(views) for views in cameras]
    canvas = [canvas_from(background, points, (views, *size, 3)) for views in counts]
    # One that all views share stays one.
    apart = any(len(one) > 1 for one in canvas)
    ground = torch.cat([c.expand(n, -1, -1, -1) for c, n in zip(canvas, counts, strict=True)]) if apart else canvas[0]
    dtype = points.dtype
    raised = kernel_dtype(dtype)
    if raised != dtype:
        sketches, ground = [sketch.to(raised) for sketch in sketches], ground.to(raised)
    chosen = choose_backend(backend, points.device, dtype)
    images = drawn_by(chosen, of_sketches(sketches, cameras, ground, antialiasing, chosen))
    parts = zip(*(torch.split(image.to(dtype), counts) for image in images), strict=True)
    return [Rendering(*part) for part in parts]


@contextmanager
def _naming(sketch: int) -> Iterator[None]:
    """Inside, errors say which sketch of a batch they are about."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise type(error)(f"sketch {sketch} of the batch: {error}") from error


def rasterize(
    strokes: Strokes2D,
    size: Size,
    *,
    background: Background = 1.0,
    antialiasing: Antialiasing = "analytic",
    backend: Backend | None = None,
) -> Rendering:
    """Draws projected strokes; `size` is that of the images, an int or (height, width). The rest as `render`.

    Raises:
        TypeError, ValueError: as `render`.
    """
    how = antialiasing_from(antialiasing)
    if torch.compiler.is_compiling():
        return outside_of_graph(rasterize, strokes, size, background=background, antialiasing=how, backend=backend)
    size = check_size(size)
    check_strokes(strokes)
    chosen = _drawing(len(strokes.cubics), choose_backend(backend, strokes.color.device, strokes.color.dtype))
    shape = (len(strokes.cubics), *size, 3)
    canvas = canvas_from(background, strokes.color, shape)
    dtype = strokes.color.dtype
    try:
        if chosen == "reference":
            return Rendering(*_by_reference(strokes, size, canvas, how))
        drawn = kernel_dtype(dtype)
        if drawn == dtype:
            return Rendering(*drawn_by(chosen, of_strokes(strokes, size, canvas, how)))
        names = ("half_width", "color", "opacity")
        raised = replace(strokes, **{name: getattr(strokes, name).to(drawn) for name in names})
        images = drawn_by(chosen, of_strokes(raised, size, canvas.to(drawn), how))
        return Rendering(*(image.to(dtype) for image in images))
    except ValueError:
        check_stroke_values(strokes)
        raise


def _drawing(views: int, chosen: Backend) -> Backend:
    # No views are no work for kernels: a GPU refuses a grid without blocks.
    return chosen if views else "reference"


def _by_reference(
    strokes: Strokes2D, size: tuple[int, int], canvas: Tensor, antialiasing: Analytic | MonteCarlo
) -> Images:
    refuse_recording()
    check_stroke_values(strokes)
    if isinstance(antialiasing, Analytic):
        return reference.rasterize(strokes, size, canvas, antialiasing.blur)
    return montecarlo.rasterize(strokes, size, canvas, math.isqrt(antialiasing.samples), antialiasing.seed())
