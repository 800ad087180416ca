"""Filled and stroked contours on a sheet, painted over each other, by exact areas of pixels, with gradients."""

from dataclasses import fields

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int, Tensor
from diff3ds.render.areas import on_cpu, on_cuda
from diff3ds.render.areas.flat_contours import layer_edges
from diff3ds.render.areas.layer_kernels import drawn
from diff3ds.render.areas.painted_layers import EVEN_ODD, LINEAR, NONZERO, PLAIN, RADIAL, STROKE, Layers, check_layers
from diff3ds.render.areas.painting import painted
from diff3ds.render.areas.pixel_areas import covered
from diff3ds.render.backends import Backend, available_backends, choose_backend, kernels

__all__ = ["EVEN_ODD", "LINEAR", "NONZERO", "PLAIN", "RADIAL", "STROKE", "Layers", "covered_pixels", "draw_layers"]


def draw_layers(
    layers: Layers,
    width: int,
    height: int,
    background: Float[Tensor, "H W 4"] | None = None,
    *,
    backend: Backend | None = None,
) -> Float[Tensor, "H W 4"]:
    """Paints layers over a background, which is empty if there is none.

    What a layer covers of a pixel is its exact area there (curves within .01 px of chords). Coverages of several layers
    in one pixel count as independent of each other. On an NVIDIA GPU the CUDA kernels draw; layers on another device
    are drawn on the CPU, and the picture and gradients moved back.

    Returns:
        Straight colour times what is covered, and alpha: what DiffVG's samples are in the mean.

    Raises:
        TypeError, ValueError: tables that do not belong together, or values that cannot be drawn.
    """
    if not isinstance(layers, Layers):
        raise TypeError(f"layers must be Layers, the tables of what is painted, got {type(layers).__name__}")
    device = layers.points.device
    if backend is None and device.type == "cuda" and "cuda" in available_backends():
        backend = "cuda"
    if device.type != "cpu" and backend != "cuda":
        here = Layers(*(getattr(layers, field.name).cpu() for field in fields(Layers)))
        below = None if background is None else background.cpu()
        return draw_layers(here, width, height, below, backend=backend).to(device)
    check_layers(layers, (width, height), background)
    chosen = choose_backend(backend, device, layers.points.dtype)
    if chosen == "reference":
        return painted(layers, width, height, background)
    return drawn(on_cuda if chosen == "cuda" else on_cpu, layers, width, height, background)


def covered_pixels(
    layers: Layers, width: int, height: int, *, backend: Backend | None = None
) -> list[tuple[Int[Index, " n"], Float[Array, " n"]]]:
    """What each layer covers: pixels, row by row one after the other, and how much of each, in (0, 1]; on the CPU.

    For those who paint in ways that `draw_layers` does not know. Has no gradients.

    Raises:
        TypeError, ValueError: as `draw_layers`.
    """
    check_layers(layers, (width, height), None)
    fast = hasattr(kernels(), "areas_covered")
    if fast and choose_backend(backend, layers.points.device, layers.points.dtype) == "cpu":
        return on_cpu.covered(layers.values(), layers.tables(), (width, height))
    found = []
    for row, rule in enumerate(layers.layers[:, 2].tolist()):
        edges = layer_edges(layers, row).detach().double()
        share = covered(edges, rule, width, height).flatten().numpy() if len(edges) else np.zeros(0)
        pixels = share.nonzero()[0]
        found.append((pixels, share[pixels]))
    return found
