"""How near curves are to known ones in space, by the protocol of EMAP (Li et al., CVPR 2024)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
# Of objects whose longest side is 1: how far samples of curves lie apart, and the side of a voxel in which they become
# one, so that a curve that is there twice counts once; and within what precision and recall count, mm of 1,000.
STEP, VOXEL, WITHIN = 0.005, 2 / 256, (5, 10, 20)


def resampled(polyline: Points, step: float = STEP) -> Points:
    """Points (n, 3) about `step` apart along a polyline (m, 3), with both its ends."""
    along = np.concatenate([[0], np.linalg.norm(np.diff(polyline, axis=0), axis=1).cumsum()])
    places = np.linspace(0, along[-1], max(2, round(along[-1] / step) + 1))
    return np.column_stack([np.interp(places, along, axis) for axis in polyline.T])


def voxel_means(points: Points, size: float = VOXEL) -> Points:
    """One point for each occupied voxel: the mean of those in it."""
    _, voxel = np.unique(np.floor(points / size).astype(int), axis=0, return_inverse=True)
    voxel = voxel.ravel()
    return np.column_stack([np.bincount(voxel, axis) for axis in points.T]) / np.bincount(voxel)[:, None]


def curve_scores(curves: Sequence[Points], truth: Points) -> dict[str, float]:
    """Scores curves against points of the true ones; the longest side of the object is 1, which counts as a metre.

    Args:
        curves: dense polylines (m, 3) each.
        truth: (n, 3), as dense as `resampled` makes them.

    Returns:
        acc_mm and comp_mm, the mean distances to the nearest point, there and back; P5, R5, F5 and the same for 10
        and 20: the parts within so many mm, and their harmonic mean. Without curves the distances are infinite.
    """
    from scipy.spatial import cKDTree

    if not curves:
        nothing = {f"{k}{mm}": 0.0 for mm in WITHIN for k in "PRF"}
        return {"acc_mm": float("inf"), "comp_mm": float("inf"), **nothing}
    found = voxel_means(np.concatenate([resampled(curve) for curve in curves]))
    there, back = cKDTree(truth).query(found)[0], cKDTree(found).query(truth)[0]
    figures: dict[str, Any] = {"acc_mm": 1000 * there.mean(), "comp_mm": 1000 * back.mean()}
    for mm in WITHIN:
        precision, recall = (there < mm / 1000).mean(), (back < mm / 1000).mean()
        harmonic = 2 * precision * recall / (precision + recall) if precision + recall else 0.0
        figures |= {f"P{mm}": precision, f"R{mm}": recall, f"F{mm}": harmonic}
    return {name: float(value) for name, value in figures.items()}
