"""The CUDA kernels as one differentiable operation."""

from typing import Any, NamedTuple, cast

import torch
from torch.autograd.function import once_differentiable

from diff3ds._shapes import Float, Tensor
from diff3ds.project import Strokes2D
from diff3ds.render.arguments import InvalidStrokeError
from diff3ds.render.cuda.device import Device, device_for
from diff3ds.render.cuda.job import COUNTERS, SUMS, Job, Shape, arrays
from diff3ds.render.cuda.limits import Limits
from diff3ds.render.reference import Images, blur_sigma, reach

# Lists that the forward pass counts.
COUNTED_FORWARD = 5

_limits: dict[tuple[object, ...], Limits] = {}


class Options(NamedTuple):
    """What the kernels need besides tensors. strata: samples per pixel and direction, 0 for analytic antialiasing."""

    world: bool
    near: float
    blur: float
    strata: int
    seed: int


def rasterize(
    strokes: Strokes2D,
    size: tuple[int, int],
    background: Float[Tensor, "V1 H1 W1 3"],
    blur: float,
    strata: int,
    seed: int,
) -> Images:
    """Colour, alpha and depth; the background's first three axes may be 1.

    Raises:
        InvalidStrokeError: a stroke with a value that cannot be drawn, in this call or, once calls no longer wait for
            the device, in one before.
        RuntimeError: a graph is captured, and no drawing before it has shown how much memory this one needs.
    """
    options = Options(strokes.width_space == "world", strokes.near, blur, strata, seed)
    tensors = (strokes.cubics, strokes.half_width, strokes.color, strokes.opacity, background)
    if torch.is_grad_enabled() and any(t.requires_grad for t in tensors):
        return cast(Images, _Rasterize.apply(*tensors, size, options))  # type: ignore[no-untyped-call]
    return _forward(tensors, size, options, save=False)[0]


class _Drawing(NamedTuple):
    """What a forward pass leaves: the job, its memory, and what ran it."""

    job: Job
    memory: dict[str, Tensor]
    lengths: dict[str, int]
    shape: Shape
    limits: Limits
    device: Device


def _forward(
    tensors: tuple[Tensor, ...], size: tuple[int, int], options: Options, save: bool
) -> tuple[Images, _Drawing]:
    cubics, half_width, color, opacity, background = (t.detach() for t in tensors)
    views, count = cubics.shape[:2]
    shape = Shape(views, count, *size, options.strata, color.element_size(), save)
    device = device_for(color.device, color.dtype)
    limits = _remembered(shape, color, device)
    images = tuple(color.new_empty(views, *size, *rest) for rest in ((3,), (), ()))
    inputs = {
        "cubics": cubics.contiguous(),
        "half_width": half_width.contiguous(),
        "color": color.contiguous(),
        "opacity": opacity.contiguous(),
        "background": background.contiguous().expand(views, *size, 3),
    }
    job = _job(shape, options, inputs["background"], len(half_width) > 1)
    # The images are not kept with the rest: they would hold what made them, and never be freed.
    job.point(inputs | dict(zip(("out_color", "out_alpha", "out_depth"), images, strict=True)))
    # Without gradients somebody wants the picture itself, and reads it at once.
    waiting = _must_wait(device, limits, shape, "forward") or not (save or device.capturing())
    if save and shape.strata and device.capturing():
        _must_wait(device, limits, shape, "backward")
    memory: dict[str, Tensor] = {}
    while True:
        # Until it fits: each pass counts at least one list further. What was too short is freed first.
        memory.clear()
        lengths = dict(limits.length)
        memory |= inputs | _work(shape, lengths, color.device)
        _draw(device, job, memory, lengths, limits)
        if not waiting or _settled(device, limits, shape, "forward"):
            break
    if not device.capturing() and limits.take_bad():
        raise InvalidStrokeError("a stroke of this drawing, or of one before it, cannot be drawn")
    return cast(Images, images), _Drawing(job, memory, lengths, shape, limits, device)


def _remembered(shape: Shape, like: Tensor, device: Device) -> Limits:
    key = (like.device, like.dtype, shape.views, shape.height, shape.width, shape.strata)
    if key not in _limits:
        if device.capturing():
            raise _unknown_needs(shape)
        _limits[key] = Limits(device.report(COUNTERS))
    _limits[key].guess(shape)
    return _limits[key]


def _must_wait(device: Device, limits: Limits, shape: Shape, which: str) -> bool:
    """Whether a pass has to look at what it needed.

    Raises:
        RuntimeError: it has to, and cannot while a graph is captured.
    """
    unproven = not limits.may_skip_waiting(shape, which, device.capturing())
    if unproven and device.capturing():
        raise _unknown_needs(shape)
    return unproven


def _unknown_needs(shape: Shape) -> RuntimeError:
    return RuntimeError(
        f"draw a picture of this kind with {shape.strokes} strokes or more, and its backward if one is wanted, once "
        "before the capture: it finds how much memory they need"
    )


def _settled(device: Device, limits: Limits, shape: Shape, which: str) -> bool:
    device.wait()
    return limits.enough(shape, which)


def _job(shape: Shape, options: Options, background: Tensor, half_width_per_view: bool) -> Job:
    job = Job(seed=options.seed, near=options.near, world=options.world, half_width_per_view=half_width_per_view)
    for name in ("views", "strokes", "height", "width", "tiles_x", "tiles_y", "strata", "save"):
        setattr(job, name, getattr(shape, name))
    job.background_view, job.background_row, job.background_pixel = background.stride()[:3]
    job.inv_sigma = 1 / blur_sigma(options.blur) if options.blur > 0 else 0
    # Samples have no filter.
    job.filter_reach = 0 if shape.strata else reach(options.blur)
    return job


