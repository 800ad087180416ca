"""Score distillation of a sketch: what `diff3ds text` and `diff3ds image` do once they have a prior."""

import time
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path

import torch

from diff3ds._settings import option_values
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.formats import save_png, tile_images
from diff3ds.guidance.denoiser import Denoiser
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.orbits import Orbits
from diff3ds.guidance.recipe import Recipe
from diff3ds.guidance.upload import uploaded
from diff3ds.optimize.checkpoint import read_checkpoint
from diff3ds.optimize.config import FitConfig, Rates
from diff3ds.optimize.fit import CameraSampler, Objective, Step, fit
from diff3ds.optimize.strokes import NoiseDeletion
from diff3ds.render import Analytic, Rendering, available_backends
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.exact_prior.exemplars import painted
from diff3ds.tasks.progress import Progress, Report, ShownLoss, Stopped
from diff3ds.tasks.results import RunInfo, seen_around, turntable, write_results
from diff3ds.tasks.start_sketch import digest_of, finished, held, load_start
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior, Network
from diff3ds.tasks.text_image.redraw import tidied
from diff3ds.tasks.text_image.reference_view import followed
from diff3ds.tasks.text_image.run_spec import AnyRun, CameraOptions, OutputOptions

# A sketch that reaches less than this fraction of the cameras' distance is too small to be seen. Empirical.
SMALLEST = 0.05
CHECKPOINT, SHEETS = "checkpoint.safetensors", "progress"
# Of what a built-in prior was shown, where nothing else was asked for.
BLACK = (0.0, 0.0, 0.0)
# Whether the descent can end is asked every so many steps: an answer takes as long as one or two. Empirical.
LOOKS = 15


def distill(prior: ConditionedPrior, spec: AnyRun, out: Path, report: Report = lambda progress: None) -> Sketch:
    """Makes a sketch that a prior likes and writes the folder of the run.

    Ctrl-C ends it early; what was reached is written, then `Stopped` is raised, a KeyboardInterrupt.

    Args:
        prior: what looks at the sketch.
        spec: what the user wants.
        out: a folder that `check_output_folder` has found free.
        report: called after every step.

    Raises:
        ValueError: widths that are fitted start outside their range; a checkpoint of another run.
        FloatingPointError: the prior predicts no numbers; says what to do.
    """
    begun = time.perf_counter()
    source = spec.strokes.start
    given = None if source is None else load_start(source, out)
    config = _config(prior, spec, out)
    score = ScoreDistillation(prior.denoiser, _recipe(prior, spec), config.steps, spec.descent.seed)
    place = place_of(prior.network)
    orbits = _orbits(prior.denoiser, spec.cameras)
    objective, cameras = placed(*followed(score, orbits, prior.reference, place), place)
    if not spec.output.resume:
        # Of a run that is overwritten.
        for sheet in (out / SHEETS).glob("step_*.png"):
            sheet.unlink()
    start = (start_of(prior, spec) if given is None else shown_to(prior, spec, given)).to(place)
    if given is not None:
        # Refinements would drop strokes of the user.
        config = replace(config, refinements=(), constraints=held(start))
    steps = fit(start, objective, cameras, replace(config, stateful=score.particles))
    try:
        stopped = _stopped(steps, score, spec.output, out, report, _found_early(prior, spec))
    except FloatingPointError as error:
        raise FloatingPointError(f"{error}: {_advice(prior.network)}") from error
    state = read_checkpoint(out / CHECKPOINT)
    sketch, seconds, faces = state.sketch, {"distill": time.perf_counter() - begun}, None
    if given is not None:
        sketch = finished(sketch, given, config.rates)
    elif prior.built_in:
        found = painted(sketch, prior.built_in.color)
        redrawing = None if stopped else prior.redrawing(spec)
        sketch = redrawing(found, spec.values(prior.preset(spec)).strokes) if redrawing else found[:0]
        faces = redrawing.faces_of(found) if redrawing and len(sketch) else None
        if not len(sketch):
            sketch = tidied(found, spec.cameras, spec.width_is_free)
        if prior.built_in.picture and len(sketch):
            sketch = prior.built_in.picture(sketch)
    around = turntable(sketch)
    info = RunInfo(_given(prior, spec), _chosen(prior, spec), seconds, list(state.losses), {}, stopped)
    surface = None if faces is None else TriangleMesh.of_triangles(faces.numpy())
    seen = seen_around(sketch, around, surface) if spec.page.page is None else None
    sketch = write_results(out, sketch, around, seen, info, surface, sort=given is None, page=spec.page)
    if stopped:
        raise Stopped
    return sketch


