"""Reading curves for the tables of docs/reference/formats-read.md, and what is right to come of it."""

import math
from pathlib import Path

import numpy as np
import torch
from reading_here import reading_here

import diff3ds as ds


def read(path: Path) -> ds.Sketch:
    """As `ds.load` reads, but in this process."""
    with reading_here():
        return ds.load(path)


def box(found: ds.Sketch) -> list[list[float]]:
    """How far the curves reach, rounded."""
    low, high = ds.bezier.bounding_box(found.points, found.weights)
    return [[round(x, 9) + 0.0 for x in corner.tolist()] for corner in (low.amin(0), high.amax(0))]


def reaches(low, high, count: int | None = None, color=None):
    """Whether curves reach from a corner to another, whether they are so many, and of this colour."""

    def right(found: ds.Sketch) -> bool:
        counted = count is None or len(found) == count
        colored = color is None or np.allclose(found.color.numpy(), color)
        return bool(np.allclose(box(found), [low, high], atol=1e-6) and counted and colored)

    return right


def on_circle(center, radius: float, sweep: float = 360.0):
    """Whether curves are a circle's, so many degrees of it in all."""

    def right(found: ds.Sketch) -> bool:
        t = torch.linspace(0, 1, 9, dtype=torch.float64)
        off = (ds.bezier.evaluate(found.points, found.weights, t) - torch.tensor(center).double()).norm(dim=-1) - radius
        length = float(ds.bezier.length(found.points, found.weights).sum())
        return float(off.abs().max()) < 1e-9 and abs(length - radius * math.radians(sweep)) < 1e-6

    return right


def text(name: str, content: str):
    def make(folder: Path) -> Path:
        (folder / name).write_text(content)
        return folder / name

    return make
