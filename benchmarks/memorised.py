"""Whether the small prior copies members that it was trained on.

    python benchmarks/memorised.py FOLDER [--members 96000] [--seeds 1]

FOLDER holds runs of categories.py --prior small. Each sketch is compared with the members of its category that the
training drew (attributes and stretches included), and with as many that another seed draws: one that copies what it
was trained on lies nearer to the former. Writes FOLDER/memorised.json.

Figures: mean distance to the nearest member of the training, and to the nearest of the other seed, percent of the
size; how often the former is smaller (half of the time where nothing is copied).
"""

import argparse
import json
import os
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import torch
from distill import points_on
from report import environment, show, write_json
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.tasks.small_prior.prior_data import BuiltIn
from diff3ds.tasks.small_prior.small_prior import trained

# The seed of `diff3ds prior train`, and another one.
SEEDS = {"training": 0, "other": 1}
THIN = 16


def drawn(seed: int, first: int, count: int) -> list[tuple[str, np.ndarray]]:
    """Categories and points of the examples `first` to `first` + `count` of the training with this seed."""
    torch.set_num_threads(1)
    found = []
    for index in range(first, first + count):
        # As diff3ds.tasks.small_prior.prior_data.Examples draws them.
        (mixed,) = np.random.SeedSequence([seed, index]).generate_state(1)
        sketch, words = BuiltIn(trained().kinds).draw(torch.Generator().manual_seed(int(mixed)))
        category = next(word for word in words if word in trained().kinds)
        found.append((category, points_on(sketch)[::THIN].astype(np.float32)))
    return found


def distance(points: np.ndarray, tree: cKDTree, known: np.ndarray) -> float:
    """Mean distance both ways, percent of the known one's longest side."""
    side = float(np.ptp(known, axis=0).max())
    return 50 * float(cKDTree(known).query(points)[0].mean() + tree.query(known)[0].mean()) / side


def nearest(path: Path, pools: dict[str, list[np.ndarray]]) -> dict[str, float]:
    """The distance to the nearest member of each pool."""
    row = json.loads(path.read_text())
    sketch = ds.Sketch(torch.tensor(row["sketch"]["points"]), torch.tensor(row["sketch"]["weights"]))
    points = points_on(sketch)[::THIN]
    tree = cKDTree(points)
    return {name: min(distance(points, tree, known) for known in pool) for name, pool in pools.items()}


def main() -> None:
    """Draws all members again and shows the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--members", type=int, default=96_000)
    parser.add_argument("--seeds", type=int, default=1)
    chosen = parser.parse_args()
    paths = {
        f"{category} {seed}": (category, chosen.folder / f"{category.replace(' ', '_')}-{seed}.json")
        for category in trained().kinds
        for seed in range(chosen.seeds)
    }
    missing = [str(path) for _, path in paths.values() if not path.is_file()]
    if missing or chosen.members < 1:
        parser.error(f"--members at least 1, and runs of categories.py --prior small; missing: {missing[:3]}")
    pools: dict[str, dict[str, list[np.ndarray]]] = defaultdict(lambda: {name: [] for name in SEEDS})
    with ProcessPoolExecutor(os.cpu_count()) as workers:
        for name, seed in SEEDS.items():
            step = 500
            starts = range(0, chosen.members, step)
            counts = [min(step, chosen.members - start) for start in starts]
            for part in workers.map(drawn, [seed] * len(starts), starts, counts):
                for category, points in part:
                    pools[category][name].append(points)
        jobs = {name: workers.submit(nearest, path, pools[category]) for name, (category, path) in paths.items()}
        rows = {name: job.result() for name, job in jobs.items()}
    figures = {name: float(np.mean([row[name] for row in rows.values()])) for name in SEEDS}
    figures["training nearer"] = float(np.mean([row["training"] < row["other"] for row in rows.values()]))
    show(f"{len(rows)} sketches", tuple(figures), [tuple(figures.values())])
    write_json(chosen.folder / "memorised.json", environment(), {"all": figures, "sketches": rows})


if __name__ == "__main__":
    main()
