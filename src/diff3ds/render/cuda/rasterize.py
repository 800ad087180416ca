"""The CUDA kernels as `autograd` takes them: from curves, in space or projected, to images, and back."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import cast

import torch

from diff3ds._shapes import Tensor
from diff3ds.render.autograd import Gradients, Upstream
from diff3ds.render.checks import InvalidStrokeError
from diff3ds.render.cuda.device import Device, device_for
from diff3ds.render.cuda.job import COUNTERS, Arrays, Job, Shape
from diff3ds.render.cuda.limits import Limits
from diff3ds.render.kernel_inputs import Images, KernelInputs, Options
from diff3ds.render.reference import blur_sigma, reach

# Lists that the forward pass counts.
COUNTED_FORWARD = 5
# The gradients of what is given, in `Job`.
GRADIENTS = {
    "half_width": "g_widths",
    "color": "g_colors",
    "opacity": "g_opacities",
    "background": "g_background",
    "square": "g_squares",
    "cubics": "g_cubics",
    "points": "g_points",
    "weights": "g_weights",
    "matrices": "g_matrices",
}

_limits: dict[tuple[object, ...], Limits] = {}


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What a forward pass leaves: the job, what it points to, and what ran it."""

    job: Job
    tensors: dict[str, Tensor]
    work: list[Arrays]
    lengths: dict[str, int]
    shape: Shape
    limits: Limits
    device: Device


def forward(inputs: KernelInputs, save: bool) -> tuple[Images, _Drawn]:
    """The images, and what `backward` needs of them.

    Raises:
        InvalidStrokeError: a stroke with a value that cannot be drawn, in this call or, once calls no longer wait for
            the device, in one before.
        RuntimeError: a graph is captured, and no drawing before it has shown how much memory this one needs.
    """
    color, size = inputs.appearance[1], inputs.size
    shape = _shape(inputs, save)
    device = device_for(color.device, color.dtype)
    limits = _remembered(shape, color, device)
    images = tuple(color.new_empty(shape.views, *size, *rest) for rest in ((3,), (), ()))
    tensors = _tensors(inputs, shape)
    job = _job(shape, inputs.options, tensors)
    # The images are not kept with the rest: they would hold what made them, and never be freed.
    job.point(tensors | dict(zip(("out_color", "out_alpha", "out_depth"), images, strict=True)))
    # Without gradients somebody wants the picture itself, and reads it at once.
    waiting = _must_wait(device, limits, shape, "forward") or not (save or device.capturing())
    if save and shape.strata and device.capturing():
        _must_wait(device, limits, shape, "backward")
    work: list[Arrays] = []
    while True:
        # Until it fits: each pass counts at least one list further. What was too short is freed first.
        work.clear()
        lengths = dict(limits.length)
        with _remembering_less(device, limits, shape):
            work.append(Arrays(shape.forward(lengths), color.device))
        _run(device, job, work, lengths, limits)
        if not waiting or _settled(device, limits, shape, "forward"):
            break
    if not device.capturing() and limits.take_bad():
        raise InvalidStrokeError("a stroke of this drawing, or of one before it, cannot be drawn")
    return cast(Images, images), _Drawn(job, tensors, work, lengths, shape, limits, device)


def _shape(inputs: KernelInputs, save: bool) -> Shape:
    first, color = inputs.curves[0], inputs.appearance[1]
    projected = len(inputs.curves) == 1
    views = len(inputs.curves[-1])
    controls = 0 if projected else first.shape[1]
    segments = first.shape[0 if controls else 1]
    rows = None if inputs.batch is None else inputs.batch.rows
    strata, real = inputs.options.strata, color.element_size()
    return Shape(views, len(color), segments, *inputs.size, strata, real, save, controls, rows)


