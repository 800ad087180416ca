"""Lines grown at loose ends, as far as edges that no line explains show one, and where chance does so less often."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves, curves_of
from diff3ds.curves.shapes.primitives import Kind, Primitive, line_control
from diff3ds.curves.shapes.straight_lines import off_segment
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import EdgeViews

# [px, px; empirical] A line grows by so much at most, and by no less.
LONGEST, SHORTEST = 160.0, 6.0
# [px; numerical] Spacing of the points that are asked about.
SPACING = 1.5
# [px; empirical] Chance is what the same lines would grow, moved so far aside to four sides.
ASIDE = 16.0
# [ratio; empirical] Lines grow where so many do for each that would by chance.
AGAINST_CHANCE = 3.0
# [lines, cosine; empirical] Lines turn into directions that so many share, to within 4 degrees.
SHARING, SHARED = 3, 0.9976
# [directions; speed] Of these so many, that most length shares: buildings have fewer.
MOST_SHARED = 12
# [cosine; empirical] A direction so near to that of a line is its own: 20 degrees.
OWN = 0.94
# [px, fraction; empirical] What lies so near to a line that has grown already, for so much of its length, is the same.
DOUBLED, DOUBLED_SHARE = 4.0, 0.5
# [points; numerical] Points along a line that are compared with another.
POINTS = 21


def grown(
    curves: Curves, loose: Bool[NDArray[np.bool_], "N 2"], chance: Chance, rest: EdgeViews, least: float
) -> Curves:
    """The lines that grow at loose ends of straight lines, on as they run or into directions that several lines share.

    Args:
        loose: which ends meet nothing.
        chance: of the views.
        rest: the same views with the edges that no curve explains.
        least: evidence that grown lines have along all of their length in the mean, natural logarithms.
    """
    pixel, told = chance.views.pixel, replace(chance, views=rest)
    starts, directions, on = _rays(curves, loose, SHORTEST * pixel)
    if not len(starts) or not len(rest.points):
        return curves_of([])
    score, reach = _growth(told, starts, directions, least)
    aside = [_growth(told, starts + ASIDE * pixel * side, directions, least)[0] for side in _sides(directions)]
    chosen = np.zeros(len(starts), bool)
    for kind in (on, ~on):
        chosen[kind] = against_chance(score[kind], np.stack(aside)[:, kind])
    chosen &= reach > SHORTEST * pixel
    order = np.argsort(-score, kind="stable")
    known: list[tuple[Float[Array, " 3"], Float[Array, " 3"]]] = []
    for row in order[chosen[order]]:
        start, stop = starts[row], starts[row] + reach[row] * directions[row]
        if not any(_along(start, stop, one, other, DOUBLED * pixel) for one, other in known):
            known.append((start, stop))
    return curves_of([Primitive(Kind.LINE, line_control(*ends), np.zeros(0)) for ends in known])


def _rays(
    curves: Curves, loose: Bool[NDArray[np.bool_], "N 2"], shortest: float
) -> tuple[Float[Array, "R 3"], Float[Array, "R 3"], Bool[NDArray[np.bool_], " R"]]:
    """From where longer lines may grow, in which directions, and whether that is on as the line runs."""
    ends = curves.points.double().numpy()[:, [0, 3]]
    along = ends[:, 1] - ends[:, 0]
    rows = np.nonzero((curves.kind == Kind.LINE).numpy() & (np.linalg.norm(along, axis=1) > shortest))[0]
    ends, along = ends[rows], along[rows]
    shared = _shared(along)
    starts, directions, on = [], [], []
    for row, pair, way in zip(rows, ends, unit(along), strict=True):
        turns = [turn for turn in shared if abs(turn @ way) < OWN]
        for end in np.nonzero(loose[row])[0]:
            ahead = [way if end else -way, *turns, *(-turn for turn in turns)]
            starts += [pair[end]] * len(ahead)
            directions += ahead
            on += [True] + [False] * (len(ahead) - 1)
    return np.reshape(starts, (-1, 3)), np.reshape(directions, (-1, 3)), np.array(on, bool)


def _shared(along: Float[Array, "L 3"]) -> list[Float[Array, " 3"]]:
    """Directions that several lines share, those first that most length does."""
    found = []
    along = along[np.argsort(-np.linalg.norm(along, axis=1), kind="stable")]
    while len(along):
        cosine = unit(along) @ unit(along[0])
        same = np.abs(cosine) > SHARED
        if same.sum() >= SHARING:
            found.append((np.sign(cosine[same])[:, None] * along[same]).sum(0))
        along = along[~same]
    found.sort(key=lambda way: -float(np.linalg.norm(way)))
    return [unit(way) for way in found[:MOST_SHARED]]


def _sides(directions: Float[Array, "R 3"]) -> list[Float[Array, "R 3"]]:
    """Unit vectors across directions, to four sides."""
    least = np.eye(3)[np.abs(directions).argmin(1)]
    one = unit(np.cross(directions, least))
    other = np.cross(directions, one)
    return [one, -one, other, -other]


def _growth(
    told: Chance, starts: Float[Array, "R 3"], directions: Float[Array, "R 3"], least: float
) -> tuple[Float[Array, " R"], Float[Array, " R"]]:
    """How far rays go with most evidence beyond the least, and that: natural logarithms times pixels, world units."""
    steps = SPACING * told.views.pixel * (1 + np.arange(int(LONGEST / SPACING)))
    points = starts[:, None] + steps[:, None] * directions[:, None]
    tangents = np.repeat(directions, len(steps), 0)
    total = (told.evidence(points.reshape(-1, 3), tangents) - least).reshape(len(starts), -1).cumsum(1)
    best = total.argmax(1)
    return SPACING * total.max(1), steps[best]


def against_chance(score: Float[Array, " R"], by_chance: Float[Array, "S R"]) -> Bool[NDArray[np.bool_], " R"]:
    """Which scores are so high that so many are for each that would be by chance.

    Args:
        by_chance: scores of the same, moved to so many sides where nothing is known to be.
    """
    order = np.argsort(-score, kind="stable")
    least = np.sort(by_chance.reshape(-1))
    false = (len(least) - np.searchsorted(least, score[order])) / len(by_chance)
    enough = (1 + np.arange(len(score)) >= AGAINST_CHANCE * false) & (score[order] > 0)
    chosen = np.zeros(len(score), bool)
    chosen[order[: 1 + np.nonzero(enough)[0].max(initial=-1)]] = True
    return chosen


def _along(
    start: Float[Array, " 3"], stop: Float[Array, " 3"], one: Float[Array, " 3"], other: Float[Array, " 3"], near: float
) -> bool:
    """Whether a line lies along another for half of its length."""
    points = start + np.linspace(0, 1, POINTS)[:, None] * (stop - start)
    return bool((off_segment(points, one, other) < near).mean() > DOUBLED_SHARE)
