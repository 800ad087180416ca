"""How near a sketch is to a known one, by points along their strokes."""

import numpy as np
import torch
from scipy.spatial import cKDTree

import diff3ds as ds


def points_on(sketch: ds.Sketch) -> torch.Tensor:
    return ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 65)).reshape(-1, 3)


def f_score(found: ds.Sketch, truth: ds.Sketch) -> float:
    """At 5 % of the size."""
    found, truth = points_on(found).numpy(), points_on(truth).numpy()
    near = 0.05 * float(np.ptp(truth, axis=0).max())
    precision = float((cKDTree(truth).query(found)[0] < near).mean())
    recall = float((cKDTree(found).query(truth)[0] < near).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9)
