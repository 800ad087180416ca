"""Coloured pictures to a coloured sketch: where the fit starts, what it follows, and how."""

import dataclasses
from pathlib import Path

import torch

from diff3ds._shapes import Tensor
from diff3ds.camera import Cameras
from diff3ds.fit import FitConfig, Objective, Rates
from diff3ds.losses import color_loss, psnr
from diff3ds.refine import NoiseDeletion
from diff3ds.render import Rendering, render
from diff3ds.sketch import Sketch
from diff3ds.tasks.frame import frame_of
from diff3ds.tasks.plan import Plan, ViewsOptions
from diff3ds.tasks.posed import PosedPictures, load_posed
from diff3ds.tasks.pyramid import Pyramid, build_pyramid

# Lengths are relative to the radius of the scene. Empirical.
EXTENT = 0.3
# The paper's deletion threshold is a fifteenth of the radius of its ball.
DELETION = NoiseDeletion(length=0.1 / 1.5)


def plan_color(pictures: PosedPictures, options: ViewsOptions, checkpoint: Path) -> Plan:
    """How coloured pictures are fitted."""
    frame = frame_of(pictures.cameras, pictures.store)
    cameras = frame.cameras(pictures.cameras)
    steps = options.steps or 2400
    pyramid = build_pyramid(cameras, pictures.store, steps, options.batch or 5, options.seed)
    config = FitConfig(
        steps=steps,
        rates=Rates(points=0.012, width=5e-4, color=0.02, opacity=0.02),
        final_rate=0.06,
        blur=pyramid.blur,
        refinements=[DELETION],
        seed=options.seed,
        checkpoint=checkpoint,
        resume=options.resume,
    )
    start = colored_strokes(pictures, options.strokes or 1024, torch.Generator().manual_seed(options.seed))
    return Plan(frame, start, _objective(pyramid), pyramid, config)


def colored_strokes(pictures: PosedPictures, count: int, generator: torch.Generator) -> Sketch:
    """Random strokes in the mean colour of what the pictures show."""
    total, color = torch.zeros(()), torch.zeros(3)
    for views in pictures.store.chunks():
        batch = pictures.batch(views)
        total += batch.alpha.sum()
        color += (batch.images * batch.alpha[..., None]).sum((0, 1, 2))
    sketch = Sketch.random(count, generator=generator, radius=1.0, extent=EXTENT, width=0.02)
    mean = (color / total).expand(count, 3)
    return dataclasses.replace(sketch, color=mean, opacity=torch.full((count,), 0.7))


def color_scores(sketch: Sketch, pictures: PosedPictures, path: Path | None) -> dict[str, float]:
    """PSNR on the pictures of the fit and, if the folder has some, on held-out ones."""
    scores = {"psnr": _psnr(sketch, pictures)}
    held_out = path.parent / "transforms_test.json" if path is not None else None
    if held_out is not None and held_out.is_file() and held_out != path:
        scores["psnr_test"] = _psnr(sketch, load_posed(held_out, "color", max(pictures.cameras.size)))
    return scores


def _objective(pyramid: Pyramid) -> Objective:
    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        target = pyramid.targets(step)
        return color_loss(rendering.color, target.images, target.known)

    return objective


def _psnr(sketch: Sketch, pictures: PosedPictures) -> float:
    total = 0.0
    for view in range(len(pictures)):
        target = pictures.batch([view])
        total += psnr(render(sketch, pictures.cameras[view]).color, target.images, target.known)
    return total / len(pictures)
