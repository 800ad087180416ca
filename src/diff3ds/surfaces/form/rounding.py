"""Rounded edges: the radius of the rounding between two forms, and the two lines at which it begins."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.surfaces.form.edges import Edge, Rounding
from diff3ds.surfaces.form.exact_meets import Surface, onto
from diff3ds.surfaces.form.form_kinds import Form
from diff3ds.surfaces.form.free import NONE
from diff3ds.surfaces.form.labels import ROUNDED
from diff3ds.surfaces.form.samples import Samples

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Samples beside an edge are as near to it as rounded edges are, and so much farther: some lie on both forms.
BESIDE = 1.5
# Radii that are tried, and how often the best one and its neighbours are parted again.
TRIED, FINER = 24, 2
# So many samples at least say what a rounding is. Empirical.
LEAST = 12
# An edge is rounded where that leaves so small a share of the squared distances that a sharp one leaves, and the radius
# is more than so many spacings of samples with the six neighbours of a mesh (of more, those that count are farther):
# what samples cut off of a sharp edge looks like a smaller radius. Empirical.
BETTER, LEAST_SPACINGS, NEIGHBOURS = 0.6, 1.3, 6
# Of forms that go on in each other there is no rounding; numerical.
MOST_COSINE = 0.999
# Points along a tangent line, per spacing of the samples.
DENSE = 3.0


@dataclass(frozen=True, eq=False)
class TangentLine:
    """Where a rounded edge begins on one of its forms.

    Attributes:
        edge: the number of the edge.
        line: points along it; the last is the first where it is closed.
        closed: whether it runs round.
    """

    edge: int
    line: Float[Array, "M 3"]
    closed: bool


@dataclass(frozen=True, eq=False)
class _Section:
    """Points beside an edge, in its cross-section.

    Attributes:
        a, b: distances from both forms, positive on the side of the solid, or of what is around it, between them.
        cosine: of the angle between the normals that point away from there.
        sides: signs of the distances there.
    """

    a: Float[Array, " S"]
    b: Float[Array, " S"]
    cosine: Float[Array, " S"]
    sides: tuple[float, float]

    def off(self, radius: float) -> Float[Array, " S"]:
        """How far the points are from both forms with a rounding between them."""
        c = self.cosine
        # From the axis of the rounding, along both normals.
        x, y = radius - self.a, radius - self.b
        away = np.sqrt(np.maximum(x * x + y * y - 2 * c * x * y, 0) / (1 - c * c)) - radius
        return np.where((x > c * y) & (y > c * x), away, np.minimum(np.abs(self.a), np.abs(self.b)))

    def cost(self, radius: float, most: float) -> float:
        """Mean squared distance, none more than that of `most`."""
        return float(np.minimum(self.off(radius) ** 2, most * most).mean())


def with_roundings(
    samples: Samples, label: Int[Index, " N"], edges: list[Edge], forms: Sequence[Surface]
) -> list[Edge]:
    """The edges, each with the rounding that samples beside it lie on, if they do."""
    from scipy.spatial import cKDTree

    tree = cKDTree(samples.points)
    return [replace(edge, rounding=_rounding(samples, label, tree, edge, forms)) for edge in edges]


def _rounding(
    samples: Samples, label: Int[Index, " N"], tree: "cKDTree", edge: Edge, forms: Sequence[Surface]
) -> Rounding | None:
    a, b = (forms[k] for k in edge.forms)
    if not (isinstance(a, Form) and isinstance(b, Form)):
        return None
    section = _section(samples, label, tree, edge, (a, b))
    if section is None:
        return None
    most = ROUNDED * samples.size
    radii = np.linspace(0, 2 * most, TRIED)
    for _ in range(FINER + 1):
        best = int(np.argmin([section.cost(radius, most) for radius in radii]))
        around = radii[max(best - 1, 0)], radii[min(best + 1, len(radii) - 1)]
        radius, radii = float(radii[best]), np.linspace(*around, TRIED)
    even = samples.spacing * float(np.sqrt(NEIGHBOURS * len(samples) / (2 * len(samples.pairs))))
    if radius < LEAST_SPACINGS * even or section.cost(radius, most) > BETTER * section.cost(0.0, most):
        return None
    return Rounding(radius, section.sides, float(np.median(section.cosine)))


def _section(
    samples: Samples, label: Int[Index, " N"], tree: "cKDTree", edge: Edge, forms: tuple[Form, Form]
) -> _Section | None:
    """What of the samples lies beside an edge and on no third form."""
    reach = BESIDE * ROUNDED * samples.size
    margin = 0.0 if edge.closed else min(reach / edge.path.speed, (edge.stop - edge.start) / 4)
    grid = np.linspace(edge.start + margin, edge.stop - margin, max(int(edge.length / reach * 4), 8))
    rows = np.unique(np.concatenate(tree.query_ball_point(edge.path.at(grid), reach)).astype(int))
    rows = rows[np.isin(label[rows], edge.forms)]
    rows = rows[_along(edge, samples.points[rows], margin)]
    own = [rows[label[rows] == k] for k in edge.forms]
    if min(map(len, own)) < LEAST:
        return None
    points = samples.places(rows)
    points = points[_along(edge, points, margin)]
    foot = edge.path.at(edge.path.parameter(points))
    a, b = (one.distance(points) for one in forms)
    # Samples of one form are on the side of the other where what lies between both is.
    one, other = (
        float(np.sign(np.median(form.distance(samples.points[k])))) for form, k in zip(forms, own[::-1], strict=True)
    )
    cosine = one * other * (forms[0].normal(foot) * forms[1].normal(foot)).sum(1)
    return _Section(one * a, other * b, np.clip(cosine, -MOST_COSINE, MOST_COSINE), (one, other))


def _along(edge: Edge, points: Float[Array, "S 3"], margin: float) -> Bool[Mask, " S"]:
    """Which points lie beside the edge, so far from its ends."""
    t = edge.path.parameter(points)
    if np.isfinite(edge.path.period):
        t = edge.start + (t - edge.start) % edge.path.period
    return np.asarray((t >= edge.start + margin) & (t <= edge.stop - margin))


def tangent_lines(
    samples: Samples, edges: Sequence[Edge], vertex: Int[Index, "E 2"], forms: Sequence[Surface]
) -> list[TangentLine]:
    """The two lines at which each rounded edge begins, which end where those of the edges at its corners do.

    Args:
        vertex: of the ends of the edges.
    """
    at: dict[int, list[Edge]] = {}
    for edge, ends in zip(edges, vertex.tolist(), strict=True):
        for v in ends:
            at.setdefault(v, []).append(edge)
    out = []
    for row, edge in enumerate(edges):
        if edge.rounding is None:
            continue
        grid = np.linspace(edge.start, edge.stop, max(int(DENSE * edge.length / samples.spacing), 8) + 1)
        for own, line in zip(
            edge.forms, _tangents(edge.rounding, [forms[k] for k in edge.forms], edge.path.at(grid)), strict=True
        ):
            if edge.closed:
                out.append(TangentLine(row, np.concatenate([line[:-1], line[:1]]), True))
                continue
            for way, third, v in zip((-1, 1), edge.corner, vertex[row].tolist(), strict=True):
                if third != NONE:
                    begins = max((_begins(e) for e in at[v] if set(e.forms) == {own, third}), default=0.0)
                    line = _ended(line[::way], forms[third], begins)[::way]
            if len(line) > 1:
                out.append(TangentLine(row, line, False))
    return out


def _tangents(rounding: Rounding, two: Sequence[Surface], points: Float[Array, "M 3"]) -> list[Float[Array, "M 3"]]:
    """Where the ball that rolls along an edge, given by points, touches both forms."""
    away = rounding.radius * np.array(rounding.sides)
    middle = onto(two, points, away=away)
    return [middle - off * form.normal(middle) for form, off in zip(two, away, strict=True)]


def _begins(edge: Edge) -> float:
    """How far from either form of an edge its rounding begins on the other, as between planes."""
    return 0.0 if edge.rounding is None else edge.rounding.radius * (1 - edge.rounding.cosine)


def _ended(line: Float[Array, "M 3"], third: Surface, begins: float) -> Float[Array, "L 3"]:
    """The line without what lies, at its end, nearer to a third form than that one's rounding begins."""
    off = third.distance(line)
    off = off * np.sign(off[len(line) // 2]) - begins
    inside = np.flatnonzero(off[len(line) // 2 :] <= 0)
    if not len(inside):
        return line
    k = len(line) // 2 + int(inside[0])
    if k == 0 or off[k - 1] <= 0:
        return line[:0]
    share = off[k - 1] / (off[k - 1] - off[k])
    return np.concatenate([line[:k], [line[k - 1] + share * (line[k] - line[k - 1])]])
