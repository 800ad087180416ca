"""What run.json says of the forms that something is made of."""

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.surfaces.form.form_curves import FormCurves
from diff3ds.surfaces.form.form_kinds import Form


def told_forms(found: FormCurves, middle: Float[Array, " 3"], size: float) -> dict[str, object]:
    """The forms in the units of the file, of samples that were shifted and scaled, and which share they explain."""
    label = found.found.label
    return {
        "forms": [_form(one, int((label == k).sum()), middle, size) for k, one in enumerate(found.found.forms)],
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
