"""Score distillation of a sketch: what `diff3ds text` and `diff3ds image` do once they have a prior."""

import time
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, orbit
from diff3ds.formats import save_png, tile_images
from diff3ds.guidance.denoiser import Denoiser
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.orbits import Orbits
from diff3ds.guidance.recipe import Recipe
from diff3ds.guidance.upload import uploaded
from diff3ds.optimize.checkpoint import read_checkpoint
from diff3ds.optimize.fit import CameraSampler, FitConfig, Objective, Rates, Step, fit
from diff3ds.optimize.strokes import NoiseDeletion
from diff3ds.render import Rendering, available_backends, render
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.tasks.progress import Progress, Report, Stopped
from diff3ds.tasks.results import RunInfo, write_results
from diff3ds.tasks.shown_loss import ShownLoss
from diff3ds.tasks.text_image.distill_options import DistillOptions, Preset, PresetName
from diff3ds.tasks.text_image.reference_view import Reference, followed
from diff3ds.tasks.text_image.sharpen import STEPS, Sharpening

CHECKPOINT, SHEETS = "checkpoint.safetensors", "progress"
# What a preview shows: all around, seen a little from above.
PREVIEWS, PREVIEW_ELEVATION, PREVIEW_SIZE = 8, 15.0, 256


@dataclass(frozen=True, eq=False)
class Commission:
    """What a command wants of a distillation, beside the user's options.

    Attributes:
        about: the subject and the prior, for run.json; a resumed run must have the same.
        guidance: weight of classifier-free guidance where neither options, method nor preset have one.
        preset: where the options name none.
        width: of the strokes at the start, where the options have none.
        color: of the strokes at the start, straight RGB; None is black.
        finish: makes the sketch of the results from that of the last step.
        reference: the picture of `diff3ds image`.
        sharpening: further steps on finer pictures, or None.
        network: which weights the prior has, the device and the precision, for run.json; a resumed run must have the
            same, on any device.
    """

    about: Mapping[str, object]
    guidance: float
    preset: PresetName = "paper"
    width: float = DEFAULT_WIDTH
    color: tuple[float, float, float] | None = None
    finish: Callable[[Sketch], Sketch] = lambda sketch: sketch
    reference: Reference | None = None
    sharpening: Sharpening | None = None
    network: Mapping[str, object] = field(default_factory=dict)


def distill(
    denoiser: Denoiser,
    options: DistillOptions,
    out: Path,
    wanted: Commission,
    report: Report = lambda progress: None,
) -> Sketch:
    """Makes a sketch that a prior likes and writes the folder of the run.

    Ctrl-C ends it early; what was reached is written, then `Stopped` is raised, a KeyboardInterrupt.

    Args:
        denoiser: the prior, conditioned on a phrase or picture.
        options: of the user.
        out: a folder that `claim` has found free.
        wanted: what the command adds to them.
        report: called after every step.

    Raises:
        ValueError: widths that are fitted start outside their range; a checkpoint of another run.
        FloatingPointError: the prior predicts no numbers; says what to do.
    """
    begun = time.perf_counter()
    values, width = options.values(wanted.preset), _width(options, wanted)
    recipe = options.recipe(wanted.guidance, denoiser.group, wanted.preset)
    judge = ScoreDistillation(denoiser, recipe, values.steps, options.seed)
    network = {name: value for name, value in wanted.network.items() if name != "device"}
    identity = {**wanted.about, **network, **_identity(options, values, recipe), "width": width}
    config = replace(_config(options, values, out, identity), companion=judge.particles)
    place = _place(wanted)
    objective, cameras = placed(*followed(judge, _orbits(denoiser, options), wanted.reference, place), place)
    if not options.resume:
        # Of a run that is overwritten.
        for sheet in (out / SHEETS).glob("step_*.png"):
            sheet.unlink()
    steps = fit(_start(options, values, width, wanted.color).to(place), objective, cameras, config)
    try:
        stopped = _stopped(steps, judge, options, out, report)
    except FloatingPointError as error:
        raise FloatingPointError(f"{error}: {_advice(wanted)}") from error
    state = read_checkpoint(out / CHECKPOINT)
    sketch, seconds = state.sketch, {"distill": time.perf_counter() - begun}
    if wanted.sharpening is not None and options.sharpens and not stopped:
        sketch, stopped = _sharpened(sketch, wanted.sharpening, options, report)
        seconds["sharpen"] = time.perf_counter() - begun - seconds["distill"]
    sketch, around = wanted.finish(sketch), turntable()
    given, chosen = {**wanted.about, **asdict(options)}, {**asdict(values), "width": width, **asdict(recipe)}
    chosen |= {"network": dict(wanted.network)} if wanted.network else {}
    info = RunInfo(given, chosen, seconds, list(state.losses), {}, stopped)
    write_results(out, sketch, around, tile_images(render(sketch, around).color, columns=4), info)
    if stopped:
        raise Stopped
    return sketch


def _stopped(
    steps: Generator[Step], judge: ScoreDistillation, options: DistillOptions, out: Path, report: Report
) -> bool:
    """Goes through all steps, and says whether Ctrl-C came before the end."""
    shown = ShownLoss()
    with closing(steps):
        try:
            for step in steps:
                done = step.index + 1
                low, high = judge.recipe.annealing.bounds(step.index, judge.steps)
                report(Progress("distill", done, judge.steps, shown.of(step), len(step.sketch), f"t {low}-{high}"))
                if options.sheet_every and done % options.sheet_every == 0:
                    save_png(out / SHEETS / f"step_{done:05d}.png", contact_sheet(step, judge))
        except KeyboardInterrupt:
            return True
    return False


