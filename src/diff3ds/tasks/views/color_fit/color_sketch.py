"""Coloured pictures to a coloured sketch: where the fit starts, what it follows, and how."""

import math
from collections.abc import Iterator
from pathlib import Path

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.camera import Cameras, evenly_spaced
from diff3ds.losses import composite_loss, psnr
from diff3ds.metrics.ssim import WINDOW, ssim
from diff3ds.optimize.config import FitConfig, Rates
from diff3ds.optimize.density import Density, Observation
from diff3ds.optimize.fit import Objective
from diff3ds.pictures.content.background import behind, described, parse_background, with_alpha
from diff3ds.pictures.content.clean_plates import CleanPlates, load_clean_plates
from diff3ds.pictures.content.visual_hull import Hull, visual_hull
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.pictures.frame import frame_of
from diff3ds.pictures.picture_options import Masks
from diff3ds.pictures.pyramid import Level, Pyramid, build_pyramid
from diff3ds.pictures.reading.load_views import Told
from diff3ds.pictures.store import Store, is_all_known
from diff3ds.render import Rendering, render
from diff3ds.sketch import Sketch
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.views.plan import Plan
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import present_views

STEPS, BATCH = 1200, 5
# A number of strokes that is not given is found between these; a given one is reached from a quarter of it, so that
# the first strokes find the shape and later ones the details. Empirical.
LEAST, MOST = 64, 1024
FIRST = 0.25
# Strokes at the start: length by width, and opacity. Empirical.
ASPECT, OPACITY = 5.0, 0.7
# Learning rates. Tried on photographs of one object, with 256
# strokes: half or twice as much loses up to .3 dB.
POINTS, WIDTH, COLOR, FINAL = 0.02, 0.05, 0.02, 0.06
# Refinements look at so many views, in images of at most this many pixels along the longer side.
LOOKED_AT, LOOKED_SIZE = 24, 200
# The hull is carved by so many views, in images of about this size: a cell of its grid is then a pixel or two.
HULL_VIEWS, HULL_SIZE = 100, 100


def plan_color(
    pictures: PosedPictures,
    options: ViewsOptions,
    checkpoint: Path | None,
    clean_plates: CleanPlates | None = None,
    report: Report = lambda progress: None,
) -> Plan:
    """Plans the fit of coloured pictures.

    Args:
        clean_plates: the pictures that lie behind, where the options name no colour.
        report: called before each stage.

    Raises:
        ValueError: as `parse_background` and `frame_of`.
    """
    report(Progress("background", 0, None, None, 0))
    color = None if options.background is None or clean_plates else parse_background(options.background)
    pictures, background = with_alpha(pictures, clean_plates or color)
    frame = frame_of(pictures.cameras, pictures.store)
    steps = options.steps or STEPS
    cameras = frame.cameras(pictures.cameras)
    report(Progress("pyramid", 0, None, None, 0))
    pyramid = build_pyramid(cameras, pictures.store, steps, options.batch or BATCH, options.seed)
    report(Progress("visual hull", 0, None, None, 0))
    start = _start(pyramid, max(1, round(FIRST * options.strokes)) if options.strokes else LEAST, options.seed)
    config = FitConfig(
        steps=steps,
        rates=Rates(points=POINTS, width=WIDTH, color=COLOR, opacity=COLOR),
        final_rate=FINAL,
        antialiasing=pyramid.antialiasing,
        background=0.0,
        refinements=[_density(pyramid, options.strokes or LEAST, options.strokes or MOST)],
        seed=options.seed,
        checkpoint=checkpoint,
        resume=options.resume,
        identity={
            "background": described(clean_plates or color),
            "strokes": options.strokes,
            "batch": options.batch or BATCH,
            "size": options.longest,
            # Last: of what is cut out of another background the digest is another, too.
            "pictures": pictures.digest(),
        },
    )
    return Plan(pictures, frame, start, _objective(pyramid, background), pyramid, config, background)


