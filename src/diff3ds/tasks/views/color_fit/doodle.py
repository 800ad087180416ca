"""Posed pictures to a black sketch by the losses of 3Doodle (Choi et al. 2024): `diff3ds views --recipe 3doodle`."""

import dataclasses
import math
import time
from contextlib import closing
from functools import partial
from pathlib import Path

import torch

from diff3ds._settings import option_values
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, evenly_spaced
from diff3ds.guidance.device_choice import pick_device
from diff3ds.guidance.objective import step_generator
from diff3ds.metrics.clip_resnet import clip_resnet
from diff3ds.metrics.doodle_loss import DoodleLoss
from diff3ds.metrics.vgg_distance import VggDistance
from diff3ds.optimize.checkpoint import read_checkpoint
from diff3ds.optimize.config import FitConfig, Rates
from diff3ds.optimize.fit import Objective, fit
from diff3ds.photogrammetry.find_project import find_project
from diff3ds.pictures.content.background import parse_background, with_alpha
from diff3ds.pictures.content.visual_hull import visual_hull
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.pictures.frame import frame_of
from diff3ds.pictures.pyramid import Level, Pyramid, build_pyramid
from diff3ds.pictures.store import Store, is_all_known
from diff3ds.render import Rendering, render
from diff3ds.sketch import Sketch
from diff3ds.tasks.progress import Progress, Report, ShownLoss, Stopped
from diff3ds.tasks.results import RunInfo, check_output_folder, write_results
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.views.beside_targets import after_targets, preview
from diff3ds.tasks.views.color_fit.color_sketch import HULL_SIZE, HULL_VIEWS
from diff3ds.tasks.views.descents import CHECKPOINT
from diff3ds.tasks.views.plan import Plan
from diff3ds.tasks.views.views_options import DoodleOptions
from diff3ds.weights.judge_files import find_file, read_network

# Control points of a new stroke follow one another by this, plus up to ten times as much at random, along each axis;
# strokes that end within DOT (the norm of their control points around their mean) show nothing. In radii of the scene.
NEXT, JITTER, DOT = 0.001, 0.01, 0.015
# Scores are means over so many of the pictures.
SCORED = 24


def run_doodle(
    source: Path,
    out: Path,
    options: DoodleOptions | None = None,
    report: Report = lambda progress: None,
) -> Sketch:
    """Fits black strokes to posed coloured pictures and writes sketch.json, .svg, .step, preview.png and run.json.

    Ctrl-C ends the fit early; what was reached is written, then `Stopped` is raised, a KeyboardInterrupt.

    Args:
        source: a transforms.json or a folder with one.
        out: folder of the results and of the checkpoint.
        options: default `DoodleOptions()`.
        report: called after every step.

    Returns:
        The sketch in the world of the cameras.

    Raises:
        FileNotFoundError, ValueError: weights that are missing or of another network; as `find_project`,
            `load_posed`, `check_output_folder`, `frame_of` and `fit`.
    """
    options = options or DoodleOptions()
    begun = time.perf_counter()
    path = find_project(source, "color")
    loss = load_doodle_loss(options)
    check_output_folder(out, out / CHECKPOINT, options.resume, options.overwrite)
    plan = plan_doodle(load_posed(path, "color", options.size, out, options.masks), options, loss, out / CHECKPOINT)
    read = time.perf_counter()
    stopped, shown = False, ShownLoss()
    steps = fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config)
    with logged(out, after_targets(plan.pictures, out, report), lambda line: None) as (report, _), closing(steps):
        try:
            for step in steps:
                told = Progress("3doodle", step.index + 1, options.steps, shown.of(step), len(step.sketch))
                report(dataclasses.replace(told, sketch=partial(plan.frame.to_world, step.sketch)))
        except KeyboardInterrupt:
            stopped = True
    state = read_checkpoint(out / CHECKPOINT)
    sketch = plan.frame.to_world(without_dots(state.sketch))
    seconds = {"read": read - begun, "fit": time.perf_counter() - read}
    scores = doodle_scores(sketch, plan.pictures, loss)
    about = {"recipe": "3doodle", "source": str(source), **option_values(options)}
    info = RunInfo(about, {"target": "color"}, seconds, list(state.losses), scores, stopped)
    seen = preview(sketch, plan.pictures) if options.page.page is None else None
    sketch = write_results(out, sketch, plan.pictures.cameras, seen, info, page=options.page)
    if stopped:
        raise Stopped
    return sketch


