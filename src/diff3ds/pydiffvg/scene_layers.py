"""The tensors of a scene as what `render.areas` paints: a few operations for all of them, whatever their number."""

import math
from collections.abc import Sequence

import numpy as np
import torch

from diff3ds._shapes import Float, Index, Tensor
from diff3ds.pydiffvg.scene_classes import LinearGradient, RadialGradient
from diff3ds.pydiffvg.scene_tables import ARCS, Outlines, Paint, Scene, flat, joined
from diff3ds.render.areas import LINEAR, PLAIN, RADIAL, STROKE, Layers

_GRADIENTS = (LinearGradient, RadialGradient)


def layers_of(scene: Scene, width: int, height: int, device: torch.device) -> Layers:
    """What is painted on a sheet of so many pixels, to which the canvas is scaled; float64 if points of paths are.

    Raises:
        ValueError: values that are not finite, a transform that is not affine, stops that do not rise.
    """
    outlines, paints = scene.outlines, scene.paints
    points = _points(outlines, device)
    _check_finite("points", points, outlines.shape_of_point, "shape")
    half_widths = points.new_zeros(len(points))
    if (scene.layers[:, 2] == STROKE).any():
        rows = torch.from_numpy(outlines.width_of_point).to(device)
        half_widths = _flat(outlines.widths).to(points)[rows].clamp(min=0)
        _check_finite("stroke_width", half_widths, outlines.shape_of_point, "shape")
    to_pixels = points.new_tensor([width / scene.canvas[0], height / scene.canvas[1]])
    stops, offsets, colors = _colors(paints, points)
    owner = np.repeat([paint.group for paint in paints], stops)
    _check_finite("colours", colors, owner, "group")
    _check_finite("offsets", offsets, owner, "group")
    kinds = [
        LINEAR if isinstance(c, LinearGradient) else RADIAL if isinstance(c, RadialGradient) else PLAIN
        for _, _, c in paints
    ]
    canvas = np.full(len(paints), len(scene.transforms))
    return Layers(
        points=points,
        half_widths=half_widths,
        inner=_table(outlines.inner),
        contours=_table(scene.contours),
        layers=_table(scene.layers),
        transforms=_transforms(scene.transforms, to_pixels),
        paints=_table(np.stack([kinds, np.cumsum(stops) - stops, stops, canvas], 1)),
        axes=_axes(paints, points),
        offsets=offsets,
        colors=colors,
    )


def _table(values: Index) -> Tensor:
    return torch.from_numpy(values.astype(np.int32))


def _flat(tensors: Sequence[Tensor]) -> Tensor:
    """The values of tensors, one after the other, where the first is."""
    device = tensors[0].device
    if all(each.ndim == 0 for each in tensors):
        return joined(tensors, torch.stack, device)
    return joined([flat(each) for each in tensors], torch.cat, device)


def _points(outlines: Outlines, device: torch.device) -> Float[Tensor, "P 2"]:
    """Of paths and polygons, then of circles and ellipses, then of rectangles."""
    parts = [joined(outlines.points, torch.cat, device)] if outlines.points else []
    dtype = torch.float64 if parts and parts[0].dtype == torch.float64 else torch.float32
    if outlines.radii:
        centers, radii = joined(outlines.centers, torch.stack, device), [each.expand(2) for each in outlines.radii]
        parts.append(
            (centers[:, None] + joined(radii, torch.stack, device)[:, None] * _unit_circle(device)).flatten(0, 1)
        )
    if outlines.corners:
        x, y = joined(outlines.corners, torch.stack, device).view(-1, 2, 2).unbind(-1)
        parts.append(torch.stack([x[:, [0, 1, 1, 0]], y[:, [0, 0, 1, 1]]], -1).flatten(0, 1))
    return torch.cat(parts).to(dtype)


def _unit_circle(device: torch.device) -> Float[Tensor, "A 2"]:
    """Control points of arcs of one eighth, from x to y."""
    step = 2 * math.pi / ARCS
    reach = 4 / 3 * math.tan(step / 4)
    angle = torch.arange(ARCS, device=device) * step
    along, across = torch.stack([angle.cos(), angle.sin()], -1), torch.stack([-angle.sin(), angle.cos()], -1)
    begins, ends = along + reach * across, (along - reach * across).roll(-1, 0)
    return torch.stack([along, begins, ends], 1).flatten(0, 1)


def _colors(paints: Sequence[Paint], like: Tensor) -> tuple[Index, Tensor, Tensor]:
    """How many stops each paint has, and the offsets and colours of all."""
    gradients = [isinstance(paint.color, _GRADIENTS) for paint in paints]
    colors = _flat([c.stop_colors if isinstance(c, _GRADIENTS) else c for _, _, c in paints]).to(like).view(-1, 4)
    if not any(gradients):
        return np.ones(len(paints), dtype=np.int64), colors.new_zeros(len(colors)), colors
    zero = like.new_zeros(1)
    stops = [c.offsets if isinstance(c, _GRADIENTS) else zero for _, _, c in paints]
    return np.array([len(each) for each in stops]), _flat(stops).to(like), colors


def _axes(paints: Sequence[Paint], like: Tensor) -> Float[Tensor, "Q 4"]:
    """Where gradients of colours lie on the canvas: DiffVG has them there, whatever transforms its shapes."""
    axes = like.new_zeros(len(paints), 4)
    places = [place for place, paint in enumerate(paints) if isinstance(paint.color, _GRADIENTS)]
    if not places:
        return axes
    ends = [
        end
        for _, _, c in paints
        if isinstance(c, _GRADIENTS)
        for end in ((c.begin, c.end) if isinstance(c, LinearGradient) else (c.center, c.radius))
    ]
    rows = joined(ends, torch.cat, like.device).to(like).view(-1, 4)
    return axes.index_copy(0, torch.tensor(places, device=like.device), rows)


def _transforms(matrices: Sequence[Tensor], to_pixels: Float[Tensor, " 2"]) -> Float[Tensor, "T 2 3"]:
    """From the coordinates of each group to pixels, and last from the canvas."""
    whole = joined(matrices, torch.stack, to_pixels.device).to(to_pixels)
    _check_finite("shape_to_canvas", whole, np.arange(len(whole)), "group")
    last = (whole[:, 2] == whole.new_tensor([0.0, 0.0, 1.0])).all(1)
    if not bool(last.all()):
        group = int(last.int().argmin())
        got = whole[group, 2].tolist()
        raise ValueError(f"shape_to_canvas of group {group} must be affine, with a last row of 0, 0, 1, got {got}")
    canvas = torch.eye(3, dtype=whole.dtype, device=whole.device)[None]
    return torch.cat([whole, canvas])[:, :2] * to_pixels[:, None]


def _check_finite(name: str, values: Tensor, owner: Index, what: str) -> None:
    """Raises ValueError for NaN and infinity; `owner` says which shape or group each row belongs to."""
    finite = values.detach().isfinite()
    if not bool(finite.all()):
        row = int(finite.flatten(1).all(1).int().argmin()) if values.ndim > 1 else int(finite.int().argmin())
        raise ValueError(f"{name} of {what} {owner[row]} must be finite, got NaN or infinity")
