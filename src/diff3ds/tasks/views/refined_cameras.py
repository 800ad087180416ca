"""Refined cameras as a run tells of them: how far each has moved, and a file of cameras that other commands read."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.photogrammetry.point_files import save_points
from diff3ds.photogrammetry.project import present_views
from diff3ds.pictures.frame import Frame
from diff3ds.pictures.options import Target
from diff3ds.transforms import save_views

REFINED = "transforms_refined.json"


def in_world(frame: Frame, cameras: Cameras, like: Cameras) -> Cameras:
    """Cameras of the frame of a fit in the world; precision and near plane are those of the cameras before."""
    pose = cameras.world_to_camera.double().clone()
    pose[:, :3, 3] = frame.radius * pose[:, :3, 3] - pose[:, :3, :3] @ frame.center
    kind = like.world_to_camera.dtype
    return replace(like, world_to_camera=pose.to(kind), intrinsics=cameras.intrinsics.to(kind))


def moves(before: Cameras, after: Cameras, names: Sequence[str]) -> dict[str, Any]:
    """How far each camera has turned, in degrees, and moved, in world units; and the factor of all focal lengths."""
    turn = after.world_to_camera[:, :3, :3].double() @ before.world_to_camera[:, :3, :3].double().mT
    # Of a rotation by a, |R - 1| is 2 sqrt(2) sin(a / 2): exact for small angles, where the trace is not.
    off = (turn - torch.eye(3, dtype=turn.dtype)).flatten(1).norm(dim=1) / 8**0.5
    degrees = torch.rad2deg(2 * off.clamp(max=1).asin()).tolist()
    units = (after.centers - before.centers).double().norm(dim=1).tolist()
    zoom = float(after.intrinsics[0, 0, 0] / before.intrinsics[0, 0, 0])
    each = {
        name: {"degrees": round(a, 4), "units": float(f"{b:.3g}")}
        for name, a, b in zip(names, degrees, units, strict=True)
    }
    return {"focal": round(zoom, 5), "degrees_mean": sum(degrees) / len(degrees), "degrees_most": max(degrees),
            "units_mean": sum(units) / len(units), "units_most": max(units), "each": each}  # fmt: skip


def said(moved: dict[str, Any]) -> str:
    """One line about them."""
    return (
        f"cameras: turned by {moved['degrees_mean']:.3f} degrees (most {moved['degrees_most']:.3f}), moved by "
        f"{moved['units_mean']:.3g} units (most {moved['units_most']:.3g}), focal length times {moved['focal']:.4f}"
    )


def save_refined(
    out: Path,
    source: Path,
    target: Target,
    views: Sequence[int],
    cameras: Cameras,
    zoom: float,
    points: Float[Tensor, "P 3"] | None = None,
) -> None:
    """Writes a transforms.json of the refined views: pictures, masks and lenses are those of the source.

    Args:
        out: the file.
        source: where the pictures and their cameras came from.
        target: what the pictures are.
        views: which of its pictures these are.
        cameras: of these views, in the world.
        zoom: the factor of the focal lengths.
        points: of the reconstruction, in the same world, for a file beside this one.
    """
    with warnings.catch_warnings():
        # Said when the pictures were read.
        warnings.simplefilter("ignore")
        present = present_views(source, target)
    wider = torch.tensor([zoom, zoom, 1.0], dtype=torch.float64)
    refined = []
    for view, pose in zip((present[i] for i in views), cameras.world_to_camera.double(), strict=True):
        lens = view.intrinsics * wider  # columns: the principal point stays
        mask = view.mask.resolve() if view.mask else None
        refined.append(replace(view, picture=view.picture.resolve(), mask=mask, world_to_camera=pose, intrinsics=lens))
    named = {}
    if points is not None:
        file = out.with_name(f"{out.stem}_points.ply")
        save_points(file, points)
        named = {"ply_file_path": file.name}
    save_views(out, refined, named)
