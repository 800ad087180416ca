"""Posed pictures to a 3D sketch: what `diff3ds views` does."""

import dataclasses
import math
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import torch

from diff3ds._shapes import Tensor
from diff3ds.camera import Cameras
from diff3ds.checkpoint import read_checkpoint
from diff3ds.fit import FitConfig, Objective, Rates, Step, fit
from diff3ds.library.demo import demo_cameras, demo_sketch
from diff3ds.losses import ink_loss
from diff3ds.refine import Refinement, SupportPruning
from diff3ds.render import Rendering, render
from diff3ds.sketch import Sketch
from diff3ds.tasks.color import color_scores, plan_color
from diff3ds.tasks.frame import frame_of
from diff3ds.tasks.plan import Plan, ViewsOptions
from diff3ds.tasks.posed import PosedPictures, find_transforms, load_posed
from diff3ds.tasks.pyramid import Pyramid, build_pyramid
from diff3ds.tasks.results import RunInfo, write_results
from diff3ds.tasks.store import Store, store_of

CHECKPOINT = "checkpoint.safetensors"
# The lengths below are relative to the radius of the scene. All are empirical: tried on two CAD models' edge maps and
# one set of photographs, and kept where they scored best.
EXTENT = 0.3
SHORTEST = 0.06
# Support pruning of edges: agreement within 2 px in at least this share of the views.
AGREEMENT = 5
LEAST_SUPPORT = 0.15
REPLACE = (0.125, 0.25, 0.3125, 0.375, 0.4375, 0.5, 0.5625, 0.625)
DROP = (0.75, 0.9, 1.0)


def fit_views(
    source: Path | None,
    out: Path,
    options: ViewsOptions | None = None,
    report: Callable[[Step, int], None] = lambda step, steps: None,
) -> Sketch:
    """Fits a sketch to posed pictures and writes sketch.json, .svg, .step, preview.png and run.json.

    Ctrl-C ends the fit early; what was reached is written, then KeyboardInterrupt goes on.

    Args:
        source: a transforms.json or a folder with one; None is the scene that the package generates.
        out: folder of the results and of the checkpoint.
        options: default `ViewsOptions()`.
        report: called after every step with it and the number of steps.

    Returns:
        The sketch in the world of the cameras.

    Raises:
        FileNotFoundError, ValueError: as `find_transforms`, `load_posed`, `frame_of` and `fit`.
    """
    options = options or ViewsOptions()
    begun = time.perf_counter()
    path = find_transforms(source, options.target) if source is not None else None
    pictures = demo_pictures() if path is None else load_posed(path, options.target, options.size, out)
    plan = (_plan if pictures.target == "edges" else plan_color)(pictures, options, out / CHECKPOINT)
    read = time.perf_counter()
    sketch, stopped = _fitted(plan, report)
    world = plan.frame.to_world(sketch)
    seconds = {"read": read - begun, "fit": time.perf_counter() - read}
    losses = list(read_checkpoint(out / CHECKPOINT).losses)
    info = RunInfo(
        {"source": str(source) if source else "demo", **dataclasses.asdict(options)},
        {"target": pictures.target, "steps": plan.config.steps, "strokes": len(plan.start)},
        seconds,
        losses,
        {} if pictures.target == "edges" else color_scores(world, plan, path),
        stopped,
    )
    write_results(out, world, plan.pictures, info)
    if stopped:
        raise KeyboardInterrupt
    return world


def demo_pictures() -> PosedPictures:
    """Line drawings of the package's own scene from all around."""
    cameras = demo_cameras()
    alpha = render(demo_sketch(), cameras).alpha
    return PosedPictures(cameras, "edges", store_of(alpha[..., None]), tuple(f"view {i}" for i in range(len(cameras))))


def _plan(pictures: PosedPictures, options: ViewsOptions, checkpoint: Path) -> Plan:
    """How edge maps and line drawings are fitted."""
    frame = frame_of(pictures.cameras, pictures.store)
    cameras = frame.cameras(pictures.cameras)
    steps, count = options.steps or 1200, options.strokes or 128
    pyramid = build_pyramid(cameras, pictures.store, steps, options.batch or 10, options.seed)
    fresh = _black_strokes(_line_width(pictures.store))
    config = FitConfig(
        steps=steps,
        rates=Rates(points=0.012),
        final_rate=0.06,
        blur=pyramid.blur,
        refinements=_refinements(cameras, pictures, fresh, count),
        seed=options.seed,
        checkpoint=checkpoint,
        resume=options.resume,
    )
    start = fresh(count, torch.Generator().manual_seed(options.seed))
    return Plan(pictures, frame, start, _ink_objective(pyramid), pyramid, config)


def _ink_objective(pyramid: Pyramid) -> Objective:
    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        target = pyramid.targets(step)
        return ink_loss(rendering.alpha, target.alpha, known=target.known)

    return objective


def _refinements(
    cameras: Cameras, pictures: PosedPictures, fresh: Callable[[int, torch.Generator], Sketch], count: int
) -> list[Refinement]:
    ink = pictures.batch(range(len(pictures))).alpha
    thick = torch.nn.functional.max_pool2d(ink[:, None], AGREEMENT, 1, AGREEMENT // 2)[:, 0]
    return [SupportPruning(cameras, thick, LEAST_SUPPORT, SHORTEST, REPLACE, DROP, fresh, count)]


def _line_width(store: Store) -> float:
    """Mean width of the lines, as a fraction of the image height.

    A line of length L and width w holds w L of ink, and the total variation of its profile is 2 L; summing the
    absolute differences along x and y measures 4 / pi times that, averaged over directions.
    """
    total = variation = 0.0
    for views in store.chunks():
        ink = store.batch(views).alpha
        total += float(ink.sum())
        variation += float((ink[:, 1:] - ink[:, :-1]).abs().sum() + (ink[:, :, 1:] - ink[:, :, :-1]).abs().sum())
    return 2 * (4 / math.pi) * total / variation / store.pixels.shape[1]


def _black_strokes(width: float) -> Callable[[int, torch.Generator], Sketch]:
    return lambda count, generator: Sketch.random(count, generator=generator, radius=1.0, extent=EXTENT, width=width)


def _fitted(plan: Plan, report: Callable[[Step, int], None]) -> tuple[Sketch, bool]:
    """The last complete sketch, and whether Ctrl-C came before the end."""
    checkpoint = plan.config.checkpoint
    assert checkpoint is not None
    stopped = False
    with closing(fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config)) as steps:
        try:
            for step in steps:
                report(step, plan.config.steps)
        except KeyboardInterrupt:
            stopped = True
    return read_checkpoint(checkpoint).sketch, stopped
