"""Which form each sample of a surface belongs to, where forms touch, and forms refitted to what is theirs."""

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.surfaces.form.exact_meets import onto
from diff3ds.surfaces.form.form_kinds import Form, FormKind
from diff3ds.surfaces.form.free import NONE
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import ALIKE, LEAST, LEAST_SHARE, REFITTED, STANDARD, best_kind, within

# Sweeps over the samples, each of which takes the label that its own place and its neighbours' labels like best; what
# a neighbour's label counts, all of them together, in squared standard deviations. Empirical.
SWEEPS, TOGETHER = 6, 6.0
# A form becomes one of another kind where that makes the mean square distance so much smaller. Empirical.
OTHER = 1.25
# The distance that is rounding, in longest sides.
ROUNDING = 1e-7
# A normal that is off by `ALIKE` counts as much as a distance of so many thirds of the reach. Empirical.
TURNED = 4.0
# Two forms are one where one fits the samples of both nearly as well as each its own. Empirical.
MERGED = 1.3
# A form of which so large a share lies on its neighbours, or on its own rim, is a rim of theirs. Empirical.
RIM, ALL_RIM = 0.8, 0.97
# A round form is a rounded edge of two others that meet at more than this, radians, where its samples are so near to
# their edge: in spacings, of which no more count than make WIDEST longest sides, or in longest sides. Empirical.
MEET, BAND, WIDEST, ROUNDED = 0.4, 2.2, 0.05, 0.035
# A form is not what its samples lie on where a cubic says so large a share of their squared distances, more of few
# samples, and so much in longest sides. Empirical.
SAID, BY_CHANCE, OFF = 0.45, 40.0, 0.0014


@dataclass(frozen=True, eq=False)
class Labelled:
    """Forms, and which of them each sample belongs to; NONE where it is none."""

    forms: list[Form]
    label: Int[Index, " N"]


def labelled(samples: Samples, forms: Sequence[Form]) -> Labelled:
    """Every sample to the form that explains it and its neighbours best; forms refitted to their samples."""
    costs: dict[Form, NDArray[np.float32]] = {}
    label, current = _swept(samples, list(forms), costs)
    for change in (_merged, _needed, _of_best_kinds, _refitted, _needed, _refitted, _true):
        changed = change(samples, label, current)
        costs = {one: cost for one, cost in costs.items() if one in changed}
        label, current = _swept(samples, changed, costs)
    return Labelled(current, label)


def spread(samples: Samples, label: Int[Index, " N"], reach: float) -> Int[Index, " N"]:
    """Labels carried on to samples without one that lie within a distance along neighbours of samples that have one."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    i, j = samples.pairs.T
    length = np.maximum(np.linalg.norm(samples.points[i] - samples.points[j], axis=1), 1e-12)
    graph = coo_matrix((length, (i, j)), shape=(len(label), len(label))).tocsr()
    bare = label == NONE
    # Only labelled samples beside bare ones need to be looked from.
    edge = np.zeros(len(label), bool)
    mixed = bare[i] != bare[j]
    edge[i[mixed]] = edge[j[mixed]] = True
    starts = np.flatnonzero(edge & ~bare)
    if not len(starts):
        return label
    _, _, source = dijkstra(graph, False, starts, limit=reach, min_only=True, return_predecessors=True)
    out = label.copy()
    found = bare & (source >= 0)
    out[found] = label[source[found]]
    return out


def _swept(
    samples: Samples, forms: list[Form], costs: dict[Form, NDArray[np.float32]]
) -> tuple[Int[Index, " N"], list[Form]]:
    """The labels that cost least: distances from forms, turns of normals, and neighbours with other labels.

    Without pieces of a form that are too small to say that it is there, and without forms that have no other.

    Args:
        costs: of all samples on forms, as far as they are known; others are added.
    """
    if not forms:
        return np.full(len(samples), NONE), forms
    third = within(samples) / 3
    for one in forms:
        if one not in costs:
            distance, cosine = one.measured(samples.points, samples.normals)
            turn = (1 - np.minimum(np.abs(cosine), 1)) / (1 - np.cos(ALIKE))
            costs[one] = np.minimum((distance / third) ** 2 + TURNED * turn, 60).astype(np.float32)
    none = np.full(len(samples), 9 + TURNED, np.float32)
    cost = np.stack([*(costs[one] for one in forms), none], 1)
    graph = samples.graph
    degree = np.maximum(np.asarray(graph.sum(1)).ravel(), 1)[:, None]
    label = cost.argmin(1)
    for _ in range(SWEEPS):
        ones = np.zeros(cost.shape, np.float32)
        ones[np.arange(len(label)), label] = 1
        shared = graph @ ones
        shared *= TOGETHER
        shared /= degree
        changed = np.subtract(cost, shared, out=shared).argmin(1)
        if (changed == label).all():
            break
        label = changed
    return _without_small(samples, np.where(label == len(forms), NONE, label), forms)


def _without_small(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> tuple[Int[Index, " N"], list[Form]]:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    i, j = samples.pairs.T
    same = label[i] == label[j]
    graph = coo_matrix((same[same], (i[same], j[same])), shape=(len(label), len(label)))
    piece = connected_components(graph, directed=False)[1]
    least = max(LEAST, LEAST_SHARE * len(label))
    label = np.where(np.bincount(piece)[piece] < least, NONE, label)
    kept, row = np.unique(label[label != NONE], return_inverse=True)
    out = np.full(len(label), NONE)
    out[label != NONE] = row
    return out, [forms[k] for k in kept]


def _refitted(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> list[Form]:
    return [refitted(samples, one, some_of(samples, label, row)) for row, one in enumerate(forms)]


def _of_best_kinds(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> list[Form]:
    """The forms; those that their samples are farther from than is usual may be of another kind."""
    off = np.array([_rms(one, some_of(samples, label, row)) for row, one in enumerate(forms)])
    usual = np.average(off, weights=np.bincount(label[label != NONE], minlength=len(forms))) if len(forms) else 0.0
    return [
        best_kind(one, *some_with_normals(samples, label, row), samples, OTHER) if off[row] > usual else one
        for row, one in enumerate(forms)
    ]


def refitted(samples: Samples, one: Form, points: Float[Array, "S 3"], held: Set[int] = frozenset()) -> Form:
    """The form fitted to its samples, but for numbers that are held, as of `Form.fitted`."""
    scale = within(samples) / 2
    rough = one.fitted(points, scale, held)
    # Samples beside an edge may belong to the other form: what is far off for this one's has no part.
    own = STANDARD * float(np.median(np.abs(rough.distance(points))))
    return rough.fitted(points, float(np.clip(own, ROUNDING * samples.size, scale)), held)


def some_of(samples: Samples, label: Int[Index, " N"], row: int) -> Float[Array, "S 3"]:
    """Points of a form's samples, as many as a fit looks at."""
    places = samples.places(np.flatnonzero(label == row))
    return places[np.unique(np.linspace(0, len(places) - 1, REFITTED).astype(int))]


