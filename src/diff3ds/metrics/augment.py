"""Random views of flat images: seen askew and cropped, as CLIPasso and 3Doodle show sketches to CLIP."""

import math

import torch

from diff3ds._shapes import Float, Tensor

# Corners move inwards by up to this share of half the image's side; crops show this share of the area.
DISTORTION, AREA = 0.5, 0.8


def random_warps(count: int, generator: torch.Generator) -> Float[Tensor, "A 3 3"]:
    """Random maps from where a pixel is in the result to where it comes from; both images are [-1, 1]²."""
    corners = torch.tensor([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], dtype=torch.float64)
    moved = corners * (1 - DISTORTION * torch.rand(count, 4, 2, generator=generator, dtype=torch.float64))
    askew = _homography(moved, corners.expand_as(moved))
    share = math.sqrt(AREA)
    crop = torch.zeros(count, 3, 3, dtype=torch.float64)
    crop[:, 0, 0] = crop[:, 1, 1] = share
    crop[:, 2, 2] = 1
    crop[:, :2, 2] = (1 - share) * (2 * torch.rand(count, 2, generator=generator, dtype=torch.float64) - 1)
    return (askew @ crop).float()


def warped(images: Float[Tensor, "B 3 H W"], warps: Float[Tensor, "B 3 3"], size: int) -> Float[Tensor, "B 3 S S"]:
    """Each image as its map shows it, bilinear; black where nothing of it is seen."""
    place = (torch.arange(size, dtype=warps.dtype) * 2 + 1) / size - 1
    y, x = torch.meshgrid(place, place, indexing="ij")
    points = torch.stack([x, y, torch.ones_like(x)], -1) @ warps.mT[:, None]
    grid = points[..., :2] / points[..., 2:]
    return torch.nn.functional.grid_sample(images, grid.to(images), align_corners=False)


def _homography(source: Float[Tensor, "A 4 2"], target: Float[Tensor, "A 4 2"]) -> Float[Tensor, "A 3 3"]:
    """The projective maps that take four points to four others; each pair of points gives two linear equations."""
    points = torch.cat([source, torch.ones_like(source[..., :1])], -1)
    zeros = torch.zeros_like(points)
    rows = torch.stack([torch.cat([points, zeros], -1), torch.cat([zeros, points], -1)], -2)
    last = -target[..., :, None] * source[..., None, :]
    equations = torch.cat([rows, last], -1).flatten(1, 2)
    solution = torch.linalg.solve(equations, target.flatten(1))
    return torch.cat([solution, torch.ones_like(solution[:, :1])], 1).reshape(-1, 3, 3)
