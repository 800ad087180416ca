"""Planes that fitted curves share, the faces of an object: they say where a small circle lies better than it does."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.primitives import Kind

# [px; empirical] Curves lie in a plane if none of their points is farther from it.
WITHIN = 0.5
# [times; empirical] What is found by curves, which are chosen by what was found, is found anew so many times.
LOOKS = 3
# [points; numerical] Sample points of a curve.
SAMPLES = 16


Flags = Bool[NDArray[np.bool_], " N"]


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane through curves.

    Attributes:
        origin: the middle of the curves.
        normal: a unit vector.
        spread: root mean square of how far the curves go to both sides of their main direction, world units: what says
            in which direction the plane lies.
    """

    origin: Float[Array, " 3"]
    normal: Float[Array, " 3"]
    spread: float

    def distances(self, x: Float[Array, "... 3"]) -> Float[Array, "..."]:
        """How far points lie from the plane, on either side."""
        return np.asarray(np.abs((x - self.origin) @ self.normal))

    def project(self, x: Float[Array, "... 3"]) -> Float[Array, "... 3"]:
        """The nearest points of the plane."""
        return x - ((x - self.origin) @ self.normal)[..., None] * self.normal


def shared_planes(curves: Curves, sure: Flags, pixel: float) -> dict[int, Plane]:
    """For whole circles, by their numbers, the plane of other curves that they nearly lie in.

    Only of curves that spread farther than the circle itself. Rounded corners get their planes from their lines
    (`fillets.py`).

    Args:
        sure: which curves have been fitted to ridges: the others say nothing of planes.
    """
    x = curves.at((torch.arange(SAMPLES) + 0.5) / SAMPLES).double().numpy()
    length = np.linalg.norm(np.diff(x, axis=1), axis=2).sum(1)
    groups = _coplanar(_seeds(curves, sure), x, length, sure, pixel)
    found: dict[int, Plane] = {}
    for i in np.nonzero(sure & (curves.kind == Kind.CIRCLE).numpy())[0].tolist():
        rows = np.arange(len(x)) == i
        planes = [_fitted(x[g & ~rows], length[g & ~rows]) for g in groups if g[i] and (g & ~rows).any()]
        near = [plane for plane in planes if plane.distances(x[rows]).max() < WITHIN * pixel]
        best = max(near, key=lambda plane: plane.spread, default=None)
        if best is not None and best.spread > _fitted(x[rows], length[rows]).spread:
            found[i] = best
    return found


def _coplanar(
    seeds: list[list[int]], x: Float[Array, "N S 3"], length: Float[Array, " N"], sure: Flags, pixel: float
) -> list[Flags]:
    """For each plane through curves of a seed, all fitted curves that lie in it; none twice."""
    found: list[Flags] = []
    for seed in seeds:
        members = np.isin(np.arange(len(x)), seed)
        for _ in range(LOOKS):
            near = _fitted(x[members], length[members]).distances(x).max(1) < WITHIN * pixel
            if not (sure & near).any():
                break
            members = sure & near
        if not any((members == known).all() for known in found):
            found.append(members)
    return found


def _seeds(curves: Curves, sure: Flags) -> list[list[int]]:
    """Curves that span a plane: arcs, and two lines that meet."""
    vertex = curves.vertex.numpy()
    lines = np.nonzero(sure & (curves.kind == Kind.LINE).numpy())[0]
    ends = vertex[lines]
    meeting = (ends[:, None, :, None] == ends[:, None]).any((2, 3))
    meet = lines[np.argwhere(np.triu(meeting, 1))].tolist()
    bent = sure & ((curves.kind == Kind.ARC) | (curves.kind == Kind.CIRCLE)).numpy()
    return [[int(i)] for i in np.nonzero(bent)[0]] + meet


def _fitted(x: Float[Array, "N S 3"], length: Float[Array, " N"]) -> Plane:
    """The plane of least squares through curves, weighted by their lengths."""
    weight = np.repeat(length, x.shape[1])[:, None] / (length.sum() * x.shape[1])
    points = x.reshape(-1, 3)
    middle = (weight * points).sum(0)
    _, size, axes = np.linalg.svd(np.sqrt(weight) * (points - middle), full_matrices=False)
    return Plane(middle, axes[2], float(size[1]))
