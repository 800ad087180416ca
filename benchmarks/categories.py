"""Every category of the library by a built-in prior, over several seeds: is the thing found, and does one recognise it.

    python benchmarks/categories.py FOLDER --classifier FILE [--prior exemplar|small] [--weights FILE] [--seeds 5]
    python benchmarks/categories.py FOLDER --classifier FILE --prior small --combinations

The second draws members with several attributes: as many that the small prior was trained on as were held out.
FILE is written by classifier.py. Runs that FOLDER has are not made again. Writes FOLDER/figures.json.

Figures: F-scores at 5 and 2 % of the size and mean distance to the nearest of 24 members of that caption, of seeds that
no run has; the same distance of fresh members, which is what a prior has that knows the category and copies nothing;
for the exact prior also the F-scores to the nearest of the members that it was given; whether a classifier names the
category from 8 views together (top 1) and from single ones (views); how often the nearest member of all combinations of
attributes has the ones that were asked for (kind).
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import classifier as sight
import numpy as np
import torch
from distill import points_on
from report import environment, show, write_json
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.library import CATEGORIES, member
from diff3ds.tasks.exact_prior.exemplars import exemplars_of
from diff3ds.tasks.small_prior.prior_data import combinations
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image.prior_options import PriorOptions
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text

POOL, POOL_SEEDS, KIND_POOL, THIN = 24, 3_000_000, 6, 8
COLUMNS = ("F5", "F2", "chamfer_percent", "fresh_chamfer_percent", "top1", "views", "strokes", "seconds")
# Of the exact prior, against the members that the run was given.
GIVEN = ("given_F5", "given_F2")


def members(category: str, kind: Sequence[str], count: int, first: int = POOL_SEEDS) -> list[ds.Sketch]:
    """Members of one caption."""
    return [member(category, torch.Generator().manual_seed(first + i), kind).sketch for i in range(count)]


def nearest(sketch: ds.Sketch, pool: Sequence[ds.Sketch]) -> dict[str, float]:
    """F-scores and mean distance to the member of the pool that is nearest, in parts of that member's longest side."""
    found, best = points_on(sketch)[::THIN], {"chamfer_percent": float("inf")}
    tree = cKDTree(found)
    for known in pool:
        wanted = points_on(known)[::THIN]
        side = float(np.ptp(wanted, axis=0).max())
        there, back = cKDTree(wanted).query(found)[0] / side, tree.query(wanted)[0] / side
        figures = {"chamfer_percent": 50 * float(there.mean() + back.mean())}
        for percent in (5, 2):
            precision, recall = (float((d < percent / 100).mean()) for d in (there, back))
            figures[f"F{percent}"] = 2 * precision * recall / max(precision + recall, 1e-9)
        if figures["chamfer_percent"] < best["chamfer_percent"]:
            best = figures
    return best


def nearest_kind(sketch: ds.Sketch, category: str) -> tuple[str, ...]:
    """The attributes of the nearest member of the category."""
    kinds = CATEGORIES[category].combinations()
    distances = [nearest(sketch, members(category, kind, KIND_POOL))["chamfer_percent"] for kind in kinds]
    return kinds[int(np.argmin(distances))]


def draw(category: str, kind: tuple[str, ...], seed: int, prior: PriorOptions, looks: Path) -> dict[str, Any]:
    """One run and its figures."""
    torch.set_num_threads(1)
    ds.set_num_threads(1)
    phrase = CATEGORIES[category].captions(kind)[0]
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as run:
        spec = with_options(RunSpec(Phrase(phrase), prior), seed=seed, sheet_every=0)
        sketch = run_text(spec, Path(run) / "run")
    seconds = time.perf_counter() - begun
    judge = sight.load(looks)
    named = sight.recognised(judge, sketch)
    with torch.no_grad():
        single = judge(sight.looks(sketch)).argmax(1)
    pool, given = members(category, kind, POOL), {}
    if prior.prior == "exemplar":
        known = nearest(sketch, exemplars_of(phrase, seed).meant)
        given = {f"given_{name}": known[name] for name in ("F5", "F2")}
    return {
        "phrase": phrase,
        "category": category,
        "kind": list(kind),
        "seed": seed,
        **nearest(sketch, pool),
        **given,
        "fresh_chamfer_percent": nearest(members(category, kind, 1, seed)[0], pool)["chamfer_percent"],
        "top1": float(named[0] == category),
        "named": named[:3],
        "views": float((single == judge.kinds.index(category)).float().mean()),
        "right_kind": float(nearest_kind(sketch, category) == kind) if kind else None,
        "strokes": len(sketch),
        "seconds": seconds,
        "sketch": {name: value.tolist() for name, value in (("points", sketch.points), ("weights", sketch.weights))},
    }


