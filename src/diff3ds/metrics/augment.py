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
    askew = torch.stack([_homography(some, corners) for some in moved])
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


def _homography(source: Float[Tensor, "4 2"], target: Float[Tensor, "4 2"]) -> Float[Tensor, "3 3"]:
    """The projective map that takes four points to four others."""
    rows, values = [], []
    for (x, y), (u, v) in zip(source.tolist(), target.tolist(), strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        values += [u, v]
    solution = torch.linalg.solve(source.new_tensor(rows), source.new_tensor(values))
    return torch.cat([solution, solution.new_ones(1)]).reshape(3, 3)
