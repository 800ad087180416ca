"""Whether cameras look at something in common: told by the cameras alone, before their pictures are read."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras

# Of all views, those whose optical axes are searched for points that others see, and the depths at which, relative to
# the distances between the cameras. Enough to meet what fills a tenth of the pictures.
AXES, DEPTHS, NEAREST, FARTHEST = 32, 48, 0.05, 50.0
# Read in another way, so large a fraction of the views must see one point, and this many times the fraction of those
# read as they should be, before that is called the fault. Empirical: of cameras around an object all see its centre, in
# either lens; read wrongly, a sixth to a half.
MOST_SEE, BETTER = 0.9, 1.5
# In the whole pictures, or in so large a part around their middle: wide pictures show much whatever the rotations.
PARTS = (1.0, 0.5, 0.25)
# They see it from directions that spread by this, the square of the sine of some 10 degrees: rotations that are read
# wrongly may all become one.
SPREAD = 0.03
# So many views: of two or three, chance makes pairs.
FEWEST = 3
# Cameras within this fraction of their distance from the origin stand at one place.
ONE_PLACE = 1e-9
_AXES = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))


def check_sight(path: Path, cameras: Cameras, sizes: list[tuple[int, int]]) -> None:
    """Sees that the cameras of a transforms.json look at something in common from several places.

    Args:
        path: named in errors.
        cameras: in the world of the file.
        sizes: (height, width) of the pictures, at the top left of the cameras' canvas.

    Raises:
        ValueError: they do not; names what is wrong with the matrices where another way to read them makes the cameras
            look at one point.
    """
    if len(cameras) < 2:
        return
    corners = torch.tensor([(width, height) for height, width in sizes], dtype=torch.float64)
    centers = cameras.centers
    # Without perspective it is other directions that show depth, and those are looked for where the frame is found.
    if not cameras.orthographic and float(_spread(centers)) <= ONE_PLACE * float(centers.abs().max()):
        raise ValueError(
            f"{path}: all cameras stand at one place, from where depth cannot be seen. Are the matrices "
            "world-to-camera? transform_matrix must be camera-to-world"
        )
    for part in PARTS if len(cameras) >= FEWEST else ():
        seen, _ = _most_seen(cameras, corners, part)
        for what, other in _other_readings(cameras):
            fraction, spread = _most_seen(other, corners, part)
            if fraction >= MOST_SEE and fraction >= BETTER * seen and spread >= SPREAD:
                where = "" if part == 1 else "near the middle "
                raise ValueError(
                    f"{path}: the cameras do not look at one thing: no point is {where}in more than {seen:.0%} of the "
                    f"pictures. But {fraction:.0%} show one point there if {what}; transform_matrix must be "
                    "camera-to-world, with OpenGL axes (x right, y up, looking along -z)"
                )
    seen, _ = _most_seen(cameras, corners, 1.0)
    if seen * len(cameras) < 2:
        raise ValueError(
            f"{path}: no two cameras look at the same place. transform_matrix must be camera-to-world, with OpenGL "
            "axes (x right, y up, looking along -z)"
        )


def _other_readings(cameras: Cameras) -> Iterator[tuple[str, Cameras]]:
    """Lists what people write by mistake, and the cameras that they mean."""
    # What the file holds.
    to_world = torch.linalg.inv(cameras.world_to_camera) @ _AXES
    transposed = to_world.clone()
    transposed[:, :3, :3] = to_world[:, :3, :3].mT
    yield "the camera axes are OpenCV's (y down, looking along +z)", _posed(cameras, torch.linalg.inv(to_world))
    yield "the rotations are transposed", _posed(cameras, _AXES @ torch.linalg.inv(transposed))
    yield "the matrices are world-to-camera, with OpenCV's axes", _posed(cameras, to_world)
    yield "the matrices are world-to-camera", _posed(cameras, _AXES @ to_world)
    transposed = transposed.clone()
    yield "the rotations are transposed and the axes OpenCV's", _posed(cameras, torch.linalg.inv(transposed))


def _posed(cameras: Cameras, world_to_camera: Float[Tensor, "V 4 4"]) -> Cameras:
    return replace(cameras, world_to_camera=world_to_camera)


def _most_seen(cameras: Cameras, corners: Float[Tensor, "V 2"], part: float) -> tuple[float, float]:
    """The largest fraction of the cameras that have one point in this part of their pictures, and from how far apart.

    Returns:
        The fraction, and the least mean square of the sine between any direction and those in which they see the point.
    """
    points = torch.cat([_on_axes(cameras, corners), _between_axes(cameras, corners)])
    # Of points relative to the cameras: in map coordinates products would lose digits.
    middle = cameras.centers.mean(0)
    rotation = cameras.world_to_camera[:, :3, :3]
    seen = (rotation @ (points - middle).T + rotation @ (middle - cameras.centers)[..., None]).mT
    flat = torch.cat([seen[..., :2], torch.ones_like(seen[..., :1])], -1) if cameras.orthographic else seen
    projected = flat @ cameras.intrinsics.mT
    off = (projected[..., :2] / projected[..., 2:] - corners[:, None] / 2).abs()
    inside = (seen[..., 2] > 0) & (off <= part * corners[:, None] / 2).all(-1)
    best = int(inside.double().mean(0).argmax())
    towards = cameras.rays(corners / 2)[1] if cameras.orthographic else points[best] - cameras.centers
    rays = torch.nn.functional.normalize(towards[inside[:, best]], dim=1)
    across = torch.eye(3, dtype=torch.float64) - rays[:, :, None] * rays[:, None, :]
    spread = float(torch.linalg.eigvalsh(across.mean(0))[0]) if len(rays) else 0.0
    return len(rays) / len(cameras), spread


def _on_axes(cameras: Cameras, corners: Float[Tensor, "V 2"]) -> Float[Tensor, "P 3"]:
    """Points along the rays through the middle of some pictures."""
    some = torch.linspace(0, len(cameras) - 1, min(len(cameras), AXES)).round().long()
    depths = torch.logspace(
        torch.tensor(NEAREST).log10().item(), torch.tensor(FARTHEST).log10().item(), DEPTHS, dtype=torch.float64
    )
    reach = depths * _spread(cameras.centers).clamp(min=torch.finfo(torch.float32).tiny)
    origins, rays = cameras.rays(corners / 2)
    return (origins[some, None] + rays[some, None] * reach[:, None]).reshape(-1, 3)


def _between_axes(cameras: Cameras, corners: Float[Tensor, "V 2"]) -> Float[Tensor, "1 3"]:
    """The point nearest to all these rays: with a small field of view only it lies in all pictures."""
    centers, rays = cameras.rays(corners / 2)
    across = torch.eye(3, dtype=torch.float64) - rays[:, :, None] * rays[:, None, :]
    middle = centers.mean(0)
    towards = (across @ (centers - middle)[..., None]).mean(0)
    nearest: Tensor = torch.linalg.pinv(across.mean(0)) @ towards
    return nearest.T + middle


def _spread(centers: Float[Tensor, "V 3"]) -> Float[Tensor, ""]:
    spread: Tensor = torch.linalg.vector_norm(centers - centers.mean(0), dim=1).max()
    return spread
