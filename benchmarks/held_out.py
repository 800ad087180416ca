"""How a sketch of photographs draws views that it was not fitted to, where nobody knows the true edges.

    python benchmarks/held_out.py OUT FOLDER... [--size PIXELS] [--detail 1 0.5 0.2] [--kept] [--json FILE] [OPTIONS]

`diff3ds views --target color-edges --keep-cameras` fits three quarters of the pictures of each folder; every fourth
judges, in pictures of the command's own size if none is given. Precision: of the lines that are seen there (hidden ones
are left out where pictures have silhouettes), the length that lies within 2 pixels of an edge of the picture; beside
it, what the same lines reach moved elsewhere in it. Recall: the strong edges within 2 pixels of a line that runs along
them, strong being the upper half of those within the sketch's box. Free: strokes both of whose ends have no other
stroke within .4 % of the sketch's longest side. Median: the length of the median stroke, of that side. Other options,
such as `--bound none`, go to the command. With `--kept` runs that are there are judged again.
"""

import argparse
import json
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from report import environment, show, write_json
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.photogrammetry.find_project import find_project, present_views, sparse_points
from diff3ds.photogrammetry.point_files import save_points
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.pictures.store import opaque_views
from diff3ds.surfaces.shape.hull_surface import hull_surface
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.views.edge_fit.edges_of_pictures import ridges_of
from diff3ds.transforms import save_views

QUARTER = 4
# Pixels: a line that lies so near to an edge draws it.
NEAR = 2.0
# Of the box: ends with nothing so near are free.
MEETS = 0.004
# Of the lines, moved by so many pixels in eight directions, the mean is chance.
ELSEWHERE = (15.0, 30.0)
# Sine of the angle by which a line that draws an edge may turn from it: 25 degrees.
SLANT = 0.42
# Points a segment.
SAMPLES = 48


def split(folder: Path, out: Path) -> tuple[Path, Path]:
    """The projects of three quarters of the views and of the rest, with the points of the reconstruction."""
    source = find_project(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        views = [replace(view, picture=view.picture.resolve()) for view in present_views(source)]
        points = sparse_points(source)
    files = []
    for name, chosen in (
        ("fitted", [v for i, v in enumerate(views) if i % QUARTER]),
        ("held_out", views[::QUARTER]),
    ):
        (out / name).mkdir(parents=True, exist_ok=True)
        files.append(out / name / "transforms.json")
        save_points(out / name / "points.ply", points)
        save_views(files[-1], chosen, {"ply_file_path": "points.ply"} if len(points) else None)
    return files[0], files[1]


def fit(project: Path, out: Path, extra: list[str]) -> float:
    """Runs the command; seconds."""
    command = [sys.executable, "-m", "diff3ds.cli", "views", str(project), "-o", str(out), "--target", "color-edges"]
    begun = time.perf_counter()
    subprocess.run([*command, "--keep-cameras", "--overwrite", "--quiet", *extra], check=True)
    return time.perf_counter() - begun


def _box(sketch: ds.Sketch) -> float:
    points = sketch.points.reshape(-1, 3)
    return float((points.amax(0) - points.amin(0)).max())


def shape(sketch: ds.Sketch) -> dict[str, float]:
    """Strokes, the share that is free at both ends, and the median length."""
    box = _box(sketch)
    lines, rows = strokes_of(sketch)
    length = np.array([np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines])
    closed = [sketch.chains is not None and bool(sketch.chains.closed[i]) for i in range(len(lines))]
    tree = cKDTree(np.concatenate(lines))
    free = []
    for i, line in enumerate(lines):
        near = tree.query_ball_point(line[[0, -1]], MEETS * box)
        free.append(not closed[i] and all((rows[places] == i).all() for places in near))
    return {"strokes": len(lines), "free": float(np.mean(free)), "median": float(np.median(length) / box)}


def strokes_of(sketch: ds.Sketch) -> tuple[list[np.ndarray], np.ndarray]:
    """Points along each stroke, dense enough for the distances asked about, and the stroke of each point."""
    x = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, SAMPLES)).double().numpy()
    stroke = np.arange(len(x)) if sketch.chains is None else sketch.chains.stroke.numpy()
    lines = []
    for i in range(len(sketch)):
        rough = np.concatenate(list(x[stroke == i]))
        steps = np.linalg.norm(np.diff(rough, axis=0), axis=1)
        at = np.concatenate([[0.0], steps.cumsum()])
        count = int(at[-1] / (MEETS / 4 * _box(sketch))) + 2
        lines.append(np.stack([np.interp(np.linspace(0, at[-1], count), at, rough[:, k]) for k in range(3)], 1))
    return lines, np.repeat(np.arange(len(lines)), [len(line) for line in lines])


