"""Posed pictures without their cameras: found from the pictures alone, fitted, and judged by the given ones.

    python benchmarks/without_cameras.py FOLDER OUT [--keep-cameras ...]

FOLDER is laid out as the NeRF scenes are: transforms_train.json and transforms_test.json with the pictures that they
name. `diff3ds cameras` finds the cameras of the training pictures, `diff3ds views --target color` fits, and the sketch
goes where the given cameras see what the found ones see of it, by a similarity. There PSNR and SSIM on the held-out
pictures are compared with those of a sketch that was fitted with the given cameras. "pixels off" is how far, root mean
square, the control points lie apart in each training picture by the two cameras. More options go to `diff3ds views`.
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
from diff3ds.tasks.views.color_fit.color_sketch import view_scores
from diff3ds.transforms import View, read_views


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


def seen_there(points: np.ndarray, found: list[View], given: list[View]) -> np.ndarray:
    """Where the given cameras see what the found ones see of points: as nearly as their rays meet."""
    across, right = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3))
    for ours, theirs in zip(found, given, strict=True):
        turn, shift = theirs.world_to_camera[:3, :3].numpy(), theirs.world_to_camera[:3, 3].numpy()
        pixels = np.column_stack([pixels_of(ours, points), np.ones(len(points))])
        rays = pixels @ np.linalg.inv(theirs.intrinsics.numpy()).T @ turn
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        one = np.eye(3) - rays[:, :, None] * rays[:, None, :]
        across, right = across + one, right + one @ (-turn.T @ shift)
    return np.asarray(np.linalg.solve(across, right[..., None])[..., 0])


def pixels_of(view: View, points: np.ndarray) -> np.ndarray:
    """Where a camera shows points, without distortion."""
    pose = view.world_to_camera.numpy()
    shown = (points @ pose[:3, :3].T + pose[:3, 3]) @ view.intrinsics.numpy().T
    return np.asarray(shown[:, :2] / shown[:, 2:])


def main() -> None:
    """Finds, fits, and prints how far the cameras are from the given ones, and the scores with these."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    chosen, extra = parser.parse_known_args()
    given = {view.picture.name: view for view in read_views(chosen.folder / "transforms_train.json")}
    command = [sys.executable, "-m", "diff3ds.cli"]
    cameras, fit = chosen.out / "cameras", chosen.out / "fit"
    if not (cameras / "transforms.json").is_file():
        pictures = next(iter(given.values())).picture.parent
        # The views of such scenes are in no order.
        subprocess.run([*command, "cameras", str(pictures), "--order", "any", "-o", str(cameras)], check=True)
    options = ["--target", "color", "--overwrite", *extra]
    subprocess.run([*command, "views", str(cameras), "-o", str(fit), *options], check=True)
    refined = fit / "transforms_refined.json"
    used = read_views(refined if refined.is_file() else cameras / "transforms.json")
    theirs = [given[view.picture.name] for view in used]
    sketch = ds.load(fit / "sketch.json")
    points = sketch.points.flatten(0, 1).double().numpy()
    there = seen_there(points, used, theirs)
    matrix = similarity(points, there)
    moved = points @ matrix[:3, :3].T + matrix[:3, 3]
    pairs = zip(used, theirs, strict=True)
    off = [np.sqrt(((pixels_of(o, points) - pixels_of(t, moved)) ** 2).sum(1).mean()) for o, t in pairs]
    held_out = load_posed(chosen.folder / "transforms_test.json", "color", 512)
    scores = view_scores(sketch.transform(torch.from_numpy(matrix)), held_out, None)
    about = {"cameras": f"{len(used)} of {len(given)}", "strokes": len(sketch)}
    pixels = {"median": round(float(np.median(off)), 2), "most": round(float(max(off)), 2)}
    print(json.dumps({**about, "pixels off": pixels, **scores}, indent=1))


if __name__ == "__main__":
    main()