def strokes_on(hull: Hull, count: int, generator: torch.Generator) -> Sketch:
    """Straight strokes in random directions along the surface of the hull; together they are about as large as it."""
    places = torch.randperm(len(hull.points), generator=generator).repeat(-(-count // len(hull.points)))[:count]
    centers = hull.points[places] + hull.spacing * (torch.rand(count, 3, generator=generator) - 0.5)
    normal, direction = hull.normals[places], torch.randn(count, 3, generator=generator)
    direction = direction - (direction * normal).sum(-1, keepdim=True) * normal
    length = math.sqrt(ASPECT * hull.area / count)
    along = torch.linspace(-0.5, 0.5, 4)[:, None] * torch.nn.functional.normalize(direction, dim=-1)[:, None]
    return Sketch(
        centers[:, None] + length * along,
        width=length / ASPECT,
        color=hull.colors[places],
        opacity=OPACITY,
        width_space="world",
    )


def color_scores(
    sketch: Sketch,
    plan: Plan,
    path: Path | None,
    masks: Masks = "ignore",
    report: Report = lambda progress: None,
) -> dict[str, float]:
    """PSNR and SSIM on the pictures of the fit and, if the folder has some, on held-out ones.

    Over the plan's background, or else over white.

    Args:
        sketch: in the world of the cameras.
        plan: of the fit.
        path: the transforms file of its pictures.
        masks: as for `load_posed`.
        report: called after each picture.
    """

    def told(stage: str) -> Told:
        return lambda done, total: report(Progress(stage, done, total, None, len(sketch)))

    scores = view_scores(sketch, plan.pictures, plan.background, told("scores"))
    size = max(plan.pictures.cameras.size)
    held_out = held_out_pictures(path, size, plan.background, masks, told("read held-out pictures"))
    if held_out is None:
        return scores
    some = view_scores(sketch, *held_out, told("scores of held-out pictures"))
    return scores | {f"{name}_test": value for name, value in some.items()}


def held_out_pictures(
    path: Path | None,
    size: int,
    background: Tensor | CleanPlates | None,
    masks: Masks = "ignore",
    told: Told = lambda done, total: None,
) -> tuple[PosedPictures, Tensor | CleanPlates | None] | None:
    """The held-out pictures beside those of a fit, and what lies behind them; None where there are none.

    A folder of backgrounds has none for held-out pictures: these are then taken for none, too.

    Args:
        path: the transforms file of the fit's pictures.
        size: of these, pixels along the longer side.
        background: of these.
        masks: as for `load_posed`.
        told: called with the number of pictures that have been read, and of all.
    """
    held_out = held_out_views(path)
    if held_out is None:
        return None
    if isinstance(background, CleanPlates):
        if background.source.is_dir():
            return None
        background = load_clean_plates(held_out, background.source, size)
    pictures = load_posed(held_out, "color", size, masks=masks, told=told)
    try:
        pictures, _ = with_alpha(pictures, background)
    except ValueError:
        # Of what lies behind some of them nothing is known: that must not cost the sketch.
        return None
    return pictures, background


def held_out_views(path: Path | None) -> Path | None:
    """The file of held-out pictures beside that of the fit, if there is one.

    Raises:
        ValueError: it is damaged: to be said before the fit.
    """
    held_out = path.parent / "transforms_test.json" if path is not None else None
    if held_out is None or not held_out.is_file() or held_out == path:
        return None
    present_views(held_out)
    return held_out


def view_scores(
    sketch: Sketch,
    pictures: PosedPictures,
    background: Tensor | CleanPlates | None,
    told: Told = lambda done, total: None,
) -> dict[str, float]:
    """PSNR and SSIM over a background, by default white; means over the views.

    SSIM is left out where no view has room for its window.

    Args:
        told: called with the number of views that have been looked at, and of all.
    """
    values: dict[str, list[float]] = {"psnr": [], "ssim": []}
    for view, (drawn, wanted, known) in enumerate(view_pairs(sketch, pictures, background)):
        told(view, len(pictures))
        values["psnr"].append(psnr(drawn, wanted, known))
        if min(pictures.cameras.size) >= WINDOW:
            values["ssim"].append(ssim(drawn, wanted, known))
    counted = {name: [v for v in some if not math.isnan(v)] for name, some in values.items()}
    return {name: sum(some) / len(some) for name, some in counted.items() if some}


def view_pairs(
    sketch: Sketch, pictures: PosedPictures, background: Tensor | CleanPlates | None
) -> Iterator[tuple[Float[Tensor, "1 H W 3"], Float[Tensor, "1 H W 3"], Bool[Tensor, "1 H W"]]]:
    """The sketch, the picture and what is known of it, view by view, over a background, by default white."""
    background = torch.ones(3) if background is None else background
    for view in range(len(pictures)):
        target = pictures.batch([view])
        canvas = behind(background, [view])
        wanted = target.pixels[..., :3] + (1 - target.alpha[..., None]) * canvas
        yield render(sketch, pictures.cameras[view], background=canvas).color, wanted, target.known


def _start(pyramid: Pyramid, count: int, seed: int) -> Sketch:
    level = min(pyramid.levels, key=lambda x: abs(math.log(max(x.cameras.size) / HULL_SIZE)))
    views = evenly_spaced(len(level.cameras), HULL_VIEWS)
    known = level.store.known if is_all_known(level.store.known) else level.store.known[views]
    hull = visual_hull(level.cameras[views], Store(level.store.pixels[views], known[: len(views)]))
    return strokes_on(hull, count, torch.Generator().manual_seed(seed))


def _density(pyramid: Pyramid, least: int, most: int) -> Density:
    views = evenly_spaced(len(pyramid.levels[0].cameras), LOOKED_AT)
    small = [x for x in pyramid.levels if max(x.cameras.size) <= LOOKED_SIZE] or [pyramid.levels[0]]

    def observation(level: Level) -> Observation:
        batch = level.store.batch(views)
        return Observation(level.cameras[views], batch.pixels, batch.known, level.blur)

    def observed(step: int) -> Observation:
        level = pyramid.level(step)
        return observation(level if level in small else small[-1])

    return Density(observation(small[-1]), observed, least=least, most=most)


def _objective(pyramid: Pyramid, background: Tensor | CleanPlates | None) -> Objective:
    shown: Tensor | Pyramid | None
    if isinstance(background, CleanPlates):
        cameras = pyramid.levels[-1].cameras
        shown = build_pyramid(cameras, background.store, pyramid.steps, pyramid.batch, pyramid.seed)
    else:
        shown = background

    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        target = pyramid.targets(step)
        canvas = shown.targets(step).pixels[..., :3] if isinstance(shown, Pyramid) else shown
        return composite_loss(rendering.color, rendering.alpha, target.pixels, canvas, target.known)

    return objective
