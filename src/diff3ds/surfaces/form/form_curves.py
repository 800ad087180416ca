"""From samples of a surface to the curves of its edges: forms found, labelled and cut with each other."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Index, Int
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.surfaces.form.edge_strokes import drawn_runs
from diff3ds.surfaces.form.edges import Edge, corners, edges_between, without_scraps
from diff3ds.surfaces.form.exact_meets import Surface
from diff3ds.surfaces.form.free import free_regions
from diff3ds.surfaces.form.labels import Labelled, labelled, spread
from diff3ds.surfaces.form.regular import regularised
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import found_forms, within
from diff3ds.surfaces.lines.feature_curves import _curves

# Samples that no form explains belong to the nearest one up to so many spacings and reaches away: what lies between
# two forms is their edge. Empirical.
BAND_SPACINGS, BAND_REACHES = 2.5, 2.0


@dataclass(frozen=True, eq=False)
class FormCurves:
    """The forms of a surface and the curves of their edges.

    Attributes:
        curves: of the edges, which share vertices at corners.
        edges: what each was made of, in their order.
        owner: of each curve the number of its edge.
        found: the forms and the labels of the samples.
        surfaces: the forms, and after them the free-form regions.
        label: which of these each sample is on, carried on over what lies between them.
    """

    curves: Curves
    edges: list[Edge]
    owner: list[int]
    found: Labelled
    surfaces: list[Surface]
    label: Int[Index, " N"]


def band(samples: Samples) -> float:
    """How wide what lies between two forms may be, world units."""
    return BAND_SPACINGS * samples.spacing + BAND_REACHES * within(samples)


def form_curves(samples: Samples, seed: int = 0) -> FormCurves:
    """The edges of a surface as exact intersections of the forms that it is made of."""
    generator = np.random.default_rng(seed)
    found = labelled(samples, [one.form for one in found_forms(samples, generator)])
    found = Labelled(regularised(samples, found.label, found.forms), found.label)
    carried = spread(samples, found.label, band(samples))
    label, free = free_regions(samples, found.label, carried, len(found.forms))
    forms: list[Surface] = [*found.forms, *free]
    label = spread(samples, label, band(samples))
    edges = edges_between(samples, forms, label)
    points, vertex = corners(samples, edges, forms)
    kept = without_scraps(samples, edges, vertex)
    edges = [edges[k] for k in kept]
    runs, places = drawn_runs(samples, edges, points, vertex[kept])
    pieces = [(run.vertices, run.strokes) for run in runs]
    owner = [run.edges[0] for run in runs for _ in run.strokes]
    curves = _curves(places, pieces)
    return FormCurves(curves, edges, owner, found, forms, label)