def _work(shape: Shape, lengths: dict[str, int], device: torch.device) -> dict[str, Tensor]:
    return arrays(shape.zeroed(), device, zeros=True) | arrays(shape.forward(lengths), device)


def _draw(device: Device, job: Job, memory: dict[str, Tensor], lengths: dict[str, int], limits: Limits) -> None:
    job.point(memory)
    job.report = limits.report.data_ptr()
    job.limit[:] = list(lengths.values())
    tiles = job.views * job.tiles_x * job.tiles_y
    for part in ("pieces", "chords", "pairs"):
        device.launch(f"count_{part}", device.strides, job)
        device.launch(f"place_{part}", 2 if part == "pairs" else 1, job)
        device.launch(f"write_{part}", device.strides, job)
    device.launch("group_tiles", tiles, job)
    device.launch("draw_world" if job.world else "draw_image", tiles, job)
    device.launch("conclude_drawing", device.strides, job)


class _Rasterize(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> Images:
        *tensors, size, options = inputs
        ctx.set_materialize_grads(False)
        images, ctx.drawing = _forward(tuple(tensors), size, options, save=True)
        # The job points to them: saved, they live, and a change of one before the backward is an error.
        ctx.save_for_backward(images[1], images[2], tensors[4])
        return images

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *upstream: Tensor | None) -> tuple[Tensor | None, ...]:
        *_, background = ctx.saved_tensors
        drawing: _Drawing = ctx.drawing
        g_cubics, g_look, g_background = _backward(drawing, upstream, ctx.needs_input_grad[4])
        dtype = background.dtype
        half_width, looks = g_look[..., 0], g_look[..., 1:].sum(0)
        half_width = half_width if drawing.job.half_width_per_view else half_width.sum(0, keepdim=True)
        if g_background is not None:
            axes = [k for k, n in enumerate(background.shape) if n == 1]
            g_background = g_background.sum(axes, keepdim=True, dtype=torch.float64) if axes else g_background
            g_background = g_background.to(dtype)
        shared = (half_width.to(dtype), looks[:, 1:].to(dtype), looks[:, 0].to(dtype))
        return (g_cubics, *shared, g_background, None, None)


def _backward(
    drawing: _Drawing, upstream: tuple[Tensor | None, ...], background: bool
) -> tuple[Tensor, Tensor, Tensor | None]:
    """Gradients of the cubics, of the looks in each view, and of the background's pixels."""
    job, memory, lengths, shape, limits, device = drawing
    job, like = job.copy(), memory["color"]
    seen = (shape.views, shape.strokes)
    given = {
        name: None if g is None else g.contiguous()
        for name, g in zip(("g_color", "g_alpha", "g_depth"), upstream, strict=True)
    }
    outputs = {
        "g_cubics": memory["cubics"].new_empty(*seen, 4, 4),
        "g_look": memory["cubics"].new_empty(*seen, 5),
        "g_background": like.new_empty(shape.views, shape.height, shape.width, 3) if background else None,
    }
    job.point(given | outputs)
    waiting = bool(shape.strata) and _must_wait(device, limits, shape, "backward")
    work: dict[str, Tensor] = {}
    while True:
        # Only outlines are counted anew; the lists of the forward pass stay as they are.
        work.clear()
        lengths = lengths | {name: limits.length[name] for name in ("outline", "outline_fragments")}
        work |= arrays(shape.backward(lengths), like.device)
        work["g_run"] = like.new_zeros(lengths["runs"], SUMS)
        if shape.strata:
            work |= _outline_work(shape, lengths, like)
        job.point(work)
        job.limit[:] = list(lengths.values())
        memory["counters"][8 * COUNTED_FORWARD :].zero_()
        _differentiate(device, job)
        if not waiting or _settled(device, limits, shape, "backward"):
            break
    return cast(Tensor, outputs["g_cubics"]), cast(Tensor, outputs["g_look"]), outputs["g_background"]


def _outline_work(shape: Shape, lengths: dict[str, int], like: Tensor) -> dict[str, Tensor]:
    # An outline point is eight numbers and its piece, as long as a multiple of the numbers.
    record = 9 * shape.real
    points = torch.empty(record * lengths["outline"], dtype=torch.uint8, device=like.device).fill_(255)
    counts = torch.zeros(2 * shape.tiles + 1, dtype=torch.int32, device=like.device)
    return {
        "outline": points,
        "outline_tile_first": counts[: shape.tiles + 1],
        "outline_tile_cursor": counts[shape.tiles + 1 :],
    }


def _differentiate(device: Device, job: Job) -> None:
    tiles = job.views * job.tiles_x * job.tiles_y
    kind = "samples" if job.strata else "world" if job.world else "image"
    # World widths need the derivative of depth in any case.
    device.launch(f"differentiate_{kind}{'_depth' if job.g_depth and kind != 'world' else ''}", tiles, job)
    if job.strata:
        device.launch("count_outlines", device.strides, job)
        device.launch("place_outlines", 1, job)
        device.launch("write_outlines", device.strides, job)
        device.launch("place_outline_tiles", 1, job)
        device.launch("scatter_outlines", device.strides, job)
        device.launch("value_outlines_world" if job.world else "value_outlines_image", tiles, job)
        device.launch("sum_outlines", device.strides, job)
    device.launch("finish_gradients", device.strides, job)
    device.launch("conclude_gradients", 1, job)
