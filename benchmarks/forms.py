"""Edges of bumpy, rounded and scanned surfaces and of clouds of points, against the true edges of the parts.

    python benchmarks/forms.py [--seeds 0-59] [--kinds generated scan1 ...] [--keep FOLDER] [--json FILE]

Seeds as of cad_objects.py. Kinds: generated, meshes as image-to-3D models give; scan1, scan2, scan5, scans of
60,000 faces with noise of .1, .2 and .5 % of the longest side; coarse1 and so on, the same decimated to 6,000 faces;
cloud0, cloud1, cloud5, 32,768 points, clean and with noise, every third part seen from one side only; pi3detr,
the clouds with true curves in DIFF3DS_DATA/points, beside PI3DETR's own results. Needs the CAD kernel
(pip install 'diff3ds[cad]') and fast-simplification.

Figures: F at .25, .5, 1 and 1.5 % of the longest side, curves a true edge, circles whose radius is right to 1 %, and
processor seconds. Of one side only edges both of whose faces are seen count as missing.
"""

import argparse
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cad import scans
from cad.part import random_part
from curve_scores import circle_of
from report import environment, show, write_json

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import sampled
from diff3ds.metrics.curve_scores import resampled
from diff3ds.surfaces.form.form_curves import form_curves
from diff3ds.surfaces.form.samples import Samples

KINDS = ("generated", *(f"{name}{noise}" for name in ("scan", "coarse") for noise in (1, 2, 5)))
KINDS += ("cloud0", "cloud1", "cloud5", "pi3detr")
WITHIN = (0.0025, 0.005, 0.01, 0.015)
# Points of curves are so far apart, and circles of at least so large a part of a turn are asked for; shares, turns.
STEP, LEAST_ARC = 0.005, 0.25
# A place is seen from both sides where the points of a clean cloud within so far of it spread out of their plane by so
# large a part of that.
AROUND, BENT = 0.02, 0.06


def data(seed: int, kind: str, keep: Path | None) -> dict[str, np.ndarray]:
    """Vertices and faces, or points."""
    path = None if keep is None else keep / f"{kind}-{seed:02d}.npz"
    if path is not None and path.exists():
        return dict(np.load(path))
    part = random_part(seed)
    noise = int(kind[-1]) / 1000 if kind[-1].isdigit() else 0.0
    if kind.startswith("cloud"):
        made = {"points": scans.cloud(part, noise, one_sided(seed), seed)}
    elif kind == "generated":
        made = dict(zip(("vertices", "faces"), scans.generated(part, seed), strict=True))
    else:
        faces = 60_000 if kind.startswith("scan") else 6_000
        made = dict(zip(("vertices", "faces"), scans.scanned(part, noise, faces, seed), strict=True))
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **made)
    return made


def one_sided(seed: int) -> bool:
    """Whether the clouds of a part are seen from one side."""
    return seed % 3 == 2


def row(seed: int, kind: str, keep: Path | None) -> dict[str, Any]:
    """One part."""
    part, given = random_part(seed), data(seed, kind, keep)
    found, seconds = _found(given)
    true = [edge.points for edge in part.sharp]
    seen = None
    if kind.startswith("cloud") and one_sided(seed):
        seen = _seen(np.vstack([resampled(c, STEP) for c in true]), data(seed, "cloud0", keep)["points"])
    circles = [e for e in part.sharp if e.type == "circle" and e.angle >= 2 * np.pi * LEAST_ARC]
    fitted = [c for c in (circle_of(curve) for curve in found) if c is not None]
    right = sum(
        any(
            abs(f.radius / c.radius - 1) < 0.01 and np.linalg.norm(f.center - c.center) < 0.1 * c.radius for f in fitted
        )
        for c in circles
    )
    kinds = {"seed": seed, "kind": kind, "circles": len(circles), "circles_right": right}
    return kinds | {"seconds": seconds} | scores(found, true, 1.0, seen)


