"""How well 3D curves match the sharp edges of an object: nearest distances, number of curves, circles found as circles.

    python benchmarks/curve_scores.py SKETCH.json GROUND_TRUTH.json [--json]

The distances follow the protocol of EMAP (Li et al., CVPR 2024): curves sampled every .005 by arc length and averaged
in voxels of 2/256, against the ground truth sampled alike; precision, recall and F-score at 5, 10 and 20 mm, where the
longest side of the object is 1 m. A circle counts as one curve, however many rational arcs it takes.
"""

import argparse
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diff3ds.metrics.curve_scores import STEP, resampled
from diff3ds.metrics.curve_scores import curve_scores as distances

# A curve is a circular arc when its points keep their distance from a centre to this part of the radius. A polynomial
# cubic does so over 90 degrees (2.7e-4); only a rational curve is exact, to a float32's rounding.
ROUND, EXACT = 1e-3, 1e-5
# A ground-truth circle is found by an arc this near to its radius (relative) and to its centre (in radii).
RADIUS_ERROR, CENTRE_ERROR = 0.005, 0.01
# Only circles of at least this angle and radius are asked for: less of one does not fix its radius from pictures.
LEAST_ANGLE, LEAST_RADIUS = math.pi / 2, 0.03
# A rational curve this close to a straight line (sagitta by length) has no circle.
STRAIGHT = 1e-3


@dataclass(frozen=True)
class Circle:
    """The circle in space that a curve lies on."""

    center: np.ndarray
    radius: float
    normal: np.ndarray
    error: float  # greatest distance of the curve from the circle, in radii


def bezier(points: np.ndarray, weights: np.ndarray | None, count: int = 400) -> np.ndarray:
    """Points (count, 3) of a rational Bézier curve of any degree at even parameters."""
    t, degree = np.linspace(0, 1, count), len(points) - 1
    basis = np.stack([math.comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(degree + 1)], 1)
    basis = basis if weights is None else basis * weights
    return basis @ points / basis.sum(1, keepdims=True)


def circle_of(curve: np.ndarray) -> Circle | None:
    """The circle that a sampled curve (n, 3) lies on to ROUND of its radius, None where there is none."""
    middle = curve.mean(0)
    _, _, rows = np.linalg.svd(curve - middle, full_matrices=False)
    flat = (curve - middle) @ rows.T
    if np.ptp(flat[:, 1]) < STRAIGHT * np.ptp(flat[:, 0]):
        return None
    # |p|^2 = 2 p.c + k is linear in the centre c and k = r^2 - |c|^2.
    system = np.column_stack([2 * flat[:, :2], np.ones(len(flat))])
    (x, y, k), *_ = np.linalg.lstsq(system, (flat[:, :2] ** 2).sum(1), rcond=None)
    radius = math.sqrt(max(k + x * x + y * y, 0))
    off = np.hypot(np.hypot(flat[:, 0] - x, flat[:, 1] - y) - radius, flat[:, 2])
    error = off.max() / max(radius, 1e-12)
    return Circle(middle + x * rows[0] + y * rows[1], radius, rows[2], error) if error <= ROUND else None


def same_circle(a: Circle, b: Circle) -> bool:
    """Whether two arcs are of one circle: radius and centre to 1 % of the radius, axes to 2 degrees."""
    near = abs(a.radius - b.radius) < 0.01 * b.radius and np.linalg.norm(a.center - b.center) < 0.01 * b.radius
    return bool(near and abs(a.normal @ b.normal) > math.cos(math.radians(2)))


def count_curves(curves: list[np.ndarray], circles: list[Circle | None]) -> int:
    """Number of curves, where arcs of one circle that follow one another count once."""
    owner = list(range(len(curves)))
    ends = [(curve[0], curve[-1]) for curve in curves]
    for i in range(len(curves)):
        for j in range(i):
            one, other = circles[i], circles[j]
            if one is None or other is None or not same_circle(one, other):
                continue
            if min(np.linalg.norm(p - q) for p in ends[i] for q in ends[j]) < STEP:
                owner = [owner[j] if o == owner[i] else o for o in owner]
    return len(set(owner))


