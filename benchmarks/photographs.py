"""`diff3ds views` on photographs of parts whose edges are known: with cameras that are true, wrong, found, and refined.

    python benchmarks/photographs.py OUT [--seeds 30-41] [--rows true wrong refined] [--k1 -0.05] [--json FILE] [...]

Parts are those of cad_objects.py, as photographs (cad/photograph.py): printed surfaces, shadows, cluttered walls, blur,
exposure and noise. Wrong cameras are turned by .3 degrees about random axes and moved by 1 % of their distance; those
of pycolmap are found from the photographs alone (`diff3ds cameras`). With `--k1` the lens has a radial distortion that
true cameras know of and wrong ones do not. More options, such as `--detector hed`, go to `diff3ds views`. Scores
are F-scores at 5 mm, where the longest side is one metre, of the curves within the part's bounding box and a margin,
against the sharp edges that three views show. Cameras say nothing of where the world lies: curves are moved there first
by the similarity that brings what the cameras see to where the true cameras see it. The CAD kernel is needed:
pip install 'diff3ds[cad]'.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from cad.lines import SHARP, pieces_of_edges, visible
from cad.part import Part, random_part
from cad.photograph import photograph, scene_of
from cad.raster import rasterise
from cad.views import CENTRE, FOCAL, SIZE, View, random_views, transforms
from cad_objects import ground_truth
from curve_scores import bezier, score
from PIL import Image
from report import environment, write_json

VIEWS = 50
TURNED, MOVED = 0.3, 0.01
# Rounds in which cameras that are far off are left out.
ALIGNMENTS = 4
# Edges beyond the part's box and this margin, units, are those of the room.
MARGIN = 0.05
# Of a sharp edge this fraction must be seen to be asked for.
SEEN = 0.5
# By name: the file of the cameras, and whether they are refined.
ROWS = {
    "true": ("true", False),
    "true refined": ("true", True),
    "wrong": ("wrong", False),
    "refined": ("wrong", True),
    "pycolmap": ("pycolmap/transforms", False),
    "pycolmap refined": ("pycolmap/transforms", True),
}


def generate(seed: int, folder: Path, k1: float = 0.0) -> None:
    """Writes the photographs of a part, its true and its wrong cameras, and the edges that they show."""
    part, rng = random_part(seed), np.random.default_rng([seed, 3000])
    views, scene = random_views(rng, VIEWS), scene_of(part.mesh, rng)
    (folder / "photographs").mkdir(parents=True, exist_ok=True)
    for i, view in enumerate(views):
        image = Image.fromarray(np.round(255 * photograph(scene, view, rng, k1)).astype(np.uint8))
        image.save(folder / "photographs" / f"{i:03d}.jpg", quality=95)
    for name, given in {"true": views, "wrong": [_wrong(view, rng) for view in views]}.items():
        lens = {"k1": k1} if k1 and name == "true" else {}
        (folder / f"{name}.json").write_text(json.dumps(_named_jpg({**transforms(given, "photographs"), **lens})))
    (folder / "ground_truth.json").write_text(json.dumps(_seen(part, views)))


def _named_jpg(content: dict) -> dict:
    frames = [{**frame, "file_path": frame["file_path"].replace(".png", ".jpg")} for frame in content["frames"]]
    return {**content, "frames": frames}


def _seen(part: Part, views: list[View]) -> dict:
    """The ground truth, without the edges that are hidden from all but two views for most of their length."""
    pieces = pieces_of_edges(part.sharp, SHARP)
    often = sum(visible(pieces, rasterise(part.mesh, view), view).astype(int) for view in views) >= 3
    shown = np.array([often[pieces.edge == i].mean() for i in range(len(part.sharp))])
    truth = ground_truth(part, shown)
    return {**truth, "curves": [c for c, s in zip(truth["curves"], shown, strict=True) if s >= SEEN]}


def _wrong(view: View, rng: np.random.Generator) -> View:
    """The view from a camera that is turned and moved."""
    axis, away = (_unit(rng.normal(size=3)) for _ in range(2))
    distance = np.linalg.norm(view.eye - CENTRE)
    return View(view.eye + MOVED * distance * away, view.axes @ _rotation(axis, np.deg2rad(TURNED)))


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def to_truth(used: dict, true: dict, points: np.ndarray) -> np.ndarray:
    """Points of the world of the used cameras in that of the true ones: by a similarity.

    Each point is where the true cameras see what the used ones see of it, as nearly as their rays meet. Not all may be
    used, and those that are off by more than three times the median, in which refinement has lost its way, say nothing
    of where the world lies.
    """
    named = {Path(frame["file_path"]).name: frame for frame in true["frames"]}
    centers, rays = [], []
    for one in used["frames"]:
        pose, lens = np.array(one["transform_matrix"]), {**used, **one}
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        plane = local[:, :2] / -local[:, 2:] * [lens["fl_x"] / FOCAL, lens["fl_y"] / FOCAL]
        plane += np.array([lens["cx"] - SIZE / 2, SIZE / 2 - lens["cy"]]) / FOCAL
        pose = np.array(named[Path(one["file_path"]).name]["transform_matrix"])
        ray = np.column_stack([plane, -np.ones(len(plane))]) @ pose[:3, :3].T
        centers.append(pose[:3, 3])
        rays.append(ray / np.linalg.norm(ray, axis=1, keepdims=True))
    across = np.eye(3) - np.array(rays)[..., None] * np.array(rays)[..., None, :]
    kept = np.ones(len(centers), bool)
    for _ in range(ALIGNMENTS):
        right = np.einsum("vmij,vj->mi", across[kept], np.array(centers)[kept])
        there = np.linalg.solve(across[kept].sum(0), right[..., None])[..., 0]
        off = there - np.array(centers)[:, None]
        error = np.sqrt((np.einsum("vmij,vmj->vmi", across, off) ** 2).sum(-1).mean(1)) / np.linalg.norm(
            off[:, 0], axis=1
        )
        kept = error <= 3 * np.median(error)
    here, middle = points.mean(0), there.mean(0)
    u, s, v = np.linalg.svd((there - middle).T @ (points - here))
    mirrored = np.diag([1, 1, np.linalg.det(u @ v)])
    scale = (s * np.diag(mirrored)).sum() / ((points - here) ** 2).sum()
    return scale * (points - here) @ (u @ mirrored @ v).T + middle


def row(name: str, seed: int, folder: Path, out: Path, extra: list[str]) -> dict[str, Any]:
    """One run of the command and its scores."""
    cameras, refine = ROWS[name]
    if name.startswith("pycolmap") and not (folder / f"{cameras}.json").is_file():
        find = [sys.executable, "-m", "diff3ds.cli", "cameras", str(folder / "photographs"), "-o"]
        subprocess.run([*find, str(folder / "pycolmap"), "--quiet"], check=True)
    out = out / name.replace(" ", "-")
    command = [sys.executable, "-m", "diff3ds.cli", "views", str(folder / f"{cameras}.json"), "-o", str(out)]
    command += ["--target", "color-edges", "--quiet", "--overwrite"]
    command += ["--refine-cameras" if refine else "--keep-cameras", *extra]
    begun = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found: dict[str, Any] = {"cameras": name, "seed": seed, "seconds": time.perf_counter() - begun}
    if done.returncode:
        return {**found, "F5": 0.0, "error": done.stderr.strip()[-300:]}
    truth = json.loads((folder / "ground_truth.json").read_text())
    true = json.loads((folder / "true.json").read_text())
    used = out / "transforms_refined.json" if refine else folder / f"{cameras}.json"
    sketch = json.loads((out / "sketch.json").read_text())
    return {**found, **score(_of_part(sketch, json.loads(used.read_text()), true, truth), truth)}


def _of_part(sketch: dict, used: dict, true: dict, truth: dict) -> dict:
    """The curves within the part's box, in the world of the truth."""
    controls = np.array(sketch["points"])
    if len(controls):
        box = CENTRE + np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 4)] * 3), -1).reshape(-1, 3)
        corners = np.concatenate([box, controls.reshape(-1, 3)])
        # The box fixes the similarity, the curves are moved along.
        controls = to_truth(used, true, corners)[len(box) :].reshape(controls.shape)
    edges = np.concatenate([curve["points"] for curve in truth["curves"]])
    low, high = edges.min(0) - MARGIN, edges.max(0) + MARGIN
    weights = sketch.get("weights") or [None] * len(controls)
    inside = [
        i
        for i, (points, weight) in enumerate(zip(controls, weights, strict=True))
        if (np.median(c := bezier(points, None if weight is None else np.array(weight)), 0) > low).all()
        and (np.median(c, 0) < high).all()
    ]
    return {"points": controls[inside].tolist(), "weights": [weights[i] for i in inside]}


