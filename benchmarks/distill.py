"""Distillation from a prior with a known answer: whether the recipe finds the shape that the prior has in mind.

    python benchmarks/distill.py shapes [--steps N] [--seeds N] [--json FILE]
    python benchmarks/distill.py ablations [--shapes chair,mug] [--json FILE]

The prior is exact: the posterior mean over the renderings of one member of each category of the built-in library,
64 x 64 pixels, four views, strokes of 3 pixels. The phrase picks one of them. With other than 4,000 steps the rate
changes too, so that strokes can go as far. Scores compare points along the strokes with that member:
F-scores and mean distances where the longest side of the object is 1. Runs go side by side, one a core.
"""

import argparse
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch
from report import environment, say, show, write_json
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.bezier import evaluate
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.library.members import member
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior
from diff3ds.tasks.text_image.distillation import distill
from diff3ds.tasks.text_image.run_spec import AnyRun, RunSpec
from diff3ds.tasks.text_image.subject import Phrase

SHAPES = ("chair", "table", "house", "mug", "lamp", "car", "bottle", "rocket")
SIZE, WIDTH = 64, 0.05
# The paper's rate times its steps.
RATE_STEPS = 0.002 * 4000
# Points on a stroke, and points of a sketch that are compared.
SAMPLES, POINTS = 200, 20_000
PAPER = with_options(RunSpec(Phrase("")), width=WIDTH, sheet_every=0)
# The paper's recipe with one thing changed.
ABLATIONS: dict[str, dict[str, Any]] = {
    "the paper's recipe": {},
    "no time annealing": {"t_low": (0.02, 0.02), "t_high": (0.98, 0.98)},
    "no noise deletion": {"delete_length": 0.0},
    "14 strokes": {"strokes": 14},
    "28 strokes": {"strokes": 28},
    "112 strokes": {"strokes": 112},
    "guidance 1": {"guidance": 1.0},
    "guidance 7.5": {"guidance": 7.5},
    "guidance 100": {"guidance": 100.0},
    "radius 0.5": {"radius": 0.5},
    "radius 0.8": {"radius": 0.8},
    "radius 1.0": {"radius": 1.0},
    "annealing to .02 and .98 to .5": {"t_low": (0.98, 0.02), "t_high": (0.98, 0.5)},
    "annealing over half the steps": {"anneal_share": 0.5},
    "rescale 0": {"rescale": 0.0},
    "position and color": {"optimize": ("position", "color")},
    "position and alpha": {"optimize": ("position", "alpha")},
    "position, color and alpha": {"optimize": ("position", "color", "alpha")},
    "position and width": {"optimize": ("position", "width")},
    "sds, w = 1 - alpha-bar": {"method": "sds"},
    "sds, w = 1": {"method": "sds", "weighting": "uniform"},
    "csd": {"method": "csd"},
    "nfsd, guidance 7.5": {"method": "nfsd", "guidance": 7.5},
    "asd, guidance 7.5": {"method": "asd", "guidance": 7.5},
    "ism, guidance 7.5": {"method": "ism", "guidance": 7.5},
    "sdi, guidance 8.5": {"method": "sdi", "guidance": 8.5},
    "blur 1 px": {"blur": 1.0},
    "rate falls to a fifth": {"final_rate": 0.2},
    "preset swift": {"preset": "swift", "steps": 400, "rate": None},
}


def truths() -> dict[str, ds.Sketch]:
    """The member of every category that the prior knows."""
    known = {name: member(name, torch.Generator().manual_seed(1)).sketch for name in SHAPES}
    return {name: replace(sketch, width=torch.full_like(sketch.width, WIDTH)) for name, sketch in known.items()}


def points_on(sketch: ds.Sketch) -> np.ndarray:
    """Points evenly spread over the length of all strokes."""
    curves = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, SAMPLES + 1)).double()
    chords = (curves[:, 1:] - curves[:, :-1]).norm(dim=-1).flatten()
    middles = (curves[:, 1:] + curves[:, :-1]).reshape(-1, 3) / 2
    along = chords.cumsum(0)
    places = (torch.arange(POINTS, dtype=torch.float64) + 0.5) / POINTS * along[-1]
    return middles[torch.searchsorted(along, places)].numpy()


