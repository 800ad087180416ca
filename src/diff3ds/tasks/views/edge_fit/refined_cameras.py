"""Refined cameras as a run tells of them: how far each has moved, and a file of cameras that other commands read."""

import statistics
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.distortion import Distortion
from diff3ds.edges.cameras.coarse_to_fine import Refined
from diff3ds.edges.cameras.lens_effect import bending
from diff3ds.photogrammetry.find_project import present_views
from diff3ds.photogrammetry.lens_change import LensChange
from diff3ds.photogrammetry.point_files import save_points
from diff3ds.pictures.frame import Frame
from diff3ds.pictures.picture_options import Target
from diff3ds.transforms import save_views

REFINED = "transforms_refined.json"
# Cameras have moved far where their pictures have by so many times the median, and so many pixels. Empirical: of 50
# photographs, off by 5 pixels in the mean and 10 at most, none; one more that is off by 20 is.
FAR, LEAST_FAR = 3.0, 2.0
# Half the side of a cube in a ball of radius 1, in whose corners pictures are compared.
INNER = 3**-0.5
# Pictures named in a line; all are in run.json.
NAMED = 8


def in_world(frame: Frame, cameras: Cameras, like: Cameras) -> Cameras:
    """Cameras of the frame of a fit in the world; precision and near plane are those of the cameras before."""
    pose = cameras.world_to_camera.double().clone()
    pose[:, :3, 3] = frame.radius * pose[:, :3, 3] - pose[:, :3, :3] @ frame.center
    kind = like.world_to_camera.dtype
    return replace(like, world_to_camera=pose.to(kind), intrinsics=cameras.intrinsics.to(kind))


@dataclass(frozen=True, eq=False)
class Moved:
    """How far cameras have moved.

    Attributes:
        about: for run.json.
        lines: for people.
        right: which of the views agree with the others.
        lens: how the lenses have changed.
    """

    about: dict[str, Any]
    lines: list[str]
    right: list[int]
    lens: LensChange


def moves(
    frame: Frame,
    before: Cameras,
    after: Cameras,
    names: Sequence[str],
    refined: Refined,
    lens: Distortion | None = None,
) -> Moved:
    """How far each camera has turned, in degrees, and moved, in world units and in its picture; and which are lost.

    Args:
        frame: of the fit, in which the object lies.
        before: the cameras that were given.
        after: the refined ones.
        names: of their pictures.
        refined: says how far each agrees with the others.
        lens: whose distortion was looked for, as given; None if it was not.
    """
    turn = after.world_to_camera[:, :3, :3].double() @ before.world_to_camera[:, :3, :3].double().mT
    # Of a rotation by a, |R - 1| is 2 sqrt(2) sin(a / 2): exact for small angles, where the trace is not.
    off = (turn - torch.eye(3, dtype=turn.dtype)).flatten(1).norm(dim=1) / 8**0.5
    degrees = torch.rad2deg(2 * off.clamp(max=1).asin()).tolist()
    units = (after.centers - before.centers).double().norm(dim=1).tolist()
    pixels = _moved_pixels(frame, before, after)
    each = {
        name: {"degrees": round(a, 4), "units": float(f"{b:.3g}"), "pixels": round(c, 2), "agreement": round(d, 2)}
        for name, a, b, c, d in zip(names, degrees, units, pixels, refined.agreement.tolist(), strict=True)
    }
    lost = [name for name, gone in zip(names, refined.lost.tolist(), strict=True) if gone]
    usual = statistics.median(pixels)
    far = {name: c for name, c in zip(names, pixels, strict=True) if c > max(FAR * usual, LEAST_FAR)}
    far = {name: far[name] for name in sorted(far, key=lambda name: -far[name]) if name not in lost}
    zoom = float(after.intrinsics[0, 0, 0] / before.intrinsics[0, 0, 0])
    about = {
        "focal": round(zoom, 5),
        "distortion": _bent(before, after, refined.k1, lens),
        "degrees_mean": sum(degrees) / len(degrees),
        "degrees_most": max(degrees),
        "units_mean": sum(units) / len(units),
        "units_most": max(units),
        "pixels_median": usual,
        "pixels_most": max(pixels),
        "lost": lost,
        "moved_far": list(far),
        "each": each,
    }
    right = np.nonzero(~refined.lost)[0].tolist()
    return Moved(about, [_said(about), *_warned(about, far)], right, LensChange(zoom, refined.k1))