def _tensors(inputs: KernelInputs, shape: Shape) -> dict[str, Tensor]:
    curves = ("points", "weights", "matrices") if shape.controls else ("cubics",)
    names = ("half_width", "color", "opacity", "background", "square", *curves)
    tensors = {name: t.detach().contiguous() for name, t in zip(names, inputs.tensors(), strict=True)}
    tensors["background"] = tensors["background"].expand(shape.views, *inputs.size, 3)
    if inputs.chains is not None:
        chains = inputs.chains
        tensors |= {"stroke_first": chains.first, "segment_stroke": chains.stroke, "closed": chains.closed}
    if inputs.cameras is not None:
        tensors["poses"], tensors["intrinsics"] = inputs.cameras
    if inputs.batch is not None:
        tensors["batch"] = inputs.batch.table.to(tensors["color"].device)
    return tensors


def _remembered(shape: Shape, like: Tensor, device: Device) -> Limits:
    key = (like.device, like.dtype, shape.views, shape.height, shape.width, shape.strata, shape.batch)
    if key not in _limits:
        if device.capturing():
            raise _unknown_needs(shape)
        # Kept: inference mode of the first drawing has no part in it.
        with torch.inference_mode(False):
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


@contextmanager
def _remembering_less(device: Device, limits: Limits, shape: Shape) -> Iterator[None]:
    """Inside, memory may run out: then no later drawing is asked to take as much."""
    try:
        yield
    except torch.OutOfMemoryError:
        if not device.capturing():
            # What is under way still tells its needs.
            device.wait()
            limits.forget(shape)
        raise


def _settled(device: Device, limits: Limits, shape: Shape, which: str) -> bool:
    device.wait()
    return limits.enough(shape, which)


def _job(shape: Shape, options: Options, tensors: dict[str, Tensor]) -> Job:
    job = Job(seed=options.seed, near=options.near, world=options.world, orthographic=options.orthographic)
    widths = tensors["half_width"]
    job.along = widths.ndim == 3
    job.cameras_double = "poses" in tensors and tensors["poses"].dtype == torch.float64
    if shape.batch is None:
        job.half_width_per_view = widths.ndim > 1 and len(widths) > 1
    else:
        job.sketches = tensors["batch"].shape[1] - 1
        job.half_width_per_view = widths.shape[-2 if job.along else -1] != (
            shape.segments if job.along else shape.strokes
        )
    for name in ("views", "strokes", "segments", "height", "width", "tiles_x", "tiles_y", "strata", "save", "controls"):
        setattr(job, name, getattr(shape, name))
    job.background_view, job.background_row, job.background_pixel = tensors["background"].stride()[:3]
    job.inv_sigma = 1 / blur_sigma(options.blur) if options.blur > 0 else 0
    # Samples have no filter.
    job.filter_reach = 0 if shape.strata else reach(options.blur)
    job.width_scale, job.differ_squares = options.width_scale, options.differ_squares
    return job


def _run(device: Device, job: Job, work: list[Arrays], lengths: dict[str, int], limits: Limits) -> None:
    for arrays in work:
        job.point(arrays)
    job.report = limits.report.data_ptr()
    job.limit[:] = list(lengths.values())
    tiles = job.views * job.tiles_x * job.tiles_y
    launches = [("begin_drawing", device.strides)]
    if job.stroke_first:
        launches.append(("measure_strokes", device.strides))
    for part in ("pieces", "chords", "intersections"):
        places = 2 if part == "intersections" else 1
        launches += [(f"count_{part}", device.strides), (f"place_{part}", places), (f"write_{part}", device.strides)]
    launches += [("group_tiles", tiles), (f"draw_{_width(job)}", tiles)]
    device.launch([*launches, ("conclude_drawing", device.strides)], job)


def _width(job: Job) -> str:
    """The kind of width, as kernels are named."""
    kind = "world" if job.world else "image"
    return f"oblong_{kind}" if job.square else kind + ("_along" if job.along else "")