def scores(sketch: ds.Sketch, truth: ds.Sketch) -> dict[str, float]:
    """F-scores at 5 and 2 % of the object's longest side, and the mean distance both ways in percent of it."""
    found, wanted = points_on(sketch), points_on(truth)
    side = float(np.ptp(wanted, axis=0).max())
    there, back = cKDTree(wanted).query(found)[0] / side, cKDTree(found).query(wanted)[0] / side
    figures = {"chamfer_percent": 50 * float(there.mean() + back.mean())}
    for percent in (5, 2):
        precision, recall = (float((d < percent / 100).mean()) for d in (there, back))
        figures[f"F{percent}"] = 2 * precision * recall / max(precision + recall, 1e-9)
    return figures


def recover(shape: str, spec: AnyRun) -> dict[str, float]:
    """Figures of one run."""
    torch.set_num_threads(1)
    ds.set_num_threads(1)
    known = truths()
    fitting = torch.tensor([name == shape for name in known])

    def draw(cameras: ds.Cameras) -> torch.Tensor:
        return torch.stack([ds.render(sketch, cameras).color for sketch in known.values()])

    denoiser = ExemplarDenoiser(draw, fitting, SIZE)
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        sketch = distill(ConditionedPrior("exact", denoiser), with_options(spec, phrase=shape), Path(folder))
    seconds = time.perf_counter() - begun
    return {**scores(sketch, known[shape]), "strokes": len(sketch), "seconds": seconds}


def run(jobs: dict[Any, tuple[str, AnyRun]]) -> dict[Any, dict[str, float]]:
    """Figures of all runs, one a core."""
    figures = {}
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        waiting = {key: pool.submit(recover, *job) for key, job in jobs.items()}
        for key, job in waiting.items():
            figures[key] = job.result()
            print(key, {name: round(value, 3) for name, value in figures[key].items()}, file=sys.stderr)
    return figures


def shapes(chosen: argparse.Namespace) -> dict[str, Any]:
    """The paper's recipe on every shape: medians over the seeds, and the worst."""
    spec = with_options(PAPER, steps=chosen.steps, rate=RATE_STEPS / chosen.steps)
    jobs = {
        (shape, seed): (shape, with_options(spec, seed=seed)) for shape in chosen.shapes for seed in range(chosen.seeds)
    }
    found = run(jobs)
    rows = {}
    for shape in chosen.shapes:
        runs = [found[shape, seed] for seed in range(chosen.seeds)]
        rows[shape] = {name: median(r[name] for r in runs) for name in runs[0]} | {
            "F5_worst": min(r["F5"] for r in runs)
        }
    columns = ("F5", "F5_worst", "F2", "chamfer_percent", "strokes", "seconds")
    show(f"The paper's recipe, {chosen.steps} steps, {chosen.seeds} seeds", ("shape", *columns),
         [(shape, *(row[c] for c in columns)) for shape, row in rows.items()])  # fmt: skip
    return rows


def ablations(chosen: argparse.Namespace) -> dict[str, Any]:
    """Means over the shapes for every change of the recipe."""
    names = [name for name in ABLATIONS if not chosen.only or chosen.only in name]
    jobs = {
        (name, shape, seed): (
            shape,
            with_options(
                PAPER, **{"steps": chosen.steps, "rate": RATE_STEPS / chosen.steps, "seed": seed, **ABLATIONS[name]}
            ),
        )
        for name in names
        for shape in chosen.shapes
        for seed in range(chosen.seeds)
    }
    found = run(jobs)
    rows = {}
    for name in names:
        runs = [figures for key, figures in found.items() if key[0] == name]
        rows[name] = {key: sum(r[key] for r in runs) / len(runs) for key in runs[0]}
        rows[name]["F5_worst"] = min(r["F5"] for r in runs)
    columns = ("F5", "F5_worst", "F2", "chamfer_percent", "strokes", "seconds")
    show(f"Ablations, {chosen.steps} steps, means over {', '.join(chosen.shapes)}", ("recipe", *columns),
         [(name, *(row[c] for c in columns)) for name, row in rows.items()])  # fmt: skip
    return rows


def main() -> None:
    """Runs one of the two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("shapes", "ablations"))
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--shapes", type=lambda text: text.split(","), default=list(SHAPES))
    parser.add_argument("--only", default="", help="ablations whose name has this in it")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    about = environment()
    figures = (shapes if chosen.what == "shapes" else ablations)(chosen)
    say(str(about["command"]))
    if chosen.json:
        write_json(chosen.json, about, {chosen.what: figures})


if __name__ == "__main__":
    main()