def circles_found(found: list[Circle | None], truth: list[dict]) -> dict[str, float | int | None]:
    """How many of the ground truth's circles there are as arcs, and the relative errors of their radii.

    A circle is found where an arc has its axis to 2 degrees, its centre to 1 % of the radius and its radius to .5 %;
    exactly found where that arc is a circle's to EXACT; `circles_radius` counts those whose centre may be off by 10 %
    of the radius instead. The errors of the radii, in percent, are over all circles that have an arc with their axis
    and with radius and centre to 10 %: they show near misses too.
    """
    asked = [c for c in truth if c.get("type") == "circle" and _asked(c)]
    errors, hits, exact, radii = [], 0, 0, 0
    for curve in asked:
        center, radius, normal = np.array(curve["center"]), curve["radius"], np.array(curve["normal"])
        near = [c for c in found if c and abs(c.normal @ normal) > math.cos(math.radians(2))]
        near = [(abs(c.radius / radius - 1), np.linalg.norm(c.center - center) / radius, c.error) for c in near]
        good = [error for wrong, off, error in near if wrong <= RADIUS_ERROR and off <= CENTRE_ERROR]
        hits, exact = hits + bool(good), exact + any(error <= EXACT for error in good)
        radii += any(wrong <= RADIUS_ERROR and off < 0.1 and error <= EXACT for wrong, off, error in near)
        close = [wrong for wrong, off, _ in near if wrong < 0.1 and off < 0.1]
        errors += [100 * min(close)] if close else []
    return {
        "circles": len(asked),
        "circles_found": hits,
        "circles_exact": exact,
        "circles_radius": radii,
        "radius_error_median": float(np.median(errors)) if errors else None,
        "radius_error_worst": float(np.max(errors)) if errors else None,
    }


def _asked(curve: dict) -> bool:
    return curve["angle"] >= LEAST_ANGLE - 1e-3 and curve["radius"] > LEAST_RADIUS


def score(sketch: dict, truth: dict) -> dict[str, float | int | None]:
    """All figures of a sketch against a ground truth, both as read from their JSON files.

    The sketch has "control_points" or "points" (n, k, 3) and, if rational, "weights" (n, k). A stroke of several
    segments counts as so many curves: the ground truth has one for each line and arc, too.
    """
    controls = sketch.get("control_points", sketch.get("points"))
    if controls is None:
        raise ValueError('the sketch needs "control_points" (n, k, 3)')
    weights = sketch.get("weights") or [None] * len(controls)
    curves = [
        bezier(np.asarray(p, float), None if w is None else np.asarray(w, float))
        for p, w in zip(controls, weights, strict=True)
    ]
    known = truth.get("curves", [])
    points = truth["points"] if "points" in truth else [p for c in known for p in resampled(np.array(c["points"]))]
    circles = [circle_of(curve) for curve in curves]
    expected = len(known) or sum(truth.get("curve_types", {}).values())
    counts = {"curves": len(curves), "curves_joined": count_curves(curves, circles), "curves_truth": expected}
    return {**distances(curves, np.asarray(points, float)), **counts, **circles_found(circles, known)}


def main() -> None:
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sketch", type=Path)
    parser.add_argument("ground_truth", type=Path)
    parser.add_argument("--json", action="store_true", help="print JSON")
    chosen = parser.parse_args()
    figures = score(json.loads(chosen.sketch.read_text()), json.loads(chosen.ground_truth.read_text()))
    if chosen.json:
        print(json.dumps(figures))
    else:
        print("  ".join(f"{k} {v:.3f}" if isinstance(v, float) else f"{k} {v}" for k, v in figures.items()))


if __name__ == "__main__":
    main()
