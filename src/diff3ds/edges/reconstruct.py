"""Ridges of posed views to a clean set of 3D curves: the steps in their order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.camera import Cameras
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of
from diff3ds.edges.clean.rounded_faces import without_rounded_faces
from diff3ds.edges.clean.silhouettes import smooth_outlines
from diff3ds.edges.clean.simplify import joined, pruned
from diff3ds.edges.clean.spurious import without_spurious
from diff3ds.edges.clean.weld import welded
from diff3ds.edges.complete.corners import with_corners
from diff3ds.edges.complete.hypothesis import AGAIN, NARROW, SHOWN
from diff3ds.edges.complete.loops import find_loops
from diff3ds.edges.complete.missing_lines import bridged
from diff3ds.edges.complete.pockets import with_pockets
from diff3ds.edges.complete.related_circles import with_related_circles
from diff3ds.edges.complete.whole_circles import closed
from diff3ds.edges.drawn.whole_lines import likelier, likely, whole_lines
from diff3ds.edges.evidence.bias import Bias, all_outline_sides, corrected, estimate_bias
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import EdgeViews, edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.unexplained import unexplained
from diff3ds.edges.first.triangulate import EdgePoints
from diff3ds.edges.first_curves import MOST_CURVES, cells_near, curves_through, edge_points, first_curves
from diff3ds.edges.measure.equal_radii import with_equal_circles
from diff3ds.edges.measure.fillets import with_fillets
from diff3ds.edges.measure.fit_ridges import fit_to_ridges
from diff3ds.edges.measure.offsets import PART_SCATTER
from diff3ds.edges.measure.planes import LOOKS
from diff3ds.edges.refine import refined
from diff3ds.edges.watch import Capped, Report, Tick, no_report, not_said
from diff3ds.render.backends import get_num_threads

# [px; empirical] Shortest curve, and that of the second look.
SHORTEST, SHORTEST_HIDDEN = 2.8, 8.0
# [views, factor, exponent; empirical] Views that have to confirm an edge: 3 of few, 11 of 50. Edges are hidden in most
# views, and the more views there are, the smaller is the fraction that chance can bring together. From 12, 25 and 50
# views.
FEWEST, FACTOR, POWER = 3.0, 1.06, 0.6
# A bias smaller than the scatter of ridges is not worth another start; and so many starts at most.
BIAS, CALIBRATIONS = PART_SCATTER[0], LOOKS
# [px; empirical] Where the ridges of photographs have moved by more, other curves are found.
MOVED = 0.2
# [px; measured] Without their bias edges are looked for so far around where they were with it: on the NeRF chair of 4
# as everywhere.
AROUND = 4.0
# [steps, px; empirical] Steps of each refinement, and how far the first step moves control points.
STEPS, RATE = 120, 0.09
# After joining curves are nearer to where they belong.
SECOND_RATE = 2 / 3 * RATE
NO_BIAS = Bias(0.0, 0.0, 0.0)
NOTHING = "the views show no edges that agree: are the cameras right, and do the pictures show edges?"
# What is reached: nothing, the curves found after 0 to CALIBRATIONS calibrations (1 to 4), and then:
CALIBRATED, REFINED, JOINED, FITTED, COMPLETED, DONE = (CALIBRATIONS + k for k in range(2, 8))


def confirming(views: int) -> float:
    """How many of so many views have to confirm an edge."""
    return max(FEWEST, FACTOR * views**POWER)


@dataclass(frozen=True, eq=False)
class Result:
    """What is reached.

    Attributes:
        stage: 0 for nothing; 1 the first curves, one more after each calibration; `CALIBRATED`, the bias is known;
            `REFINED`; `JOINED`; `FITTED`; `COMPLETED`; `DONE`.
        curves: so far.
        bias: of the ridges, as far as it is known.
    """

    stage: int
    curves: Curves
    bias: Bias


class NoEdgesError(ValueError):
    """The views show no edges that agree: those of something smooth, or the cameras are wrong."""


def nothing_yet() -> Result:
    """What is reached before anything is found."""
    return Result(0, curves_of([]), NO_BIAS)


def reconstruct(
    cameras: Cameras,
    ridges: Sequence[Ridges],
    *,
    start: Curves | None = None,
    reached: Result | None = None,
    save: Callable[[Result], None] = lambda result: None,
    report: Report = no_report,
    capped: Capped = not_said,
    seed: int = 0,
    faint: Sequence[Ridges] | None = None,
) -> Result:
    """The curves that the views show, and the bias found in their ridges.

    Args:
        cameras: in a frame where what they show fills the unit ball.
        ridges: of every view.
        start: curves to refine instead of those found by carving.
        reached: the result of a stage, to go on from.
        save: called with the result of every stage.
        report: told how far it is; see `watch`.
        capped: told of what there was too much; see `watch`.
        faint: of photographs, the ridges with fainter ones, which are asked for what known curves make likely. Texture
            makes up curves: those that may have come together by chance go, and the rest are drawn as people draw, see
            `drawn`.

    Raises:
        NoEdgesError: the views show no edges that agree.
    """
    # Empty pictures are no witnesses.
    showing = sum(len(ridge) > 0 for ridge in ridges)
    if not showing:
        raise NoEdgesError(NOTHING)
    sides = all_outline_sides(ridges, cameras.size)
    scene = _Scene(cameras, ridges, confirming(showing), seed, report, capped, faint)
    reached = reached or nothing_yet()
    while reached.stage < CALIBRATED:
        reached = _calibrated(scene, sides, start, reached)
        save(reached)
    scene = replace(scene, ridges=corrected(ridges, sides, reached.bias), bias=reached.bias)
    for after, stage in (
        (CALIBRATED, _refined),
        (REFINED, _joined),
        (JOINED, _fitted),
        (FITTED, _completed),
        (COMPLETED, _drawn),
    ):
        if reached.stage == after:
            curves = stage(scene, reached.curves, carving=start is None)
            if not len(curves):
                raise NoEdgesError(NOTHING)
            reached = Result(after + 1, curves, reached.bias)
            save(reached)
    return reached


@dataclass(frozen=True, eq=False)
class _Scene:
    """What all stages look at."""

    cameras: Cameras
    ridges: Sequence[Ridges]
    min_views: float
    seed: int
    report: Report
    capped: Capped
    faint: Sequence[Ridges] | None = None
    bias: Bias = NO_BIAS

    @property
    def textured(self) -> bool:
        return self.faint is not None

    @property
    def outward(self) -> float:
        return self.bias.outward

    @cached_property
    def views(self) -> EdgeViews:
        return edge_views(self.cameras, self.ridges)

    @cached_property
    def chance(self) -> Chance:
        return Chance.of(self.views)

    @cached_property
    def faintly(self) -> Chance:
        """What the views show by chance where fainter ridges count and lines are looked at narrowly."""
        # Which of faint ones are outlines nothing says.
        sides = [np.zeros(len(ridge)) for ridge in self.faint or []]
        return Chance.of(edge_views(self.cameras, corrected(self.faint or [], sides, self.bias)), NARROW)

    @cached_property
    def cells(self) -> Float[Array, "M 3"]:
        """Where edges may be."""
        return cells_near(self.views, self.min_views, self.ticks, self.capped)

    @cached_property
    def points(self) -> EdgePoints:
        """Points on edges."""
        return edge_points(self.views, self.cells, self.min_views, self.ticks)

    def points_without(self, views: EdgeViews) -> EdgePoints:
        """Points on edges by ridges that have lost a bias: those of before lie near them."""
        from scipy.spatial import cKDTree

        near = cKDTree(self.points.points).query(self.cells, workers=get_num_threads())[0] < AROUND * views.pixel
        return edge_points(views, self.cells[near], self.min_views, self.ticks)

    def likely(self, curves: Curves) -> Curves:
        """The curves, of photographs those that have not come together by chance."""
        return likely(curves, self.chance) if self.textured else curves

    def ticks(self, stage: str, curves: int = 0) -> Tick:
        """What reports how far this stage is."""
        self.report(stage, 0, None, None, curves)
        return lambda done, total: self.report(stage, done, total, None, curves)

    def rest(self, curves: Curves) -> EdgeViews:
        """The views with the edges that no curve explains."""
        self.report("loose ends", 0, None, None, len(curves))
        return edge_views(self.cameras, unexplained(self.views, self.ridges, curves))

    def refined(self, name: str, curves: Curves, rate: float) -> Curves:
        self.report(name, 0, STEPS, None, len(curves))
        return refined(
            curves,
            self.cameras,
            self.views,
            STEPS,
            rate,
            self.seed,
            lambda s, loss: self.report(name, s, STEPS, loss, len(curves)),
        )

    def first_refined(self, name: str, curves: Curves) -> Curves:
        """Curves that share no vertices yet, moved; of photographs those that this does not make less likely."""
        found = self.refined(name, curves, RATE)
        return likelier(curves, found, self.chance) if self.textured else found


def _calibrated(scene: _Scene, sides: Sequence[Array], start: Curves | None, reached: Result) -> Result:
    """The first curves; with some, the bias that they show, and curves without it until there is hardly any left."""
    bias, curves = reached.bias, reached.curves
    if reached.stage > CALIBRATIONS:
        return Result(CALIBRATED, curves, bias)
    if reached.stage:
        views = edge_views(scene.cameras, corrected(scene.ridges, sides, bias))
        scene.report("calibration", 0, None, None, len(curves))
        # Outlines of smooth surfaces lie outside of where they meet, as if the detector had put them there.
        edges = curves[~smooth_outlines(views, curves)]
        for _ in range(CALIBRATIONS if scene.textured else 1):
            left = estimate_bias(views, np.concatenate(sides), edges)
            bias = Bias(bias.dx + left.dx, bias.dy + left.dy, bias.outward + left.outward)
            known = max(abs(left.dx), abs(left.dy), abs(left.outward)) < BIAS
            if known:
                break
            views = edge_views(scene.cameras, corrected(scene.ridges, sides, bias))
        # Of photographs curves are found anew once at most, and not where the ridges have hardly moved.
        moved = max(abs(bias.dx), abs(bias.dy), abs(bias.outward)) > MOVED
        if not (moved and reached.stage == 1 if scene.textured else not known):
            return Result(CALIBRATED, curves, bias)
        views = edge_views(scene.cameras, corrected(scene.ridges, sides, bias))
    else:
        views = scene.views
    if start:
        curves = start
    else:
        found = scene.points_without(views) if reached.stage else scene.points
        curves = curves_through(found, views, scene.ticks, scene.capped, textured=scene.textured)
    if not len(curves):
        raise NoEdgesError(NOTHING)
    return Result(reached.stage + 1, curves, bias)


def _refined(scene: _Scene, curves: Curves, carving: bool) -> Curves:
    curves = scene.first_refined("refine", curves)
    curves = pruned(curves, scene.views, SHOWN * scene.min_views, SHORTEST)
    edges = curves[~smooth_outlines(scene.views, curves)]
    return scene.likely(concatenated(edges, second_look(scene, curves)) if carving else edges)


def _joined(scene: _Scene, curves: Curves, carving: bool) -> Curves:
    pixel = scene.views.pixel
    tick, chance = scene.ticks("circles", len(curves)), scene.chance if scene.textured else None
    curves = closed(curves, scene.views, scene.min_views, scene.outward, tick, chance)
    curves = joined(curves, pixel, scene.ticks("join", len(curves)))
    curves = scene.refined("join and weld", welded(curves, pixel), SECOND_RATE)
    return scene.likely(pruned(curves, scene.views, (AGAIN if carving else 1.0) * SHOWN * scene.min_views, SHORTEST))


def _fitted(scene: _Scene, curves: Curves, carving: bool) -> Curves:
    tick = scene.ticks("missing lines", len(curves))
    curves = bridged(curves, scene.cameras, scene.views, scene.ridges, scene.min_views, tick, scene.capped)
    curves = without_spurious(curves[~smooth_outlines(scene.views, curves)], scene.views)
    return fit_to_ridges(curves, scene.views, scene.outward, scene.ticks("fit to ridges", len(curves)))


def _completed(scene: _Scene, curves: Curves, carving: bool) -> Curves:
    curves = with_equal_circles(curves, scene.views.pixel)
    curves = with_corners(curves, scene.views, scene.min_views, scene.ticks("rounded corners", len(curves)))
    curves = with_fillets(curves, scene.views, scene.outward)
    return with_pockets(curves, scene.views, scene.outward, scene.ticks("pockets", len(curves)))


def _drawn(scene: _Scene, curves: Curves, carving: bool) -> Curves:
    if not scene.textured:
        return curves
    curves = whole_lines(
        curves,
        scene.chance,
        lambda found: scene.refined("whole lines", found, SECOND_RATE),
        scene.rest,
    )
    curves = without_rounded_faces(curves)
    # Where no circle and no rim stands nothing is asked, and faint edges need not be looked at.
    if not bool(curves.closed.any()) and not find_loops(curves, scene.views.pixel):
        return curves
    told, tick = scene.faintly, scene.ticks("related circles", len(curves))
    curves = with_related_circles(curves, told, scene.outward, tick)
    return with_pockets(curves, told.views, scene.outward, scene.ticks("pockets", len(curves)), told)


def second_look(scene: _Scene, curves: Curves) -> Curves:
    """Curves that fewer views show, through the ridges that the first curves leave unexplained."""
    room = MOST_CURVES - len(curves)
    if room <= 0:
        scene.capped("looks", 1, 2)
        return curves_of([])
    fewer = max(FEWEST, AGAIN * scene.min_views)
    rest = edge_views(scene.cameras, unexplained(scene.views, scene.ridges, curves))
    found = first_curves(
        rest,
        fewer,
        lambda stage: scene.ticks(f"second look: {stage}", len(curves)),
        scene.capped,
        most=room,
        textured=scene.textured,
    )
    if not len(found):
        return found
    found = pruned(scene.first_refined("second look", found), rest, SHOWN * fewer, SHORTEST_HIDDEN)
    return found[~smooth_outlines(rest, found, doubt=True)]
