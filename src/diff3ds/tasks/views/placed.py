"""A sketch and its cameras turned upright, along the lines of the sketch, and scaled: `--up auto`, `--scale`."""

import math
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.photogrammetry.find_project import present_views
from diff3ds.photogrammetry.line_axes import line_axes
from diff3ds.photogrammetry.placing import distance_between, turned_up, up_of
from diff3ds.pictures.picture_options import Target
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.views.views_options import ViewsOptions

PLACED = "transforms_placed.json"
# A stroke whose control points lie within this fraction of its chord from it is a line.
STRAIGHT = 0.01
# Lines say what is up if an axis lies within so many degrees of what the cameras say, and so large a part of the length
# of all lines follows it, or the two others. Empirical.
BETWEEN, ENOUGH = 20.0, 0.1


@dataclass(frozen=True, eq=False)
class Placing:
    """What a world becomes.

    Attributes:
        turn: the rotation.
        scale: by which all lengths grow.
        about: for run.json.
        line: for people.
    """

    turn: Float[Tensor, "3 3"]
    scale: float
    about: dict[str, Any]
    line: str

    def sketch(self, sketch: Sketch) -> Sketch:
        """The sketch in the new world."""
        matrix = torch.eye(4, dtype=torch.float64)
        matrix[:3, :3] = self.scale * self.turn
        return sketch.transform(matrix)

    def surface(self, surface: TriangleMesh) -> TriangleMesh:
        """The surface in the new world."""
        matrix = (self.scale * self.turn).double().numpy()
        return TriangleMesh(surface.vertices @ matrix.T, surface.faces, surface.part, surface.crease, surface.polygon)

    def cameras(self, cameras: Cameras) -> Cameras:
        """The cameras in the new world."""
        pose, lens = cameras.world_to_camera.double().clone(), cameras.intrinsics
        pose[:, :3, :3] = pose[:, :3, :3] @ self.turn.mT
        pose[:, :3, 3] *= self.scale
        if cameras.orthographic:
            # Pixels a unit.
            lens = lens / lens.new_tensor([self.scale, self.scale, 1.0])
        kind = cameras.world_to_camera.dtype
        return replace(cameras, world_to_camera=pose.to(kind), intrinsics=lens, near=cameras.near * self.scale)


def placing_of(path: Path, target: Target | None, options: ViewsOptions) -> Placing | None:
    """What the options ask for, before lines are known; None if they ask for nothing.

    Args:
        path: project of the pictures.
        target: of its pictures.
        options: of the command.

    Raises:
        ValueError: `between` names no two pictures or points.
    """
    if options.up == "keep" and options.scale is None:
        return None
    with warnings.catch_warnings():
        # Said when the pictures were read.
        warnings.simplefilter("ignore")
        views = present_views(path, target)
    about: dict[str, Any] = {}
    turn, scale = torch.eye(3, dtype=torch.float64), 1.0
    if options.scale is not None and options.between is not None:
        scale = options.scale / distance_between(views, options.between)
        about["scale"] = scale
    if options.up == "auto":
        turn = turned_up(up_of(views))
        about["up_by_cameras"] = turn[2].tolist()
    return Placing(turn, scale, about, "")


def along_lines(placing: Placing, sketch: Sketch, options: ViewsOptions) -> Placing:
    """The same with z, and x or y, along the lines of the sketch, where these say it; with what is said of it."""
    said = [] if options.scale is None else [f"all lengths times {placing.scale:.5g}"]
    about = dict(placing.about)
    if options.up == "auto":
        turn, share, off = _by_lines(placing.turn, sketch)
        said.append(
            f"z is up by the cameras, {off:.2f} degrees from the axes that {share:.0%} of the lines follow: by these"
            if share
            else "z is up by the cameras; lines say nothing of it"
        )
        about |= {"lines_follow": share, "degrees_between": off}
        placing = replace(placing, turn=turn)
    return replace(placing, about=about, line="; ".join(said))


def _by_lines(turn: Float[Tensor, "3 3"], sketch: Sketch) -> tuple[Float[Tensor, "3 3"], float, float]:
    """The rotation, how much of the lines' length follows its axes, and how far it has tilted, in degrees."""
    chord = (sketch.points[:, -1] - sketch.points[:, 0]).detach().double()
    length = chord.norm(dim=1)
    direction = chord / length.clamp(min=1e-300)[:, None]
    inner = (sketch.points - sketch.points[:, :1]).detach().double()
    aside = (inner - (inner * direction[:, None]).sum(-1, keepdim=True) * direction[:, None]).norm(dim=-1).amax(1)
    lines = aside < STRAIGHT * length
    found = line_axes(direction[lines], length[lines]) if int(lines.sum()) > 1 else None
    if found is None:
        return turn, 0.0, 0.0
    cosines = found.axes @ turn[2]
    k = int(cosines.abs().argmax())
    off = math.degrees(math.acos(min(1.0, float(cosines[k].abs()))))
    level = torch.cat([found.share[:k], found.share[k + 1 :]])
    # Two axes of a plane say what stands on it.
    if off > BETWEEN or (float(found.share[k]) < ENOUGH and float(level.min()) < ENOUGH):
        return turn, 0.0, 0.0
    up = found.axes[k] * torch.sign(cosines[k])
    # Of the others, whichever has x turn least.
    others = torch.stack([sign * found.axes[i] for i in range(3) if i != k for sign in (1.0, -1.0)])
    x = others[int((others @ turn[0]).argmax())]
    return torch.stack([x, torch.linalg.cross(up, x), up]), float(found.share.sum()), off