def clouds_of_others(folder: Path) -> list[dict[str, Any]]:
    """PI3DETR's clouds, with its figures."""
    rows = []
    for path in sorted(folder.glob("*.npz")):
        given = np.load(path)
        points = given["points"].astype(float)
        box = float(np.ptp(points, axis=0).max())
        found, seconds = _found({"points": points})
        true = list(given["gt_curves"].astype(float))
        theirs = scores(list(given["pred_curves"].astype(float)), true, box)
        head = {"seed": int(path.stem), "kind": "pi3detr", "seconds": seconds}
        rows.append(head | scores(found, true, box) | {f"their_{name}": value for name, value in theirs.items()})
    return rows


def _found(given: dict[str, np.ndarray]) -> tuple[list[np.ndarray], float]:
    """Curves, sampled, and processor seconds."""
    begun = time.process_time()
    if "points" in given:
        samples = Samples.of_points(given["points"])
    else:
        samples = Samples.of_mesh(ds.TriangleMesh(given["vertices"], given["faces"]))
    curves = form_curves(samples).curves
    return list(sampled(curves)) if len(curves) else [], time.process_time() - begun


def scores(
    found: list[np.ndarray], true: list[np.ndarray], box: float, seen: np.ndarray | None = None
) -> dict[str, float]:
    """F at the tolerances, numbers of curves; `seen` says which points of the true curves could be found."""
    from scipy.spatial import cKDTree

    out: dict[str, float] = {"curves": len(found), "edges": len(true)}
    there = np.vstack([resampled(curve, STEP * box) for curve in true])
    if not found:
        return out | {f"F{1e4 * t:.0f}": 0.0 for t in WITHIN}
    here = np.vstack([resampled(curve, STEP * box) for curve in found])
    off, missed = cKDTree(there).query(here)[0], cKDTree(here).query(there)[0]
    missed = missed if seen is None else missed[seen]
    for t in WITHIN:
        precision, recall = (off < t * box).mean(), (missed < t * box).mean()
        out[f"F{1e4 * t:.0f}"] = float(2 * precision * recall / max(precision + recall, 1e-12))
    return out


def _seen(places: np.ndarray, cloud: np.ndarray) -> np.ndarray:
    """Which places have points of a clean cloud around them that do not lie in one plane."""
    from scipy.spatial import cKDTree

    seen = np.zeros(len(places), bool)
    for k, near in enumerate(cKDTree(cloud).query_ball_point(places, AROUND)):
        if len(near) >= 8:
            spread = np.linalg.svd(cloud[near] - cloud[near].mean(0), compute_uv=False) / np.sqrt(len(near))
            seen[k] = spread[2] > BENT * AROUND
    return seen


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0-59")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--keep", type=Path, help="folder in which meshes and clouds are kept for the next time")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    first, _, last = chosen.seeds.partition("-")
    torch.set_num_threads(1)
    rows, means = [], []
    for kind in chosen.kinds:
        if kind == "pi3detr":
            own = clouds_of_others(Path(os.environ.get("DIFF3DS_DATA", "../shared/data")) / "points")
        else:
            own = [row(seed, kind, chosen.keep) for seed in range(int(first), int(last or first) + 1)]
        if own:
            rows += own
            means.append(_mean(own))
            print(means[-1], flush=True)
    columns = tuple(dict.fromkeys(name for mean in means for name in mean))
    show("Edges by forms", columns, [tuple(mean.get(c) for c in columns) for mean in means])
    if chosen.json:
        write_json(chosen.json, environment(), {"means": means, "rows": rows})


def _mean(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of one kind."""
    out: dict[str, Any] = {"kind": rows[0]["kind"], "parts": len(rows)}
    out |= {name: float(np.mean([r[name] for r in rows])) for name in rows[0] if "F" in name}
    out["curves_per_edge"] = sum(r["curves"] for r in rows) / sum(r["edges"] for r in rows)
    if "circles" in rows[0]:
        out["circles_right"] = sum(r["circles_right"] for r in rows) / max(sum(r["circles"] for r in rows), 1)
    out["seconds"] = float(np.mean([r["seconds"] for r in rows]))
    return out


if __name__ == "__main__":
    main()