def jobs(chosen: argparse.Namespace) -> list[tuple[str, tuple[str, ...], int]]:
    """What to draw."""
    if not chosen.combinations:
        return [(name, (), seed) for seed in range(chosen.seeds) for name in chosen.only]
    held = [(name, kind) for name in chosen.only for kind in combinations(name, True)]
    seen = [(name, kind) for name in chosen.only for kind in combinations(name, False) if len(kind) > 1]
    order = torch.randperm(len(seen), generator=torch.Generator().manual_seed(0)).tolist()
    taken = held + [seen[i] for i in order[: len(held)]]
    return [(name, kind, seed) for seed in range(chosen.seeds) for name, kind in taken]


def mean(rows: Sequence[dict[str, Any]], column: str) -> float:
    """Mean of a column."""
    return sum(row[column] for row in rows) / len(rows)


def main() -> None:
    """Draws them all and shows the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--classifier", type=Path, required=True)
    parser.add_argument("--prior", choices=("exemplar", "small"), default="exemplar")
    parser.add_argument("--weights")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--combinations", action="store_true")
    parser.add_argument(
        "--only",
        type=lambda text: text.split(","),
        help="kinds, separated by commas; by default all that the prior knows",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    chosen = parser.parse_args()
    chosen.only = chosen.only or list(trained(chosen.weights).kinds if chosen.prior == "small" else CATEGORIES)
    chosen.folder.mkdir(parents=True, exist_ok=True)
    about, prior = environment(), PriorOptions(prior=chosen.prior, weights=chosen.weights)
    rows, waiting = [], {}
    with ProcessPoolExecutor(chosen.jobs) as pool:
        for category, kind, seed in jobs(chosen):
            path = chosen.folder / f"{'-'.join((category, *kind)).replace(' ', '_')}-{seed}.json"
            if not path.exists():
                waiting[path] = pool.submit(draw, category, kind, seed, prior, chosen.classifier)
            else:
                rows.append(json.loads(path.read_text()))
        for path, job in waiting.items():
            row = job.result()
            path.write_text(json.dumps(row))
            rows.append(row)
            print(row["phrase"], row["seed"], f"F5 {row['F5']:.3f}", row["named"], file=sys.stderr)
    figures = summary(chosen, rows)
    write_json(chosen.folder / "figures.json", about, figures)


def summary(chosen: argparse.Namespace, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Means by category, or by whether a combination was held out; and of all."""
    if chosen.combinations:
        groups = {True: "held out", False: "seen"}
        sorts = [groups[tuple(row["kind"]) in combinations(row["category"], True)] for row in rows]
        columns: tuple[str, ...] = (*COLUMNS, "right_kind")
    else:
        sorts, columns = [row["category"] for row in rows], COLUMNS
    columns += GIVEN if chosen.prior == "exemplar" else ()
    figures = {}
    for name in dict.fromkeys(sorts):
        mine = [row for row, sort in zip(rows, sorts, strict=True) if sort == name]
        figures[name] = {column: mean(mine, column) for column in columns} | {"F5_worst": min(r["F5"] for r in mine)}
    figures["all"] = {c: mean(rows, c) for c in columns} | {"F5_worst": min(r["F5"] for r in rows)}
    shown = ("F5", "F5_worst", *columns[1:])
    title = f"{chosen.prior}, {len(rows)} runs"
    show(title, ("what", *shown), [(name, *(row[c] for c in shown)) for name, row in figures.items()])
    return figures


if __name__ == "__main__":
    main()
