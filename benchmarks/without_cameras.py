"""Posed pictures without their cameras: found from the pictures alone, fitted, and judged by the given ones.

    python benchmarks/without_cameras.py FOLDER OUT [--keep-cameras ...]

FOLDER is laid out as the NeRF scenes are: transforms_train.json and transforms_test.json with the pictures that they
name. `diff3ds cameras` finds the cameras of the training pictures, `diff3ds views --target color` fits, and the sketch
goes where the given cameras see it: by the similarity that brings the found centres to the given ones. There PSNR and
SSIM on the held-out pictures are those of a sketch that was fitted with the given cameras. More options go to
`diff3ds views`.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import torch

import diff3ds as ds
from diff3ds.pictures.dataset import load_posed
from diff3ds.tasks.views.color_sketch import view_scores
from diff3ds.transforms import read_views


def similarity(found: np.ndarray, given: np.ndarray) -> np.ndarray:
    """The 4 x 4 matrix that brings points to others as nearly as it can (Umeyama 1991)."""
    here, there = found - found.mean(0), given - given.mean(0)
    u, s, v = np.linalg.svd(there.T @ here)
    mirrored = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    scale = (s * np.diag(mirrored)).sum() / (here**2).sum()
    matrix = np.eye(4)
    matrix[:3, :3] = scale * u @ mirrored @ v
    matrix[:3, 3] = given.mean(0) - matrix[:3, :3] @ found.mean(0)
    return matrix


def poses(file: Path) -> dict[str, np.ndarray]:
    """The world-to-camera matrices of a transforms.json, by the names of the pictures."""
    return {view.picture.name: view.world_to_camera.numpy() for view in read_views(file)}


def centres(matrices: np.ndarray) -> np.ndarray:
    """Where cameras are."""
    return np.asarray(-np.einsum("vji,vj->vi", matrices[:, :3, :3], matrices[:, :3, 3]))


def main() -> None:
    """Finds, fits, and prints how far the cameras are from the given ones, and the scores with these."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    chosen, extra = parser.parse_known_args()
    given = poses(chosen.folder / "transforms_train.json")
    pictures = next(iter(read_views(chosen.folder / "transforms_train.json"))).picture.parent
    command = [sys.executable, "-m", "diff3ds.cli"]
    cameras, fit = chosen.out / "cameras", chosen.out / "fit"
    if not (cameras / "transforms.json").is_file():
        # The views of such scenes are in no order.
        subprocess.run([*command, "cameras", str(pictures), "--order", "any", "-o", str(cameras)], check=True)
    options = ["--target", "color", "--overwrite", *extra]
    subprocess.run([*command, "views", str(cameras), "-o", str(fit), *options], check=True)
    refined = fit / "transforms_refined.json"
    used = poses(refined if refined.is_file() else cameras / "transforms.json")
    names = sorted(used)
    ours, theirs = (np.stack([some[name] for name in names]) for some in (used, given))
    matrix = similarity(centres(ours), centres(theirs))
    moved = centres(ours) @ matrix[:3, :3].T + matrix[:3, 3]
    off = np.linalg.norm(moved - centres(theirs), axis=1)
    turn = matrix[:3, :3] / np.cbrt(np.linalg.det(matrix[:3, :3]))
    apart = ours[:, :3, :3] @ turn.T @ theirs[:, :3, :3].transpose(0, 2, 1)
    degrees = np.rad2deg(np.arccos(np.clip((np.trace(apart, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    distance = float(np.median(np.linalg.norm(centres(theirs), axis=1)))
    sketch = ds.load(fit / "sketch.json").transform(torch.from_numpy(matrix))
    held_out = load_posed(chosen.folder / "transforms_test.json", "color", 512)
    scores = view_scores(sketch, held_out, None)
    about = {
        "cameras": f"{len(names)} of {len(given)}",
        "centres off, % of their distance": {
            "median": 100 * float(np.median(off)) / distance,
            "most": 100 * float(off.max()) / distance,
        },
        "degrees off": {"median": float(np.median(degrees)), "most": float(degrees.max())},
        "strokes": len(sketch),
        **scores,
    }
    print(json.dumps(about, indent=1))


if __name__ == "__main__":
    main()