def seen(sketch: ds.Sketch, cameras: ds.Cameras, surface: TriangleMesh | None) -> list[np.ndarray]:
    """Of each view points along the visible lines, a pixel or less apart, with directions: (M, 4) pixels."""
    lines, _ = strokes_of(sketch)
    starts = np.concatenate([line[:-1] for line in lines])
    stops = np.concatenate([line[1:] for line in lines])
    found = []
    for view in range(len(cameras)):
        matrix = cameras.projection[view].double()
        shown = []
        for ends in (starts, stops):
            pixel, depth = cameras.seen(torch.from_numpy(ends) @ matrix[:, :3].T + matrix[:, 3])
            shown.append((pixel.double().numpy(), depth.double().numpy()))
        (a, near), (b, far) = shown
        height, width = cameras.size
        middle, way = (a + b) / 2, b - a
        inside = (near > cameras.near) & (far > cameras.near) & (middle >= 0).all(1) & (middle < (width, height)).all(1)
        if surface is not None:
            inside &= visible((starts + stops) / 2, cameras, view, surface)
        length = np.linalg.norm(way, axis=1)
        count = np.where(inside, np.ceil(length).astype(int), 0)
        row = np.repeat(np.arange(len(count)), count)
        share = (np.arange(len(row)) - np.repeat(count.cumsum() - count, count) + 0.5) / count[row]
        found.append(np.concatenate([a[row] + share[:, None] * way[row], way[row] / length[row, None]], 1))
    return found


def visible(points: np.ndarray, cameras: ds.Cameras, view: int, surface: TriangleMesh) -> np.ndarray:
    """Whether a view sees points beside a coarse surface: lifted towards the camera by its coarseness."""
    from diff3ds.page.picture import Picture
    from diff3ds.surfaces.hidden.mesh_view import MeshView

    picture = Picture.of(cameras, view)
    sight = picture.towards(points)
    lifted = points + 0.04 * surface.size * sight / np.linalg.norm(sight, axis=1, keepdims=True)
    return ~MeshView(surface, picture).in_front(lifted)


def judge(
    sketch: ds.Sketch, pictures: PosedPictures, ridges: list[Ridges], surface: TriangleMesh | None
) -> dict[str, float]:
    """Figures of one sketch in held-out views."""
    cameras = pictures.cameras
    drawn = seen(sketch, cameras, surface)
    hit, chance, length, there, strong = 0.0, 0.0, 0, 0, 0
    points = sketch.points.reshape(-1, 3).double()
    bound = np.median([r.values.size and np.median(r.values) for r in ridges])
    for view, (lines, ridge) in enumerate(zip(drawn, ridges, strict=True)):
        if not len(ridge) or not len(lines):
            continue
        edges = cKDTree(ridge.points)
        hit += (edges.query(lines[:, :2])[0] < NEAR).sum()
        moved = [
            (edges.query(lines[:, :2] + far * np.array([np.cos(a), np.sin(a)]))[0] < NEAR).mean()
            for far in ELSEWHERE
            for a in np.arange(8) * np.pi / 4
        ]
        chance += float(np.mean(moved)) * len(lines)
        length += len(lines)
        # Strong edges that lie where the sketch is.
        matrix = cameras.projection[view].double()
        pixel = cameras.seen(points @ matrix[:, :3].T + matrix[:, 3])[0].double().numpy()
        low, high = np.percentile(pixel, 1, axis=0), np.percentile(pixel, 99, axis=0)
        asked = (ridge.values > bound) & (ridge.points > low).all(1) & (ridge.points < high).all(1)
        strong += int(asked.sum())
        if len(lines):
            near, which = cKDTree(lines[:, :2]).query(ridge.points[asked], k=4, distance_upper_bound=NEAR)
            ahead = lines[np.minimum(which, len(lines) - 1), 2:]
            along = np.abs((ahead * ridge.normals[asked][:, None]).sum(-1)) < SLANT
            there += int((along & np.isfinite(near)).any(1).sum())
    return {"precision": hit / max(length, 1), "chance": chance / max(length, 1), "recall": there / max(strong, 1)}


def main() -> None:
    """Fits, judges, and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--size", type=int)
    parser.add_argument("--detail", type=float, nargs="+", default=[1.0])
    parser.add_argument("--kept", action="store_true")
    parser.add_argument("--json", type=Path)
    chosen, extra = parser.parse_known_args()
    rows: list[dict[str, Any]] = []
    for folder in chosen.folders:
        out = chosen.out / folder.name
        fitted, held_out = split(folder, out)
        seconds = None
        if not (chosen.kept and (out / "run" / "sketch.json").is_file()):
            sized = [] if chosen.size is None else ["--size", str(chosen.size)]
            seconds = fit(fitted, out / "run", [*sized, *extra])
        size = json.loads((out / "run" / "run.json").read_text())["options"]["size"]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pictures = load_posed(held_out, "color-edges", size)
            ridges = ridges_of(pictures, torch.arange(len(pictures)))
            small = load_posed(fitted, "color-edges", min(size, 256))
            # Whole photographs have no silhouettes: what is not known once they are undistorted is none.
            surface = None if opaque_views(small.store).all() else hull_surface(small)
        whole = ds.load(out / "run" / "sketch.json")
        for detail in chosen.detail:
            sketch = whole if detail == 1 else whole.at_detail(detail)
            row = {"scene": folder.name, "detail": detail, **judge(sketch, pictures, ridges, surface), **shape(sketch)}
            rows.append({**row, "seconds": seconds})
    columns = list(rows[0])
    show(
        "Sketches of photographs in views that they were not fitted to",
        columns,
        [[r[c] for c in columns] for r in rows],
    )
    if chosen.json:
        write_json(chosen.json, environment(), {"rows": rows})


if __name__ == "__main__":
    main()