def _found_early(prior: ConditionedPrior, spec: AnyRun) -> Callable[[Sketch], bool]:
    """What says that more steps would change nothing: none does where their number or colours were asked for."""
    redrawing = prior.redrawing(spec)
    if redrawing is None or spec.strokes.start is not None or spec.descent.steps is not None:
        return lambda sketch: False
    return redrawing.is_found if spec.descent.optimize == ("position",) else lambda sketch: False


def _stopped(
    steps: Generator[Step],
    score: ScoreDistillation,
    output: OutputOptions,
    out: Path,
    report: Report,
    found: Callable[[Sketch], bool],
) -> bool:
    """Goes through all steps, or until all is found, and says whether Ctrl-C came before the end."""
    shown = ShownLoss()
    with closing(steps):
        try:
            for step in steps:
                done = step.index + 1
                low, high = score.recipe.annealing.bounds(step.index, score.steps)
                told = Progress("distill", done, score.steps, shown.of(step), len(step.sketch), f"t {low}-{high}")
                report(replace(told, sketch=step.sketch.detach))
                if output.sheet_every and done % output.sheet_every == 0:
                    save_png(out / SHEETS / f"step_{done:05d}.png", contact_sheet(step, score))
                if done % LOOKS == 0 and found(step.sketch):
                    break
        except KeyboardInterrupt:
            return True
    return False


def _advice(network: Network | None) -> str:
    """Says what to do about a loss that is no number."""
    if network and network.precision == "float16":
        overflow = "the prior's numbers may overflow in float16: start anew with --precision bfloat16 (or float32)"
        return f"{overflow}. If that does not help, its weights are damaged: fetch them again"
    return "the weights of the prior may be damaged: fetch them again, or name others by --weights"


def place_of(network: Network | None) -> torch.device:
    """The device that strokes are drawn on: that of the prior's network, if the renderer runs there, else the CPU."""
    if network and network.device.type == "cuda" and "cuda" in available_backends():
        return network.device
    return torch.device("cpu")


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


def contact_sheet(step: Step, score: ScoreDistillation) -> Float[Tensor, "H W 3"]:
    """The renderings of a step above what the prior sees in them."""
    assert score.latest is not None
    seen = score.denoiser.decode(score.latest).cpu()
    drawn = step.rendering.color[: len(seen)].movedim(-1, 1).cpu()
    resized = torch.nn.functional.interpolate(drawn, seen.shape[1:3], mode="bilinear", antialias=True)
    return tile_images(torch.cat([resized.movedim(1, -1).clamp(0, 1), seen]), columns=len(seen))


def start_of(prior: ConditionedPrior, spec: AnyRun) -> Sketch:
    """The random strokes that the descent starts with."""
    values, generator = spec.values(prior.preset(spec)), torch.Generator().manual_seed(spec.descent.seed)
    sketch = Sketch.random(values.strokes, radius=values.radius, width=spec.width(prior.width), generator=generator)
    return painted(sketch, prior.built_in.start_color if prior.built_in else None)


