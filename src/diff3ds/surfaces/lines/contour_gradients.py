"""Contours of a mesh once more, as functions of its vertices, so that gradients flow to these.

The points of a contour stay at their places on the edges of the mesh. On a smooth surface that is exact to first order:
where a contour slides as the surface moves, it slides along the line of sight, which moves nothing in the picture. So
it does where the camera moves, which therefore has no part here: a camera's gradients are those of fixed strokes.
"""

import torch

from diff3ds._shapes import Float, Index, Int, Tensor
from diff3ds.bezier.curves import bernstein
from diff3ds.camera import Cameras
from diff3ds.curves.fit_cubics import EVEN
from diff3ds.surfaces.lines.fit_picture import FittedChains


def contours_of(
    vertices: Float[Tensor, "V 3"],
    own: Int[Index, "M 3"],
    points: Float[Tensor, "M 3"],
    fitted: FittedChains,
    camera: Cameras,
) -> Float[Tensor, "C 4 4"]:
    """The control points of `fitted`, of the same values to rounding, as functions of the vertices.

    Args:
        vertices: of the mesh, float64.
        own: the vertices of each point's edge, the second twice, or a vertex thrice.
        points: of the chains that were fitted.
        fitted: their cubics.
        camera: the view.
    """
    place = _on_edges(vertices, torch.from_numpy(own), points)
    projection = camera.projection[0].detach().cpu()
    pixels, depths = camera.seen(place @ projection[:, :3].mT + projection[:, 3])
    third = depths if camera.orthographic else 1 / depths
    control = _least_squares(torch.cat([pixels, third[:, None]], 1), fitted)
    x, y, inverse = control.unbind(-1)
    if not camera.orthographic:
        least = 0.1 * torch.minimum(inverse[:, :1], inverse[:, 3:])
        inverse = torch.maximum(inverse, least)
    return torch.stack([x, y, torch.ones_like(x), inverse], -1) @ torch.linalg.inv(projection).mT


def _on_edges(
    vertices: Float[Tensor, "V 3"], own: Int[Tensor, "M 3"], points: Float[Tensor, "M 3"]
) -> Float[Tensor, "M 3"]:
    a, b = vertices[own[:, 0]], vertices[own[:, 1]]
    way = (b - a).detach()
    share = ((points - a.detach()) * way).sum(1) / (way**2).sum(1).clamp(min=1e-300)
    return a + share[:, None] * (b - a)


def _least_squares(values: Float[Tensor, "M 3"], fitted: FittedChains) -> Float[Tensor, "C 4 3"]:
    """The cubics of least squares that `fit_chains` has found, with its parameters."""
    start, stop = torch.from_numpy(fitted.start), torch.from_numpy(fitted.stop)
    counts = stop - start + 1
    run = torch.arange(len(start)).repeat_interleave(counts)
    at = torch.arange(len(run)) - (counts.cumsum(0) - counts)[run] + start[run]
    t = torch.from_numpy(fitted.t)[at]
    t = torch.where(at == start[run], 0.0, torch.where(at == stop[run], 1.0, t))
    b0, b1, b2, b3 = bernstein(t, 3).unbind(1)
    p0, p3 = values[start], values[stop]

    def total(of: Tensor) -> Tensor:
        return torch.zeros(len(start), *of.shape[1:], dtype=of.dtype).index_add(0, run, of)

    pull = (EVEN * counts).to(values.dtype)
    a11, a12, a22 = total(b1 * b1) + pull, total(b1 * b2), total(b2 * b2) + pull
    rest = values[at] - b0[:, None] * p0[run] - b3[:, None] * p3[run]
    r1 = total(b1[:, None] * rest) + pull[:, None] * (p0 + (p3 - p0) / 3)
    r2 = total(b2[:, None] * rest) + pull[:, None] * (p0 + (p3 - p0) * 2 / 3)
    det = (a11 * a22 - a12 * a12)[:, None]
    p1 = (a22[:, None] * r1 - a12[:, None] * r2) / det
    p2 = (a11[:, None] * r2 - a12[:, None] * r1) / det
    return torch.stack([p0, p1, p2, p3], 1)
