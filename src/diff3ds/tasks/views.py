"""Posed pictures to a 3D sketch: what `diff3ds views` does."""

import dataclasses
import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._shapes import Tensor
from diff3ds.camera import Cameras
from diff3ds.checkpoint import read_checkpoint
from diff3ds.fit import FitConfig, Objective, Rates, Step, fit
from diff3ds.library.demo import demo_cameras, demo_sketch
from diff3ds.losses import color_loss, ink_loss, psnr
from diff3ds.refine import NoiseDeletion, Refinement, SupportPruning
from diff3ds.render import Rendering, render
from diff3ds.sketch import Sketch
from diff3ds.tasks.frame import Frame, frame_of
from diff3ds.tasks.posed import PosedPictures, Target, find_transforms, load_posed
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
# The paper's deletion threshold is a fifteenth of the radius of its ball.
DELETION = NoiseDeletion(length=0.1 / 1.5)


@dataclass(frozen=True)
class ViewsOptions:
    """Options of `diff3ds views`.

    Attributes:
        target: edges (edge maps, line drawings) or color; found by itself if not given.
        strokes: strokes at the start; by default 128 for edges, 1024 for colour.
        steps: gradient steps; by default 1200 for edges, 2400 for colour.
        batch: views of a step; by default 10 for edges, 5 for colour.
        size: larger pictures are reduced to this many pixels along the longer side.
        seed: of all random draws.
        resume: go on from the checkpoint in the output folder.
    """

    target: Target | None = None
    strokes: int | None = None
    steps: int | None = None
    batch: int | None = None
    size: int = 512
    seed: int = 0
    resume: bool = False

    def __post_init__(self) -> None:
        for name in ("strokes", "steps", "batch", "size"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name} must be positive, got {value}")


@dataclass(frozen=True, eq=False)
class Plan:
    """All that the fit of one set of pictures needs, in its frame."""

    frame: Frame
    start: Sketch
    objective: Objective
    pyramid: Pyramid
    config: FitConfig


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
    plan = _plan(pictures, options, out / CHECKPOINT)
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
        _scores(world, pictures, path),
        stopped,
    )
    write_results(out, world, pictures, info)
    if stopped:
        raise KeyboardInterrupt
    return world


def demo_pictures() -> PosedPictures:
    """Line drawings of the package's own scene from all around."""
    cameras = demo_cameras()
    alpha = render(demo_sketch(), cameras).alpha
    return PosedPictures(cameras, "edges", store_of(alpha[..., None]), tuple(f"view {i}" for i in range(len(cameras))))


def _plan(pictures: PosedPictures, options: ViewsOptions, checkpoint: Path) -> Plan:
    frame = frame_of(pictures.cameras, pictures.store)
    cameras = frame.cameras(pictures.cameras)
    edges = pictures.target == "edges"
    steps = options.steps or (1200 if edges else 2400)
    count = options.strokes or (128 if edges else 1024)
    pyramid = build_pyramid(cameras, pictures.store, steps, options.batch or (10 if edges else 5), options.seed)
    fresh = _black_strokes(_line_width(pictures.store)) if edges else _colored_strokes(pictures)
    config = FitConfig(
        steps=steps,
        rates=Rates(points=0.012) if edges else Rates(points=0.012, width=5e-4, color=0.02, opacity=0.02),
        final_rate=0.06,
        blur=pyramid.blur,
        refinements=_refinements(cameras, pictures, fresh, count),
        seed=options.seed,
        checkpoint=checkpoint,
        resume=options.resume,
    )
    start = fresh(count, torch.Generator().manual_seed(options.seed))
    return Plan(frame, start, _ink_objective(pyramid) if edges else _color_objective(pyramid), pyramid, config)


def _ink_objective(pyramid: Pyramid) -> Objective:
    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        target = pyramid.targets(step)
        return ink_loss(rendering.alpha, target.alpha, known=target.known)

    return objective


def _color_objective(pyramid: Pyramid) -> Objective:
    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        target = pyramid.targets(step)
        return color_loss(rendering.color, target.images, target.known)

    return objective


def _refinements(
    cameras: Cameras, pictures: PosedPictures, fresh: Callable[[int, torch.Generator], Sketch], count: int
) -> list[Refinement]:
    if pictures.target != "edges":
        return [DELETION]
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


def _colored_strokes(pictures: PosedPictures) -> Callable[[int, torch.Generator], Sketch]:
    """Random strokes in the mean colour of what the pictures show."""
    total, color = torch.zeros(()), torch.zeros(3)
    for views in pictures.store.chunks():
        batch = pictures.batch(views)
        total += batch.alpha.sum()
        color += (batch.images * batch.alpha[..., None]).sum((0, 1, 2))
    mean = color / total

    def fresh(count: int, generator: torch.Generator) -> Sketch:
        sketch = Sketch.random(count, generator=generator, radius=1.0, extent=EXTENT, width=0.02)
        return dataclasses.replace(sketch, color=mean.expand(count, 3), opacity=torch.full((count,), 0.7))

    return fresh


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


def _scores(sketch: Sketch, pictures: PosedPictures, path: Path | None) -> dict[str, float]:
    """PSNR of coloured pictures, on those of the fit and on held-out ones if the folder has some."""
    if pictures.target == "edges":
        return {}
    scores = {"psnr": _psnr(sketch, pictures)}
    held_out = path.parent / "transforms_test.json" if path is not None else None
    if held_out is not None and held_out.is_file() and held_out != path:
        scores["psnr_test"] = _psnr(sketch, load_posed(held_out, "color", max(pictures.cameras.size)))
    return scores


def _psnr(sketch: Sketch, pictures: PosedPictures) -> float:
    total = 0.0
    for view in range(len(pictures)):
        target = pictures.batch([view])
        total += psnr(render(sketch, pictures.cameras[view]).color, target.images, target.known)
    return total / len(pictures)
