"""What the views say of circles: those of the ground truth, placed as `diff3ds views` does, starting from the truth.

    python benchmarks/circle_limits.py OUT [--seeds 0-29]

OUT is a folder of `views.py cad`: its objects, and its runs, which know the detector's bias. A circle that comes out
wrong even so is one that its ridges alone do not fix. Curves that are found together may be better: the second table
is of circles that stay in their true planes, and whose radii are the median of those that are equal in truth. Prints
how many circles of each kind are within the bounds of curve_scores.py.
"""

import argparse
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from curve_scores import CENTRE_ERROR, LEAST_ANGLE, LEAST_RADIUS, RADIUS_ERROR

from diff3ds.curves.shapes.primitives import Circle, angles_of
from diff3ds.edges.evidence.bias import Bias, corrected, outline_sides
from diff3ds.edges.evidence.edge_views import EdgeViews, edge_views
from diff3ds.edges.evidence.support import crowded, inliers
from diff3ds.edges.measure.fit_ridges import circle_at, in_plane, shown_of, undisturbed
from diff3ds.edges.measure.offsets import near_joints
from diff3ds.edges.measure.planes import LOOKS
from diff3ds.photogrammetry.find_project import find_project
from diff3ds.pictures.dataset import load_posed
from diff3ds.pictures.frame import Frame, frame_of
from diff3ds.tasks.views.edge_fit.edges_of_pictures import ridges_of

# Places along every curve.
PLACES = 60
# Arcs of more than this are whole circles, radians.
WHOLE = 6.0


@dataclass(frozen=True)
class Outcome:
    """One circle: its angle, what circles of its object that are equal to it share, and the relative errors."""

    angle: float
    series: tuple[str, float, bool]
    radius: float
    center: float


def main() -> None:
    """Prints a line for whole circles, longer arcs and quarter circles, placed alone and with what else is known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", default="0-29")
    options = parser.parse_args()
    first, last = map(int, options.seeds.split("-"))
    names = [f"{seed:02}" for seed in range(first, last + 1)]
    print("each alone")
    report([outcome for name in names for outcome in outcomes(options.out, name, flat=False)])
    print("in its true plane, the radius the median of those that are equal in truth")
    report(agreed([outcome for name in names for outcome in outcomes(options.out, name, flat=True)]))


def report(found: list[Outcome]) -> None:
    """Prints how many of each kind are right."""
    kinds = {"whole": (WHOLE, 7.0), "longer arcs": (1.6, WHOLE), "quarters": (0.0, 1.6), "all": (0.0, 7.0)}
    for kind, (least, most) in kinds.items():
        own = [o for o in found if least <= o.angle < most]
        radius = [o for o in own if abs(o.radius) <= RADIUS_ERROR]
        both = sum(o.center <= CENTRE_ERROR for o in radius)
        error = 100 * float(np.median([abs(o.radius) for o in own])) if own else math.nan
        print(
            f"{kind:12} {len(own):4}: radius within .5 % {len(radius)}, centre too {both}; median error {error:.2f} %"
        )


def agreed(found: list[Outcome]) -> list[Outcome]:
    """The circles with the median radius of their series."""
    errors: dict[tuple[str, float, bool], list[float]] = {}
    for one in found:
        errors.setdefault(one.series, []).append(one.radius)
    return [replace(one, radius=float(np.median(errors[one.series]))) for one in found]


def outcomes(out: Path, name: str, flat: bool) -> list[Outcome]:
    """Of all circles of one object that curve_scores.py asks for."""
    views, frame, outward = prepared(out, name)
    truth = json.loads((out / "objects" / name / "ground_truth.json").read_text())["curves"]
    drawn = [along(curve, frame) for curve in truth]
    tangents = [np.gradient(x, axis=0) for x in drawn]
    units = np.concatenate([t / (np.linalg.norm(t, axis=1, keepdims=True) + 1e-12) for t in tangents])
    x = np.concatenate(drawn)
    clear = ~crowded(views, x, units)
    free = undisturbed(views, x, units, inliers(views, x, units), clear, np.ones_like(clear))
    found = []
    for k, curve in enumerate(truth):
        if curve["type"] != "circle" or curve["angle"] < LEAST_ANGLE - 1e-3 or curve["radius"] <= LEAST_RADIUS:
            continue
        start = true_circle(curve, drawn[k], frame)
        sight = (free if curve["angle"] > WHOLE else clear)[:, PLACES * k : PLACES * (k + 1)]
        circle = settled(start, drawn[k], sight, views, outward, curve["angle"], flat)
        off = float(np.linalg.norm(circle.center - start.center)) / start.radius
        series = (name, round(curve["radius"], 5), curve["angle"] > WHOLE)
        found.append(Outcome(curve["angle"], series, circle.radius / start.radius - 1, off))
    return found


def prepared(out: Path, name: str) -> tuple[EdgeViews, Frame, float]:
    """The ridges of an object without the bias that its run found, their frame, and the offset of outlines."""
    pictures = load_posed(find_project(out / "objects" / name, "edges"), "edges")
    frame = frame_of(pictures.cameras, pictures.store)
    cameras = frame.cameras(pictures.cameras)
    ridges = ridges_of(pictures, torch.arange(len(pictures)))
    run = json.loads((out / "sketches" / "plain" / name / "run.json").read_text())["bias_pixels"]
    bias = Bias(run["dx"], run["dy"], run["outward"])
    sides = [outline_sides(ridge, cameras.size) for ridge in ridges]
    return edge_views(cameras, corrected(ridges, sides, bias)), frame, bias.outward


def along(curve: dict[str, Any], frame: Frame) -> np.ndarray:
    """Places in the middle of even steps along a curve of the ground truth, in the frame."""
    points = (np.array(curve["points"]) - frame.center.numpy()) / frame.radius
    length = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()])
    at = (np.arange(PLACES) + 0.5) / PLACES * length[-1]
    return np.column_stack([np.interp(at, length, axis) for axis in points.T])


def true_circle(curve: dict[str, Any], x: np.ndarray, frame: Frame) -> Circle:
    """The circle of the ground truth, in the frame; its angles begin near the first place."""
    center, normal = (np.array(curve["center"]) - frame.center.numpy()) / frame.radius, np.array(curve["normal"])
    normal = normal / np.linalg.norm(normal)
    ray = x[0] - center
    ray = ray - (ray @ normal) * normal
    u = ray / np.linalg.norm(ray)
    return Circle(center, u, np.cross(normal, u), curve["radius"] / frame.radius, np.zeros(1))


def settled(
    start: Circle, x: np.ndarray, clear: np.ndarray, views: EdgeViews, outward: float, angle: float, flat: bool
) -> Circle:
    """The circle after as many looks as `placed` takes; the last one that did not shrink to nothing."""
    angles, circle = angles_of(start, x), start
    joints = near_joints(x, x[[0, -1]], views.pixel) if angle < WHOLE else None
    for _ in range(LOOKS):
        shown = clear & shown_of(circle, angles, views)
        free = in_plane(circle) if flat else None
        moved = circle_at(circle, angles, shown, views, outward, None, joints, free=free)
        if moved is None:
            break
        circle = moved
    return circle


if __name__ == "__main__":
    main()