def shown_to(prior: ConditionedPrior, spec: AnyRun, given: Sketch) -> Sketch:
    """The strokes of the user that the descent starts with, as wide and in the colour that the prior knows.

    Raises:
        ValueError: they are out of the cameras' sight, or too small; widths outside their range.
    """
    source, sketch = spec.strokes.start, given.to(torch.float32)
    reach, (near, _) = float(sketch.points.norm(dim=-1).max()), spec.cameras.distance
    if not SMALLEST * near <= reach < near:
        raise ValueError(
            f"{source}: its strokes reach {reach:.3g} from the origin, and the cameras stand {near:g} from there: "
            "things fill a ball of radius 1; scale it (diff3ds export FILE scaled.json --scale)"
        )
    if "width" in spec.descent.optimize:
        least, most = spec.strokes.width_range
        if not least <= float(sketch.width.min()) <= float(sketch.width.max()) <= most:
            raise ValueError(f"{source}: its widths leave width_range {least} to {most}: give another one")
    if not prior.built_in:
        return sketch
    if spec.width_is_free:
        sketch = replace(sketch, width=torch.full_like(sketch.opacity, prior.width), width_space="image")
    # Its pictures are of opaque lines of one colour: others would pass for gaps.
    return painted(replace(sketch, opacity=torch.ones_like(sketch.opacity)), prior.built_in.start_color or BLACK)


def _orbits(denoiser: Denoiser, cameras: CameraOptions) -> Orbits:
    size = cameras.size or denoiser.size
    return Orbits(cameras.batch, denoiser.group, size, cameras.distance, cameras.elevation, cameras.fov)


def _recipe(prior: ConditionedPrior, spec: AnyRun) -> Recipe:
    return spec.recipe(prior.denoiser.group, prior.preset(spec))


def _config(prior: ConditionedPrior, spec: AnyRun, out: Path) -> FitConfig:
    values, descent, strokes = spec.values(prior.preset(spec)), spec.descent, spec.strokes
    wanted = {
        "points": ("position", values.rate),
        "color": ("color", descent.color_rate),
        "opacity": ("alpha", descent.alpha_rate),
        "width": ("width", descent.width_rate),
    }
    rates = {name: rate for name, (parameter, rate) in wanted.items() if parameter in descent.optimize}
    deletion = NoiseDeletion(strokes.delete_length, strokes.delete_from, strokes.delete_every)
    return FitConfig(
        steps=values.steps,
        rates=Rates(**{"points": 0.0, **rates}),
        final_rate=values.final_rate,
        antialiasing=Analytic(values.blur),
        width_range=strokes.width_range,
        refinements=[deletion] if strokes.delete_length else [],
        seed=descent.seed,
        checkpoint=out / CHECKPOINT,
        resume=spec.output.resume,
        identity=_identity(prior, spec),
    )


def _told(prior: ConditionedPrior, spec: AnyRun) -> dict[str, object]:
    """The subject, and the prior that was told it."""
    return {**spec.subject.record, "prior": prior.name, **prior.told}


def _given(prior: ConditionedPrior, spec: AnyRun) -> dict[str, object]:
    """The entries of run.json that the user gave."""
    return {**_told(prior, spec), **spec.options()}


def _filled_in(prior: ConditionedPrior, spec: AnyRun) -> dict[str, object]:
    """The values of the run after presets, defaults and the prior have filled in the options that were left out."""
    return {**asdict(spec.values(prior.preset(spec))), "width": spec.width(prior.width), **asdict(_recipe(prior, spec))}


def _chosen(prior: ConditionedPrior, spec: AnyRun) -> dict[str, object]:
    """The entries of run.json that were found out or filled in."""
    return {**_filled_in(prior, spec), **({"network": prior.network.record} if prior.network else {})}


def _identity(prior: ConditionedPrior, spec: AnyRun) -> dict[str, object]:
    """Names what a resumed run must share beside what `fit` itself checks, in the types of JSON."""
    network = {
        name: value for name, value in (prior.network.record if prior.network else {}).items() if name != "device"
    }
    options = {**option_values(spec.cameras), **option_values(spec.strokes), "optimize": spec.descent.optimize}
    shared = {name: list(value) if isinstance(value, tuple) else value for name, value in options.items()}
    source = spec.strokes.start
    shared |= {"start": None if source is None else digest_of(source)}
    return {**_told(prior, spec), **network, **shared, **_filled_in(prior, spec)}