def load_doodle_loss(options: DoodleOptions) -> DoodleLoss:
    """The networks of the loss, with their weights.

    Raises:
        FileNotFoundError, ValueError: as `find_file`, `read_network`, `clip_resnet` and `VggDistance`.
    """
    device = pick_device(options.device)
    tower_file = find_file(options.clip_rn101, "CLIP RN101", "open_clip_model.safetensors")
    vgg_file = find_file(options.vgg16, "VGG16", "model.safetensors")
    tower = clip_resnet(read_network(tower_file, options.allow_pickle), str(tower_file)).to(device)
    vgg = VggDistance(read_network(vgg_file, options.allow_pickle), options.vgg, str(vgg_file), device)
    return DoodleLoss(tower, vgg, options.clip_weight, options.vgg_weight, options.augmentations)


def plan_doodle(
    pictures: PosedPictures, options: DoodleOptions, loss: DoodleLoss, checkpoint: Path | None = None
) -> Plan:
    """Plans the fit of coloured pictures by 3Doodle.

    Raises:
        ValueError: as `parse_background` and `frame_of`.
    """
    wanted = None if options.background is None else parse_background(options.background)
    pictures, background = with_alpha(pictures, wanted)
    frame = frame_of(pictures.cameras, pictures.store)
    cameras = frame.cameras(pictures.cameras)
    pyramid = Pyramid((Level(cameras, pictures.store, 0.0),), options.steps, options.batch, options.seed)
    names = ("clip_weight", "vgg_weight", "vgg", "augmentations", "strokes", "batch", "size", "width")
    config = FitConfig(
        steps=options.steps,
        rates=Rates(points=options.rate),
        final_rate=1.0,
        seed=options.seed,
        checkpoint=checkpoint,
        resume=options.resume,
        identity={**{name: getattr(options, name) for name in names}, "pictures": pictures.digest()},
    )
    objective = _objective(pyramid, loss, options.seed)
    return Plan(pictures, frame, _start(cameras, pictures.store, options), objective, pyramid, config, background)


def without_dots(sketch: Sketch) -> Sketch:
    """The strokes that are more than dots; the largest stays in any case."""
    spread_out = (sketch.points - sketch.points.mean(1, keepdim=True)).norm(dim=(1, 2))
    return sketch[spread_out >= min(DOT, float(spread_out.max()))]


def doodle_scores(sketch: Sketch, pictures: PosedPictures, loss: DoodleLoss) -> dict[str, float]:
    """Cosine of CLIP's embeddings and distance of VGG16's features, means over some of the pictures.

    Args:
        sketch: in the world of the cameras.
    """
    values = []
    with torch.no_grad():
        for view in evenly_spaced(len(pictures), SCORED).tolist():
            drawn = render(sketch, pictures.cameras[view]).color
            target = pictures.batch([view])
            wanted = torch.where(target.known[..., None], target.images, drawn)
            values.append([float(x) for x in loss.plain(drawn, wanted)])
    cosine, distance = torch.tensor(values).mean(0).tolist()
    return {"clip_rn101": cosine, f"vgg_{loss.vgg.variant}": distance}


def _objective(pyramid: Pyramid, loss: DoodleLoss, seed: int) -> Objective:
    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        target = pyramid.targets(step)
        # Where nothing is known, the picture shows what the rendering does.
        wanted = torch.where(target.known[..., None], target.images, rendering.color.detach())
        return loss(rendering.color, wanted, step_generator(seed, step))

    return objective


def _start(cameras: Cameras, store: Store, options: DoodleOptions) -> Sketch:
    """Short strokes at points of the visual hull, far apart; 3Doodle has points of structure from motion."""
    levels = build_pyramid(cameras, store, 1, 1, 0).levels
    level = min(levels, key=lambda x: abs(math.log(max(x.cameras.size) / HULL_SIZE)))
    views = evenly_spaced(len(cameras), HULL_VIEWS)
    known = level.store.known if is_all_known(level.store.known) else level.store.known[views]
    hull = visual_hull(level.cameras[views], Store(level.store.pixels[views], known[: len(views)]))
    generator = torch.Generator().manual_seed(options.seed)
    first = hull.points[far_apart(hull.points, options.strokes, generator)]
    steps = NEXT + JITTER * torch.rand(options.strokes, 3, 3, generator=generator)
    points = torch.cat([first[:, None], first[:, None] + steps.cumsum(1)], 1)
    return Sketch(points, width=options.width / cameras.size[0])


def far_apart(points: Float[Tensor, "M 3"], count: int, generator: torch.Generator) -> Tensor:
    """Indices of points that lie far apart: a random one, then always the farthest from those before."""
    chosen = [int(torch.randint(len(points), (1,), generator=generator))]
    nearest = torch.full((len(points),), torch.inf)
    while len(chosen) < count:
        nearest = torch.minimum(nearest, (points - points[chosen[-1]]).norm(dim=1))
        chosen.append(int(nearest.argmax()))
    return torch.tensor(chosen)
