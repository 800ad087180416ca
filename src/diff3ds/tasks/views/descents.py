"""Fits by gradient descent: of colours, of strokes that are given, and of random curves."""

import dataclasses
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path

import torch

from diff3ds.edges.evidence.edge_views import require_perspective
from diff3ds.optimize.checkpoint import read_checkpoint
from diff3ds.optimize.fit import fit
from diff3ds.photogrammetry.lens_change import UNCHANGED
from diff3ds.pictures.content.background import described
from diff3ds.pictures.content.clean_plates import CleanPlates
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import Sketch
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.start_sketch import digest_of, finished, held
from diff3ds.tasks.views.color_fit.color_sketch import color_scores, held_out_views, plan_color
from diff3ds.tasks.views.edge_fit.edge_sketch import fit_edges
from diff3ds.tasks.views.edge_fit.random_start import plan_random_edges
from diff3ds.tasks.views.edge_fit.refined_views import refine_for_color
from diff3ds.tasks.views.plan import Fitted, Plan
from diff3ds.tasks.views.views_options import ViewsOptions

# The state of a gradient descent, and what a reconstruction of edges has reached.
CHECKPOINT, EDGES_CHECKPOINT = "checkpoint.safetensors", "edges.safetensors"
# A sketch that reaches farther, in radii of what the pictures show, is of another world. Empirical.
FARTHEST = 10.0


def fit_color(
    pictures: PosedPictures,
    clean_plates: CleanPlates | None,
    path: Path | None,
    options: ViewsOptions,
    given: Sketch | None,
    out: Path,
    report: Report,
    say: Callable[[str], None],
) -> Fitted:
    """The coloured strokes of coloured pictures, found or given.

    Raises:
        ValueError: as `plan_color` and `held_out_views`; strokes of another world.
    """
    held_out_views(path)
    which: tuple[int, ...] = ()
    lens, moved = UNCHANGED, {}
    if options.refine_cameras and given is None:
        refined = refine_for_color(pictures, options, out / EDGES_CHECKPOINT, report, say)
        pictures, which, lens = refined.pictures, tuple(refined.looked.views), refined.lens
        clean_plates = clean_plates and clean_plates.refined(lens, which)
        moved = {"cameras": refined.about}
    # Torch's own threads wait for each other busily, which takes the time of those that work where others do as well.
    with torch_on_one_thread():
        plan = _going_on(plan_color(pictures, options, out / CHECKPOINT, clean_plates, report), given, options)
    sketch, losses, stopped = _descended(plan, "fit", report)
    world = _in_world(sketch, plan, given)
    chosen = {"steps": plan.config.steps, "strokes": len(plan.start), "background": described(plan.background), **moved}
    scores: dict[str, float] = {}
    try:
        with torch_on_one_thread():
            # Held-out pictures are not cut out.
            scores = color_scores(world, plan, None if options.cut_out else path, options.masks, report)
    except KeyboardInterrupt:
        # The sketch is there, and is written without them.
        stopped = True
    return Fitted(world, plan.pictures, chosen, losses, scores, stopped, which, lens)


def fit_given_edges(pictures: PosedPictures, options: ViewsOptions, given: Sketch, out: Path, report: Report) -> Fitted:
    """The strokes of the user, pulled onto the lines of edge maps or drawings.

    Raises:
        ValueError: pictures that are no drawings; strokes of another world.
    """
    if pictures.target != "edges":
        raise ValueError("--from follows edge maps, drawings and colours: give --target edges or color")
    plan = plan_random_edges(pictures, options, out / CHECKPOINT)
    # As opaque as ink and as wide as the lines of the pictures, whatever they look like.
    width = plan.start.width[:1].to(given.width).expand(len(given))
    ink = dataclasses.replace(given, width=width, width_space="image", opacity=torch.ones_like(given.opacity))
    plan = _going_on(plan, ink, options)
    sketch, losses, stopped = _descended(plan, "fit", report)
    chosen = {"steps": plan.config.steps, "strokes": len(plan.start)}
    return Fitted(_in_world(sketch, plan, given), pictures, chosen, losses, {}, stopped)


def _going_on(plan: Plan, given: Sketch | None, options: ViewsOptions) -> Plan:
    """The plan with the strokes of the user, which keep their number, where there are some."""
    if given is None or options.start is None:
        return plan
    start = plan.frame.from_world(given)
    reach = float(start.points.norm(dim=-1).max())
    if reach > FARTHEST:
        raise ValueError(
            f"{options.start}: its strokes reach {reach:.3g} times as far as what the pictures show: is it in the "
            "world of their cameras?"
        )
    identity = {**plan.config.identity, "start": digest_of(options.start)}
    config = dataclasses.replace(plan.config, refinements=(), constraints=held(start), identity=identity)
    return dataclasses.replace(plan, start=start, config=config)


def _in_world(sketch: Sketch, plan: Plan, given: Sketch | None) -> Sketch:
    world = plan.frame.to_world(sketch)
    return world if given is None else finished(world, given, plan.config.rates)


def fit_random_edges(
    pictures: PosedPictures, options: ViewsOptions, out: Path, report: Report, say: Callable[[str], None]
) -> Fitted:
    """The curves that random ones become, cleaned up.

    Raises:
        ValueError: as `fit_edges`; pictures that are no drawings.
    """
    if pictures.target != "edges":
        raise ValueError("random curves find the lines of edge maps and drawings only: leave --init out")
    # Which is what cleans the curves up in the end.
    require_perspective(pictures.cameras)
    plan = plan_random_edges(pictures, options, out / CHECKPOINT)
    sketch, losses, stopped = _descended(plan, "random curves", report)
    chosen = {"steps": plan.config.steps, "strokes": len(plan.start)}
    if stopped:
        return Fitted(plan.frame.to_world(sketch), pictures, chosen, losses, {}, stopped)
    try:
        clean = fit_edges(pictures, options, out / EDGES_CHECKPOINT, report, sketch, say)
    except KeyboardInterrupt:
        # Before anything was cleaned up.
        return Fitted(plan.frame.to_world(sketch), pictures, chosen, losses, {}, stopped=True)
    return dataclasses.replace(clean, chosen={**chosen, **clean.chosen}, losses=[*losses, *clean.losses])


def _descended(plan: Plan, stage: str, report: Report) -> tuple[Sketch, list[float], bool]:
    """The last complete sketch of a gradient descent, its losses, and whether Ctrl-C came before the end."""
    checkpoint, total = plan.config.checkpoint, plan.config.steps
    assert checkpoint is not None
    stopped = False
    report(Progress(stage, 0, total, None, len(plan.start)))
    with closing(fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config)) as steps:
        try:
            for step in steps:
                told = Progress(stage, step.index + 1, total, step.loss, len(step.sketch))
                report(dataclasses.replace(told, sketch=partial(plan.frame.to_world, step.sketch)))
        except KeyboardInterrupt:
            stopped = True
    state = read_checkpoint(checkpoint)
    return state.sketch, list(state.losses), stopped