def backward(
    drawn: _Drawn, upstream: Upstream, planes: tuple[Tensor, Tensor], background: Tensor, needs: tuple[bool, ...]
) -> Gradients:
    """Gradients of the appearance and of the curves."""
    # Appearance, then curves, as they were given; contiguous, whatever those were.
    tensors = {name: t for name, t in drawn.tensors.items() if name in GRADIENTS}
    gradients = {GRADIENTS[name]: torch.empty_like(t) for name, t in tensors.items()}
    # The others come along with these; these cost.
    wanted = {"g_background": needs[3], "g_matrices": needs[-1], "g_squares": drawn.job.differ_squares}
    for name in (name for name, is_wanted in wanted.items() if not is_wanted):
        gradients.pop(name, None)
    _backward(drawn, upstream, gradients)
    if "g_background" in gradients:
        gradients["g_background"] = _summed(gradients["g_background"], background)
    return tuple(gradients.get(GRADIENTS[name]) for name in tensors)


def _summed(gradient: Tensor, background: Tensor) -> Tensor:
    """The gradient of what was expanded from a background."""
    axes = [k for k, n in enumerate(background.shape) if n == 1]
    total = gradient.sum(axes, keepdim=True, dtype=torch.float64) if axes else gradient
    return total.to(background.dtype)


def _backward(drawn: _Drawn, upstream: Upstream, gradients: dict[str, Tensor]) -> None:
    """Fills the gradients, by name."""
    kept, lengths, shape, limits, device = drawn.work, drawn.lengths, drawn.shape, drawn.limits, drawn.device
    job, place = drawn.job.copy(), kept[0].memory.device
    given = {
        name: None if g is None else g.contiguous()
        for name, g in zip(("g_color", "g_alpha", "g_depth"), upstream, strict=True)
    }
    job.point(given | gradients)
    waiting = bool(shape.strata) and _must_wait(device, limits, shape, "backward")
    work: list[Arrays | dict[str, Tensor]] = []
    while True:
        # Only outlines are counted anew; the lists of the forward pass stay as they are.
        work.clear()
        lengths = lengths | {name: limits.length[name] for name in ("outline", "outline_fragments")}
        with _remembering_less(device, limits, shape):
            work.append(Arrays(shape.backward(lengths, bool(job.differ_squares)), place))
            if shape.strata:
                work.append(_outline_work(shape, lengths, place))
        if shape.strata:
            kept[0]["counters"][8 * COUNTED_FORWARD :].zero_()
        _differentiate(device, job, work, lengths)
        if not waiting or _settled(device, limits, shape, "backward"):
            break


def _outline_work(shape: Shape, lengths: dict[str, int], device: torch.device) -> dict[str, Tensor]:
    # An outline point is eight numbers and its piece, as long as a multiple of the numbers.
    record = 9 * shape.real
    points = torch.empty(record * lengths["outline"], dtype=torch.uint8, device=device).fill_(255)
    counts = torch.zeros(2 * shape.tiles + 1, dtype=torch.int32, device=device)
    return {
        "outline": points,
        "outline_tile_first": counts[: shape.tiles + 1],
        "outline_tile_cursor": counts[shape.tiles + 1 :],
    }


def _differentiate(device: Device, job: Job, work: list[Arrays | dict[str, Tensor]], lengths: dict[str, int]) -> None:
    for arrays in work:
        job.point(arrays)
    job.limit[:] = list(lengths.values())
    tiles, strides = job.views * job.tiles_x * job.tiles_y, device.strides
    kind = "samples" if job.strata else _width(job)
    # Other widths need the derivative of the closest point's parameter in any case.
    depth = "_depth" if job.g_depth and kind in ("samples", "image") else ""
    if depth and job.strata and job.square:
        kind = "samples_oblong"
    launches = [(f"differentiate_{kind}{depth}", tiles)]
    if job.strata:
        launches += [("count_outlines", strides), ("place_outlines", 1), ("write_outlines", strides)]
        launches += [("place_outline_tiles", 1), ("scatter_outlines", strides)]
        launches += [(f"value_outlines_{_width(job)}", tiles), ("sum_outlines", strides)]
    launches += [("finish_gradients", strides), ("gather_strokes", strides)]
    if job.g_matrices:
        launches.append(("gather_cameras", job.views))
    if job.strata:
        # Nothing else is counted here.
        launches.append(("conclude_gradients", 1))
    device.launch(launches, job)
