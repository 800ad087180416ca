"""Random curves pulled onto the lines of edge maps and drawings by rendering alone, coarse to fine."""

from collections.abc import Callable
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, evenly_spaced
from diff3ds.losses import ink_loss
from diff3ds.optimize.config import FitConfig, Rates
from diff3ds.optimize.fit import Objective
from diff3ds.optimize.strokes import Refinement, SupportPruning
from diff3ds.pictures.content.line_width import line_width
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.frame import frame_of
from diff3ds.pictures.pyramid import Pyramid, build_pyramid
from diff3ds.render import Rendering
from diff3ds.sketch import Sketch
from diff3ds.tasks.views.edge_fit.edges_of_pictures import most_views
from diff3ds.tasks.views.plan import Plan
from diff3ds.tasks.views.views_options import ViewsOptions

# The lengths below are relative to the radius of the scene. All are empirical: tried on two CAD models' edge maps, and
# kept where they scored best.
EXTENT = 0.3
SHORTEST = 0.06
# Support pruning: agreement within 2 px in at least this fraction of the views.
AGREEMENT = 5
LEAST_SUPPORT = 0.15
REPLACE = (0.125, 0.25, 0.3125, 0.375, 0.4375, 0.5, 0.5625, 0.625)
DROP = (0.75, 0.9, 1.0)


def plan_random_edges(pictures: PosedPictures, options: ViewsOptions, checkpoint: Path) -> Plan:
    """Plans the fit of random curves to edge maps and line drawings.

    Raises:
        ValueError: as `frame_of`.
    """
    frame = frame_of(pictures.cameras, pictures.store)
    cameras = frame.cameras(pictures.cameras)
    steps, count = options.steps or 1200, options.strokes or 128
    pyramid = build_pyramid(cameras, pictures.store, steps, options.batch or 10, options.seed)
    fresh = _black_strokes(line_width(pictures.store))
    config = FitConfig(
        steps=steps,
        rates=Rates(points=0.012),
        final_rate=0.06,
        antialiasing=pyramid.antialiasing,
        refinements=_refinements(cameras, pictures, fresh, count),
        seed=options.seed,
        checkpoint=checkpoint,
        resume=options.resume,
        identity={
            "pictures": pictures.digest(),
            "strokes": count,
            "batch": options.batch or 10,
            "size": options.longest,
        },
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
    # As numbers they take room, and so many say what all would.
    views = evenly_spaced(len(pictures), most_views(pictures.cameras.size))
    thick = torch.stack([_thickened(pictures.batch([view]).alpha) for view in views.tolist()])
    return [SupportPruning(cameras[views], thick, LEAST_SUPPORT, SHORTEST, REPLACE, DROP, fresh, count)]


def _thickened(ink: Float[Tensor, "1 H W"]) -> Float[Tensor, "H W"]:
    return torch.nn.functional.max_pool2d(ink[:, None], AGREEMENT, 1, AGREEMENT // 2)[0, 0]


def _black_strokes(width: float) -> Callable[[int, torch.Generator], Sketch]:
    return lambda count, generator: Sketch.random(count, generator=generator, radius=1.0, extent=EXTENT, width=width)
