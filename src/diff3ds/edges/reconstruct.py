"""Ridges of posed views to a clean set of 3D curves: the steps in their order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from diff3ds.camera import Cameras
from diff3ds.edges.bias import Bias, corrected, estimate_bias, outline_sides
from diff3ds.edges.bridging import bridged
from diff3ds.edges.carve import carve
from diff3ds.edges.chains import follow_chains
from diff3ds.edges.circles import find_circles
from diff3ds.edges.closing import closed
from diff3ds.edges.corners import with_corners
from diff3ds.edges.curves import Curves, curves_of
from diff3ds.edges.equal import with_equal_circles
from diff3ds.edges.fillets import with_fillets
from diff3ds.edges.lookup import EdgeViews, edge_views
from diff3ds.edges.phantoms import without_phantoms
from diff3ds.edges.placing import placed
from diff3ds.edges.pockets import with_pockets
from diff3ds.edges.refine import refined
from diff3ds.edges.ridges import Array, Ridges
from diff3ds.edges.segment import segmented
from diff3ds.edges.silhouettes import smooth_outlines
from diff3ds.edges.simplify import concatenated, joined, pruned
from diff3ds.edges.triangulate import thinned, triangulate
from diff3ds.edges.unexplained import unexplained
from diff3ds.edges.weld import welded

# Half the side of the cube that is carved; the views' frame puts what they show into the unit ball.
REACH = 1.1
# Lengths in pixels: cells of the carving, distances between points and from the flanks of an edge, shortest chain and
# shortest curve. Empirical.
CELL, APART, FLANK, SHORTEST_CHAIN, SHORTEST = 1.7, 0.57, 1.4, 4.3, 2.8
SHORTEST_HIDDEN = 8.0
# Views that have to confirm an edge: 3 of few, 11 of 50. Edges are hidden in most views, and the more views there are,
# the smaller is the share that chance can bring together. Empirical, from 12, 25 and 50 views.
FEWEST, FACTOR, POWER = 3.0, 1.06, 0.6
# The scores of points are weighted views, and the parts of a curve are shown in fewer views than its best ones.
# The second look asks for fewer: what the first has explained can no longer come together by chance.
SCORE, SUPPORT, SECOND = 0.9, 0.7, 0.55
# A bias smaller than this is not worth another start, pixels; and so many starts at most.
BIAS, CALIBRATIONS = 0.07, 3
STEPS, RATE, SECOND_RATE = 120, 0.09, 0.06
NOTHING = "the views show no edges that agree: are the cameras right, and do the pictures show edges?"

# Called with the name of a stage, the steps done, the loss and the number of curves.
Report = Callable[[str, int, float | None, int], None]


def confirming(views: int) -> float:
    """How many of so many views have to confirm an edge."""
    return max(FEWEST, FACTOR * views**POWER)


@dataclass(frozen=True, eq=False)
class Result:
    """What is reached after a stage: 0 nothing, 1 the first curves and the bias, 2 refined ones, 3 the end."""

    stage: int
    curves: Curves
    bias: Bias


def reconstruct(
    cameras: Cameras,
    ridges: Sequence[Ridges],
    *,
    start: Curves | None = None,
    reached: Result | None = None,
    save: Callable[[Result], None] = lambda result: None,
    report: Report = lambda stage, step, loss, curves: None,
    seed: int = 0,
) -> Result:
    """The curves that the views show, and the bias found in their ridges.

    Args:
        cameras: in a frame where what they show fills the unit ball.
        ridges: of every view.
        start: curves to refine instead of those found by carving.
        reached: the result of a stage, to go on from.
        save: called with the result of every stage.
        report: called with the stage, and the step, loss and curves of a refinement.

    Raises:
        ValueError: the views show no edges that agree.
    """
    # Empty pictures are no witnesses.
    showing = sum(len(ridge) > 0 for ridge in ridges)
    if not showing:
        raise ValueError(NOTHING)
    sides = [outline_sides(ridge, cameras.size) for ridge in ridges]
    enough = confirming(showing)
    if reached is None:
        report("first curves", 0, None, 0)
        reached = _started(cameras, ridges, sides, start, enough)
        save(reached)
    ridges = corrected(ridges, sides, reached.bias)
    scene = _Scene(cameras, edge_views(cameras, ridges), ridges, enough, reached.bias.outward, seed, report)
    for after, stage in ((1, _refined), (2, _finished)):
        if reached.stage == after:
            curves = stage(scene, reached.curves, carving=start is None)
            if not len(curves):
                raise ValueError(NOTHING)
            reached = Result(after + 1, curves, reached.bias)
            save(reached)
    return reached


@dataclass(frozen=True, eq=False)
class _Scene:
    """What all stages look at."""

    cameras: Cameras
    views: EdgeViews
    ridges: Sequence[Ridges]
    enough: float
    outward: float
    seed: int
    report: Report

    def refined(self, name: str, curves: Curves, rate: float) -> Curves:
        return refined(
            curves,
            self.cameras,
            self.views,
            STEPS,
            rate,
            self.seed,
            lambda s, loss: self.report(name, s, loss, len(curves)),
        )


def _started(
    cameras: Cameras, ridges: Sequence[Ridges], sides: Sequence[Array], start: Curves | None, enough: float
) -> Result:
    """The first curves, again after each calibration."""
    views = edge_views(cameras, ridges)
    curves = start or first_curves(views, enough)
    bias = Bias(0.0, 0.0, 0.0)
    for _ in range(CALIBRATIONS):
        if not len(curves):
            raise ValueError(NOTHING)
        # Outlines of smooth surfaces lie outside of where they meet, as if the detector had put them there.
        edges = curves[~smooth_outlines(views, curves)]
        left = estimate_bias(views, np.concatenate(sides), edges)
        bias = Bias(bias.dx + left.dx, bias.dy + left.dy, bias.outward + left.outward)
        if max(abs(left.dx), abs(left.dy), abs(left.outward)) < BIAS:
            break
        views = edge_views(cameras, corrected(ridges, sides, bias))
        curves = start or first_curves(views, enough)
    return Result(1, curves, bias)


def _refined(scene: _Scene, curves: Curves, carving: bool) -> Curves:
    curves = scene.refined("refine", curves, RATE)
    curves = pruned(curves, scene.views, SUPPORT * scene.enough, SHORTEST)
    edges = curves[~smooth_outlines(scene.views, curves)]
    return concatenated(edges, second_look(scene, curves)) if carving else edges


def _finished(scene: _Scene, curves: Curves, carving: bool) -> Curves:
    pixel = scene.views.pixel
    curves = joined(closed(curves, scene.views, scene.enough, scene.outward), pixel)
    curves = scene.refined("join and weld", welded(curves, pixel), SECOND_RATE)
    curves = pruned(curves, scene.views, (SECOND if carving else 1.0) * SUPPORT * scene.enough, SHORTEST)
    curves = bridged(curves, scene.cameras, scene.views, scene.ridges, scene.enough)
    curves = without_phantoms(curves[~smooth_outlines(scene.views, curves)], scene.views)
    curves = placed(curves, scene.views, scene.outward)
    curves = with_corners(with_equal_circles(curves, pixel), scene.views, scene.enough)
    return with_pockets(with_fillets(curves, scene.views, scene.outward), scene.views, scene.outward)


def first_curves(views: EdgeViews, enough: float) -> Curves:
    """Lines, arcs and cubics through triangulated points, as they come."""
    cells = carve(views, REACH, CELL * views.pixel, enough)
    found = triangulate(views, cells, SCORE * enough)
    found = thinned(found, APART * views.pixel, FLANK * views.pixel)
    shortest = SHORTEST_CHAIN * views.pixel
    arcs = [s for chain in follow_chains(found, views.pixel, shortest) for s in segmented(chain, views.pixel)]
    circles, rest = find_circles(found, arcs, views.pixel)
    pieces = [s for chain in follow_chains(rest, views.pixel, shortest) for s in segmented(chain, views.pixel)]
    return curves_of(pieces, circles)


def second_look(scene: _Scene, curves: Curves) -> Curves:
    """Curves that fewer views show, through the ridges that the first curves leave unexplained."""
    fewer = max(FEWEST, SECOND * scene.enough)
    rest = edge_views(scene.cameras, unexplained(scene.views, scene.ridges, curves))
    found = first_curves(rest, fewer)
    if not len(found):
        return found
    found = pruned(scene.refined("second look", found, RATE), rest, SUPPORT * fewer, SHORTEST_HIDDEN)
    return found[~smooth_outlines(rest, found, doubt=True)]