def _advice(wanted: Commission) -> str:
    """What to do about a loss that is no number."""
    if wanted.network.get("precision") == "float16":
        overflow = "the prior's numbers may overflow in float16: start anew with --precision bfloat16 (or float32)"
        return f"{overflow}. If that does not help, its weights are damaged: fetch them again"
    return "the weights of the prior may be damaged: fetch them again, or name others by --weights"


def _sharpened(sketch: Sketch, sharpening: Sharpening, options: DistillOptions, report: Report) -> tuple[Sketch, bool]:
    """The sketch after the last steps, and whether Ctrl-C came before their end: a resumed run does them anew."""
    try:
        with closing(sharpening.steps(sketch, options)) as steps:
            for step in steps:
                sketch = step.sketch
                report(Progress("sharpen", step.index + 1, STEPS, step.loss, len(sketch)))
    except KeyboardInterrupt:
        return sketch, True
    return sketch, False


def _place(wanted: Commission) -> torch.device:
    """Where strokes are drawn: beside the prior's network, if the renderer runs there, else on the CPU."""
    network = torch.device(str(wanted.network.get("device", "cpu")))
    return network if network.type == "cuda" and "cuda" in available_backends() else torch.device("cpu")


def placed(objective: Objective, cameras: CameraSampler, place: torch.device) -> tuple[Objective, CameraSampler]:
    """The same for strokes on a device. Priors are told the poses on the CPU, where they come from: to copy them back
    would wait for the device in every step, and so would copies to it that are not `uploaded`.
    """
    latest: list[Cameras] = []

    def judged(rendering: Rendering, _: Cameras, step: int) -> Tensor:
        return objective(rendering, latest[0], step)

    def drawn(step: int, generator: torch.Generator) -> Cameras:
        views = cameras(step, generator)
        latest[:] = [views]
        poses, intrinsics = uploaded(views.world_to_camera, place), uploaded(views.intrinsics, place)
        return replace(views, world_to_camera=poses, intrinsics=intrinsics)

    return judged, drawn


def _width(options: DistillOptions, wanted: Commission) -> float:
    width = wanted.width if options.width is None else options.width
    least, most = options.width_range
    if "width" in options.optimize and not least <= width <= most:
        raise ValueError(f"strokes start with width {width}, outside width_range {least} to {most}: give another one")
    return width


def turntable() -> Cameras:
    """Eight views all around."""
    azimuths = [360 * i / PREVIEWS for i in range(PREVIEWS)]
    return orbit(azimuths, PREVIEW_ELEVATION, size=PREVIEW_SIZE)


def contact_sheet(step: Step, judge: ScoreDistillation) -> Float[Tensor, "H W 3"]:
    """The renderings of a step above what the prior sees in them."""
    assert judge.latest is not None
    seen = judge.denoiser.decode(judge.latest)
    seen = seen.cpu()
    drawn = step.rendering.color[: len(seen)].movedim(-1, 1).cpu()
    resized = torch.nn.functional.interpolate(drawn, seen.shape[1:3], mode="bilinear", antialias=True)
    return tile_images(torch.cat([resized.movedim(1, -1).clamp(0, 1), seen]), columns=len(seen))


def _start(
    options: DistillOptions, values: Preset, width: float, color: tuple[float, float, float] | None = None
) -> Sketch:
    generator = torch.Generator().manual_seed(options.seed)
    sketch = Sketch.random(values.strokes, radius=values.radius, width=width, generator=generator)
    return sketch if color is None else replace(sketch, color=torch.tensor(color).repeat(len(sketch), 1))


def _orbits(denoiser: Denoiser, options: DistillOptions) -> Orbits:
    size = options.size or denoiser.size
    return Orbits(options.batch, denoiser.group, size, options.distance, options.elevation, options.fov)


def _config(options: DistillOptions, values: Preset, out: Path, identity: Mapping[str, object]) -> FitConfig:
    wanted = {
        "points": ("position", values.rate),
        "color": ("color", options.color_rate),
        "opacity": ("alpha", options.alpha_rate),
        "width": ("width", options.width_rate),
    }
    rates = {name: rate for name, (parameter, rate) in wanted.items() if parameter in options.optimize}
    deletion = NoiseDeletion(options.delete_length, options.delete_from, options.delete_every)
    return FitConfig(
        steps=values.steps,
        rates=Rates(**{"points": 0.0, **rates}),
        final_rate=values.final_rate,
        blur=values.blur,
        width_range=options.width_range,
        refinements=[deletion] if options.delete_length else [],
        seed=options.seed,
        checkpoint=out / CHECKPOINT,
        resume=options.resume,
        identity=identity,
    )


def _identity(options: DistillOptions, values: Preset, recipe: Recipe) -> dict[str, object]:
    """What else than `fit` knows of a resumed run must share, in the types of JSON."""
    names = ("batch", "size", "fov", "delete_length", "delete_from", "delete_every")
    pairs = {name: list(getattr(options, name)) for name in ("distance", "elevation", "width_range", "optimize")}
    return {**{name: getattr(options, name) for name in names}, **pairs, **asdict(values), **asdict(recipe)}