def _moved_pixels(frame: Frame, before: Cameras, after: Cameras) -> list[float]:
    """How far places of the frame have moved in each picture, pixels: the median, for some may lie beside a camera."""
    corners = torch.tensor([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=torch.float64)
    places = torch.nn.functional.pad(frame.center + INNER * frame.radius * corners, (0, 1), value=1.0)
    here, there = (c.seen(places @ c.projection.double().mT)[0] for c in (before, after))
    found: list[float] = (here - there).norm(dim=-1).median(-1).values.tolist()
    return found


def _bent(before: Cameras, after: Cameras, k1: float, lens: Distortion | None) -> dict[str, float] | None:
    """How far distortion is another than given, and moves the corners of pictures; None where it was not looked for."""
    if lens is None:
        return None
    corners = bending(before, after, lens).at_corners(before.size, k1)
    return {"k1": float(f"{k1:.4g}"), "pixels_at_corners": round(corners, 2)}


def _said(about: dict[str, Any]) -> str:
    """One line about all cameras."""
    bent = about["distortion"]
    lens = "distortion as given"
    if bent and bent["k1"]:
        lens = f"distortion k1 {bent['k1']:+.4f}, {bent['pixels_at_corners']:.1f} pixels at the corners"
    return (
        f"cameras: turned by {about['degrees_mean']:.3f} degrees (most {about['degrees_most']:.3f}), moved by "
        f"{about['units_mean']:.3g} units (most {about['units_most']:.3g}), focal length times {about['focal']:.4f}, "
        f"{lens}; in the pictures {about['pixels_median']:.1f} pixels (most {about['pixels_most']:.1f})"
    )


def _warned(about: dict[str, Any], far: dict[str, float]) -> list[str]:
    """Lines about single cameras, and what to do about them."""
    lines, lost = [], about["lost"]
    if lost:
        lines.append(
            f"{len(lost)} of {len(about['each'])} views agree with the edges of the others hardly more than by chance, "
            f"and are left out, in {REFINED} as well: {_list(lost)}. Are they sharp, and of the same thing, standing "
            "still? Other photographs from there help, or cameras that are better to begin with"
        )
    if far:
        named = _list([f"{name} ({pixels:.1f} pixels)" for name, pixels in far.items()])
        lines.append(
            f"moved far more than the others, but agree with them now: {named}. If lines are doubled, look at these "
            "first, or leave them out"
        )
    return lines


def _list(names: Sequence[str]) -> str:
    return ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")


def save_refined(
    out: Path,
    source: Path,
    target: Target,
    views: Sequence[int],
    cameras: Cameras,
    lens: LensChange,
    points: Float[Tensor, "P 3"] | None = None,
) -> None:
    """Writes a transforms.json of the refined views: pictures, masks and lenses are those of the source.

    Args:
        out: the file.
        source: where the pictures and their cameras came from.
        target: what the pictures are.
        views: which of its pictures these are.
        cameras: of these views, in the world.
        lens: how the lenses have changed.
        points: of the reconstruction, in the same world, for a file beside this one.
    """
    with warnings.catch_warnings():
        # Said when the pictures were read.
        warnings.simplefilter("ignore")
        present = present_views(source, target)
    refined = []
    for view, pose in zip((present[i] for i in views), cameras.world_to_camera.double(), strict=True):
        mask = view.mask.resolve() if view.mask else None
        refined.append(replace(lens.of(view), picture=view.picture.resolve(), mask=mask, world_to_camera=pose))
    named = {}
    if points is not None:
        file = out.with_name(f"{out.stem}_points.ply")
        save_points(file, points)
        named = {"ply_file_path": file.name}
    save_views(out, refined, named)
