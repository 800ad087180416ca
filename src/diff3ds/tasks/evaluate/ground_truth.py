"""Runs of `diff3ds views` against what is known of their scenes: true curves, and scores of held-out pictures."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._files import read_json
from diff3ds.bezier import evaluate
from diff3ds.metrics.curve_scores import Points, curve_scores, resampled
from diff3ds.sketch import Sketch
from diff3ds.tasks.evaluate.emap_truth import emap_truth
from diff3ds.tasks.evaluate.runs import Run

# The file with the true curves, beside the pictures of a scene.
TRUTH = "ground_truth.json"
# Columns of what `diff3ds views` has measured, by its names in run.json.
MEASURED = {"psnr_test": "PSNR", "ssim_test": "SSIM", "psnr": "PSNR of the fit", "ssim": "SSIM of the fit"}
# Samples of a curve, far denser than those of the protocol.
SAMPLES = 400
# Sharp edges may span less than their object, and noise may span a little more.
LEAST_SPAN, MOST_SPAN = 0.5, 1.05


def scene_scores(run: Run, sketch: Sketch) -> dict[str, float]:
    """What is known of how good a run of posed pictures is; nothing where its scene has neither truth nor colours.

    The distances of a sketch without strokes are left out.

    Raises:
        FileNotFoundError, ValueError: the scene is not where it was; the sketch was moved from there; as `read_truth`.
    """
    scores = {MEASURED[name]: value for name, value in run.record.get("scores", {}).items() if name in MEASURED}
    if (truth := truth_of(run)) is not None:
        if "placed" in run.record:
            raise ValueError(
                f"{run.folder}: --up or --scale has moved this sketch out of the world of {run.scene}, where the true "
                "curves are: to score it make the run without them"
            )
        points, metre = truth
        scores |= curve_scores([curve / metre for curve in _polylines(sketch)], points)
    return {name: value for name, value in scores.items() if math.isfinite(value)}


def truth_of(run: Run) -> tuple[Points, float] | None:
    """What `read_truth` or `emap_truth` reads of a run's scene; None where it has neither.

    Raises:
        FileNotFoundError, ValueError: the scene is not where it was; damaged files.
    """
    if not run.scene.is_dir():
        raise FileNotFoundError(
            f"{run.folder}: its scene {run.scene} is not there, which may have a {TRUTH}: run eval where it is found"
        )
    path = run.scene / TRUTH
    return read_truth(path) if path.is_file() else emap_truth(run.scene)


def read_truth(path: Path) -> tuple[Points, float]:
    """Points (n, 3) on the true curves, in lengths of the longest side of their object, and that side.

    The file has `curves`, of which each has `points` (m, 3), a polyline; or `points` (n, 3) on all of them. Where the
    longest side is not 1, `longest_side` says what it is.

    Raises:
        ValueError: it has neither; damaged numbers; curves that do not fit that side.
    """
    content = read_json(path)
    if not isinstance(content, dict) or not ("curves" in content or "points" in content):
        raise ValueError(f'{path}: a ground truth has "curves", each with "points", or "points" alone')
    side = content.get("longest_side", 1)
    if not isinstance(side, int | float) or isinstance(side, bool) or not 0 < side < math.inf:
        raise ValueError(f"{path}: longest_side is a length above 0, got {side!r}")
    points = _points(path, content, side)
    span = float(np.ptp(points, axis=0).max())
    if not LEAST_SPAN <= span <= MOST_SPAN:
        raise ValueError(
            f"{path}: the curves span {span * side:g}, where the longest side of their object is {side:g}: say in it "
            f'how long that is, "longest_side": {span * side:g}'
        )
    return points, side


def _points(path: Path, content: dict[str, Any], side: float) -> Points:
    given = content.get("curves", [content])
    try:
        lists = [np.asarray(curve["points"], dtype=np.float64) / side for curve in given]
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        raise ValueError(f'{path}: each of "curves" has "points", lists of three numbers') from error
    if not lists or any(p.ndim != 2 or p.shape[1:] != (3,) or not len(p) or not np.isfinite(p).all() for p in lists):
        raise ValueError(f"{path}: points of curves are lists of three finite numbers, and at least one")
    return np.concatenate([resampled(p) for p in lists] if "curves" in content else lists)


def _polylines(sketch: Sketch) -> list[Points]:
    t = torch.linspace(0, 1, SAMPLES, dtype=torch.float64)
    dense = evaluate(sketch.points.double(), sketch.weights.double(), t)
    return list(dense.numpy())
