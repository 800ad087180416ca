"""The edges of forms as strokes with names and kinds, how those where forms go on are drawn, and what run.json says."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import torch

from diff3ds._shapes import Array, Float
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.smooth_joints import first_curves, sketch_of
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.surfaces.form.edges import Edge
from diff3ds.surfaces.form.form_curves import TANGENT, FormCurves
from diff3ds.surfaces.form.form_kinds import Form, FormKind

# What becomes of lines where faces go on smoothly in each other.
Tangent = Literal["drawn", "thin", "hidden"]
# They are so much narrower than others: the ratio of ISO 128-2.
THIN = 0.5


def form_lines(found: FormCurves, middle: Float[Array, " 3"], size: float) -> tuple[Sketch, tuple[str, ...]]:
    """The edges of forms as strokes in the units of the file, named as in run.json, and what each is.

    Args:
        found: of samples that were shifted and scaled.
        middle: by which they were shifted.
        size: by which they were divided.
    """
    curves = found.curves
    moved = Curves(curves.points * size + torch.from_numpy(middle), curves.kind, curves.vertex)
    sketch = sketch_of(moved, DEFAULT_WIDTH)
    first = first_curves(sketch, moved)
    names = [_name(found.owner[k], found.edges[found.owner[k]], size) for k in first]
    return sketch.replace(names=names), tuple(found.kinds[k] for k in first)


def _name(number: int, edge: Edge, size: float) -> str:
    return f"edge {number}" + (f", radius {edge.rounding.radius * size:.4g}" if edge.rounding else "")


def with_tangents(sketch: Sketch, kinds: Sequence[str], tangent: Tangent) -> tuple[Sketch, tuple[str, ...]]:
    """The strokes, without those between faces that go on in each other where these are hidden, and their kinds."""
    rows = [i for i, kind in enumerate(kinds) if kind != TANGENT or tangent != "hidden"]
    return sketch[rows], tuple(kinds[i] for i in rows)


def thinned(sketch: Sketch, kinds: Sequence[str], tangent: Tangent) -> Sketch:
    """The strokes, those between faces that go on in each other narrower where they are to be thin."""
    narrow = torch.tensor([tangent == "thin" and kind.startswith(TANGENT) for kind in kinds], dtype=torch.bool)
    if not narrow.any():
        return sketch
    return sketch.replace(width=torch.where(narrow, THIN * sketch.width, sketch.width))


def told_forms(found: FormCurves, middle: Float[Array, " 3"], size: float) -> dict[str, object]:
    """The forms and their edges in the units of the file, and which share of the samples these explain.

    Args:
        found: of samples that were shifted and scaled.
        middle: by which they were shifted.
        size: by which they were divided.
    """
    label = found.found.label
    return {
        "forms": [_form(one, int((label == k).sum()), middle, size) for k, one in enumerate(found.found.forms)],
        "edges": [_edge(one, len(found.found.forms), size) for one in found.edges],
        "explained": round(float((label >= 0).mean()), 4),
        "points": len(label),
    }


def _form(one: Form, points: int, middle: Float[Array, " 3"], size: float) -> dict[str, object]:
    numbers = {
        "radius": float(one.radius) * size,
        "ring": float(one.ring) * size,
        "angle": float(np.degrees(one.angle)),
    }
    return {
        "kind": one.kind.name.lower(),
        "center": (one.center * size + middle).tolist(),
        "axis": one.axis.tolist(),
        **{name: value for name, value in numbers.items() if value},
        "points": points,
    }


def _edge(one: Edge, forms: int, size: float) -> dict[str, object]:
    told: dict[str, object] = {
        "forms": [k if k < forms else FormKind.FREE.name.lower() for k in one.forms],
        "length": one.length * size,
        "turn": one.turn,
    }
    return told if one.rounding is None else told | {"radius": one.rounding.radius * size}
