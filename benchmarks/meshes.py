"""`diff3ds mesh` on parts whose edges are known: 60 generated solids, triangulated.

    python benchmarks/meshes.py [--seeds 0-59] [--json FILE]

Seeds as of cad_objects.py. Figures: F-score at 5 mm of the curves against the true sharp edges (the longest side is one
metre), curves against edges, circles found with their radii, and processor seconds. The CAD kernel is needed:
pip install 'diff3ds[cad]'.
"""

import argparse
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cad.part import random_part
from cad_objects import ground_truth
from curve_scores import score
from report import environment, show, write_json

import diff3ds as ds
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.surfaces.lines.feature_curves import feature_curves


def row(seed: int) -> dict[str, Any]:
    """One part."""
    part = random_part(seed)
    begun = time.process_time()
    mesh = ds.TriangleMesh(part.mesh.vertices, part.mesh.triangles)
    curves = feature_curves(mesh).curves
    sketch = sketch_of(curves, 0.006).segments()
    seconds = time.process_time() - begun
    found = {"points": sketch.points.tolist(), "weights": sketch.weights.tolist()}
    figures = score(found, ground_truth(part))
    return {
        "seed": seed,
        "faces": len(mesh),
        "seconds": seconds,
        "curves_made": len(curves),
        "edges": len(part.sharp),
        **figures,
    }


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0-59")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    first, last = (int(s) for s in chosen.seeds.split("-"))
    torch.set_num_threads(1)
    rows = [row(seed) for seed in range(first, last + 1)]
    columns = ("faces", "curves_made", "edges", "F5", "circles", "circles_found", "seconds")
    columns = tuple(c for c in columns if c in rows[0])
    show("Meshes of parts", ("seed", *columns), [(r["seed"], *(r[c] for c in columns)) for r in rows])
    f5 = [r["F5"] for r in rows]
    figures = {
        "F5_mean": statistics.fmean(f5), "F5_worst": min(f5),
        "curves_per_edge": sum(r["curves_made"] for r in rows) / sum(r["edges"] for r in rows),
        "seconds_mean": statistics.fmean(r["seconds"] for r in rows),
        "faces_mean": statistics.fmean(r["faces"] for r in rows),
    }  # fmt: skip
    for name in rows[0]:
        values = [r[name] for r in rows if isinstance(r[name], int | float) and np.isfinite(r[name])]
        if name.startswith("circle") and values:
            figures[name] = sum(values) if isinstance(values[0], int) else statistics.fmean(values)
    print(figures)
    if chosen.json:
        write_json(chosen.json, environment(), {**figures, "rows": rows})


if __name__ == "__main__":
    main()
