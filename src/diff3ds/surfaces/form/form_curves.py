"""From samples of a surface to the curves of its edges: forms found, labelled and cut with each other."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from diff3ds._shapes import Index, Int
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.surfaces.form.edge_strokes import drawn_runs
from diff3ds.surfaces.form.edges import Edge, corners, edges_between, without_scraps
from diff3ds.surfaces.form.exact_meets import Surface
from diff3ds.surfaces.form.free import free_regions
from diff3ds.surfaces.form.labels import Labelled, labelled, spread
from diff3ds.surfaces.form.regular import regularised
from diff3ds.surfaces.form.rounding import tangent_lines, with_roundings
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import found_forms, within
from diff3ds.surfaces.lines.feature_curves import curves_of

Rounded = Literal["edge", "tangents"]
CREASE, TANGENT = "crease", "tangent"

# Samples that no form explains belong to the nearest one up to so many spacings and reaches away: what lies between
# two forms is their edge. Empirical.
BAND_SPACINGS, BAND_REACHES = 2.5, 2.0


@dataclass(frozen=True, eq=False)
class FormCurves:
    """The forms of a surface and the curves of their edges.

    Attributes:
        curves: of the edges, which share vertices at corners.
        kinds: what each curve is: "crease", or "tangent" where a rounded edge begins.
        edges: what each was made of, in their order.
        owner: of each curve the number of its edge.
        found: the forms and the labels of the samples.
        surfaces: the forms, and after them the free-form regions.
        label: which of these each sample is on, carried on over what lies between them.
    """

    curves: Curves
    kinds: tuple[str, ...]
    edges: list[Edge]
    owner: list[int]
    found: Labelled
    surfaces: list[Surface]
    label: Int[Index, " N"]


def band(samples: Samples) -> float:
    """How wide what lies between two forms may be, world units."""
    return BAND_SPACINGS * samples.spacing + BAND_REACHES * within(samples)


def form_curves(samples: Samples, seed: int = 0, rounded: Rounded = "edge") -> FormCurves:
    """The edges of a surface as exact intersections of the forms that it is made of.

    Args:
        seed: of what is drawn by chance.
        rounded: whether a rounded edge is one curve, where its sides would meet, or its two tangent lines.
    """
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
    edges = with_roundings(samples, label, [edges[k] for k in kept], forms)
    tangents = tangent_lines(samples, edges, vertex[kept], forms) if rounded == "tangents" else []
    runs, places = drawn_runs(samples, edges, points, vertex[kept], tangents)
    pieces = [(run.vertices, run.strokes) for run in runs]
    owner = [run.edges[0] for run in runs for _ in run.strokes]
    kinds = tuple(TANGENT if tangents and edges[k].rounding else CREASE for k in owner)
    return FormCurves(curves_of(places, pieces), kinds, edges, owner, found, forms, label)