def some_with_normals(
    samples: Samples, label: Int[Index, " N"], row: int
) -> tuple[Float[Array, "S 3"], Float[Array, "S 3"]]:
    """Some of a form's samples, as many as a fit looks at, and their normals."""
    rows = np.flatnonzero(label == row)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, REFITTED).astype(int))]
    return samples.points[rows], samples.normals[rows]


def _merged(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> list[Form]:
    """The forms, those that are one only once."""
    reach = within(samples)
    floor = 0.1 * reach
    own = [some_of(samples, label, row) for row in range(len(forms))]
    current, alive = list(forms), [True] * len(forms)
    for b in range(len(forms)):
        for a in range(b):
            if not (alive[a] and alive[b]) or forms[a].kind != forms[b].kind:
                continue
            if np.abs(current[a].distance(own[b])).mean() > 3 * reach:
                continue
            both = current[a].fitted(np.concatenate([own[a], own[b]]), reach)
            apart = max(_rms(current[a], own[a]), _rms(current[b], own[b]), floor)
            if max(_rms(both, own[a]), _rms(both, own[b])) < MERGED * apart:
                current[a], alive[b] = both, False
                own[a] = np.concatenate([own[a], own[b]])
    return [one for one, there in zip(current, alive, strict=True) if there]


def _needed(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> list[Form]:
    """Without forms whose samples lie on the others that they touch, or beside the edge between two of these."""
    i, j = samples.pairs.T
    reach = within(samples)
    alive = np.ones(len(forms), bool)
    rim = np.zeros(len(label), bool)
    rim[i[label[i] != label[j]]] = rim[j[label[i] != label[j]]] = True
    for row in np.argsort(np.bincount(label[label != NONE], minlength=len(forms)), kind="stable"):
        members = np.flatnonzero(label == row)
        touched = np.concatenate([label[j[label[i] == row]], label[i[label[j] == row]]])
        count = np.bincount(touched[touched != NONE], minlength=len(forms)) * alive
        count[row] = 0
        points = samples.points[members]
        away = [np.abs(forms[k].distance(points)) for k in np.flatnonzero(count)]
        on_others = (np.min(away, axis=0) < reach).mean() if away else 0.0
        two = [forms[k] for k in np.argsort(-count, kind="stable")[:2] if count[k]]
        if on_others > RIM or rim[members].mean() > ALL_RIM or is_rounding(samples, forms[row], points, two):
            alive[row] = False
    return [one for one, there in zip(forms, alive, strict=True) if there]


def is_rounding(samples: Samples, one: Form, points: Float[Array, "M 3"], two: list[Form]) -> bool:
    """Whether a form is no more than what the edge between two others is rounded or bevelled by."""
    if len(two) < 2 or one.kind == FormKind.PLANE:
        return False
    corner = onto(two, points)
    normals = [other.normal(corner) for other in two]
    meet = np.abs((normals[0] * normals[1]).sum(1)) < np.cos(MEET)
    near = np.linalg.norm(corner - points, axis=1) < max(
        min(BAND * samples.spacing, WIDEST * samples.size), ROUNDED * samples.size
    )
    return bool((meet & near).mean() > RIM)


def _true(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> list[Form]:
    """Without forms that are no more than near to their samples: a cubic over the form says how far off each is."""
    least = (OFF * samples.size) ** 2
    kept = []
    for row, one in enumerate(forms):
        points = some_of(samples, label, row)
        off = one.distance(points)
        place = one.projected(points) - points.mean(0)
        x, y, z = (place / max(float(place.std()), 1e-300)).T
        terms = np.stack([x**i * y**j * z**k for i in range(4) for j in range(4 - i) for k in range(4 - i - j)], 1)
        gram = terms.T @ terms
        gram[np.diag_indices_from(gram)] += 1e-9 * len(off)
        left = off - terms @ np.linalg.solve(gram, terms.T @ off)
        whole, by_cubic = float((off * off).mean()), float((off * off).mean() - (left * left).mean())
        if by_cubic < least or by_cubic < (SAID + BY_CHANCE / len(off)) * whole:
            kept.append(one)
    return kept


def _rms(one: Form, points: Float[Array, "S 3"]) -> float:
    return float(np.sqrt((one.distance(points) ** 2).mean()))
