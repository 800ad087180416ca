"""The file that keeps what a reconstruction has reached: safetensors, so that reading one runs no code."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._shapes import Tensor
from diff3ds._tensor_files import write_tensors
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.edges.cameras.coarse_to_fine import Refined
from diff3ds.edges.evidence.bias import Bias
from diff3ds.edges.reconstruct import DONE, Result

# [version; derived] Of the layout of the file: one with another is refused.
VERSION = 7
MAX_BYTES = 1 << 28
FIELDS = ("points", "kind", "vertex")
# Of refined cameras, if there are any.
CAMERAS = ("world_to_camera", "intrinsics", "agreement", "k1")


@dataclass(frozen=True, eq=False)
class Kept:
    """What the file keeps.

    Attributes:
        result: of the last stage.
        losses: of the steps that led to it.
        refined: the cameras, if they were moved.
    """

    result: Result
    losses: list[float]
    refined: Refined | None = None


def write_result(path: Path, kept: Kept, settings: dict[str, Any]) -> None:
    """Writes what is reached, whole or not at all; `settings` are what a resumed run must share."""
    result = kept.result
    about = {"version": VERSION, "stage": result.stage, "bias": asdict(result.bias), "settings": settings}
    tensors = {name: getattr(result.curves, name) for name in FIELDS}
    # Curves that were taken out have left gaps between the numbers of vertices.
    tensors["vertex"] = torch.unique(result.curves.vertex, return_inverse=True)[1]
    tensors["losses"] = torch.tensor(kept.losses, dtype=torch.float64)
    if kept.refined is not None:
        tensors |= {name: torch.as_tensor(np.asarray(getattr(kept.refined, name))) for name in CAMERAS}
    write_tensors(path, tensors, {"diff3ds edges": json.dumps(about)})


def read_result(path: Path, settings: dict[str, Any]) -> Kept:
    """What a file keeps.

    Raises:
        FileNotFoundError: it is missing.
        ValueError: it is no such file of this version, is damaged, or belongs to a run with other settings.
    """
    from safetensors import SafetensorError, safe_open

    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: larger than any checkpoint ({MAX_BYTES} bytes)")
    try:
        with safe_open(path, "pt") as file:
            about = json.loads((file.metadata() or {})["diff3ds edges"])
            tensors = {name: file.get_tensor(name) for name in FIELDS}
            losses = file.get_tensor("losses").reshape(-1).tolist()
            there = set(file.keys())
            cameras = {name: file.get_tensor(name) for name in CAMERAS} if there & set(CAMERAS) else {}
        if about["version"] != VERSION:
            raise ValueError(f"version {about['version']}")
        curves = _checked(Curves(**tensors))
        result = Result(int(about["stage"]), curves, Bias(**{k: float(v) for k, v in about["bias"].items()}))
        if not 0 <= result.stage <= DONE:
            raise ValueError(f"stage {result.stage}")
        theirs = dict(about["settings"])
        refined = _cameras(cameras) if cameras else None
    except (SafetensorError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"{path}: not a checkpoint of this version ({error}); delete it to start anew") from error
    for name, value in settings.items():
        if theirs.get(name) != value:
            was = theirs.get(name)
            raise ValueError(
                f"{path}: the run to resume had {name}={was}, not {value}: give the same, or start a new run"
            )
    return Kept(result, losses, refined)


def _cameras(tensors: dict[str, Tensor]) -> Refined:
    """The cameras, if their tensors fit together."""
    count = len(tensors["agreement"])
    for name, shape in zip(CAMERAS, ((count, 4, 4), (count, 3, 3), (count,), ()), strict=True):
        if tensors[name].shape != shape or not tensors[name].is_floating_point():
            raise ValueError(f"{name} has shape {tuple(tensors[name].shape)} and dtype {tensors[name].dtype}")
    if not all(bool(tensors[name].isfinite().all()) for name in CAMERAS if name != "agreement"):
        raise ValueError("cameras out of range")
    pose, matrix, agreement, k1 = (tensors[name] for name in CAMERAS)
    return Refined(pose, matrix, agreement.numpy(), float(k1))


def _checked(curves: Curves) -> Curves:
    """The curves, if their tensors fit together."""
    count = len(curves)
    shapes = {"points": (count, 4, 3), "kind": (count,), "vertex": (count, 2)}
    for name, shape in shapes.items():
        value = getattr(curves, name)
        if value.shape != shape or value.dtype != (torch.float32 if name == "points" else torch.int64):
            raise ValueError(f"{name} has shape {tuple(value.shape)} and dtype {value.dtype}")
    inside = (curves.vertex >= 0) & (curves.vertex < 2 * count)
    known = (curves.kind >= min(Kind)) & (curves.kind <= max(Kind))
    if not bool(curves.points.isfinite().all() & known.all() & inside.all()):
        raise ValueError("values out of range")
    return curves