def main() -> None:
    """Measures, prints a line a run and a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", default="30-41")
    parser.add_argument("--rows", nargs="+", choices=list(ROWS), default=list(ROWS))
    parser.add_argument("--k1", type=float, default=0.0)
    parser.add_argument("--json", type=Path)
    chosen, extra = parser.parse_known_args()
    first, _, last = chosen.seeds.partition("-")
    rows = []
    for seed in range(int(first), int(last or first) + 1):
        folder = chosen.out / (f"{seed:02d}" + (f" k1 {chosen.k1:g}" if chosen.k1 else ""))
        if not (folder / "ground_truth.json").is_file():
            generate(seed, folder, chosen.k1)
        for name in chosen.rows:
            rows.append(row(name, seed, folder, folder / "sketches", extra))
            shown = {k: round(v, 3) if isinstance(v, float) else v for k, v in rows[-1].items()}
            columns = ("cameras", "seed", "F5", "P5", "R5", "curves", "seconds", "error")
            print({k: shown[k] for k in columns if k in shown}, flush=True)
    figures = {}
    for name in chosen.rows:
        f5 = [r["F5"] for r in rows if r["cameras"] == name]
        figures[name] = {"F5_mean": statistics.fmean(f5), "F5_worst": min(f5)}
        print(f"{name:14} F5 mean {statistics.fmean(f5):.3f}, worst {min(f5):.3f}, {len(f5)} parts")
    if chosen.json:
        write_json(chosen.json, environment(), {**figures, "rows": rows})


if __name__ == "__main__":
    main()
