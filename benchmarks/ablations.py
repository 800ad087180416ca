"""The paper's ablations on `diff3ds text` with the built-in prior: the command's own recipe with one thing changed.

Without the command's last steps on finer pictures, which would hide the differences; one row has them.

    python benchmarks/ablations.py FOLDER --classifier FILE [--only radius] [--categories chair,lamp] [--seeds N]

FILE is written by classifier.py. Runs that FOLDER has are not made again. Writes FOLDER/ablations.json, and
FOLDER/ablations.png: two recipes in a row, each under its name. Figures as in categories.py; F-scores are those
to the nearest of the members that the prior was given.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import classifier as sight
import torch
from categories import nearest
from PIL import Image, ImageDraw, ImageFont
from report import environment, show, write_json

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.library import CATEGORIES
from diff3ds.tasks.exact_prior.exemplars import exemplars_of
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text

CATEGORIES_SHOWN = ("chair", "lamp", "house", "mug")
RECIPES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "no time annealing": {"t_low": (0.02, 0.02), "t_high": (0.98, 0.98)},
    "only low noise": {"t_low": (0.10, 0.10), "t_high": (0.30, 0.30)},
    "only high noise": {"t_low": (0.85, 0.85), "t_high": (0.85, 0.85)},
    "timesteps from .98": {"t_low": (0.98, 0.10), "t_high": (0.98, 0.30)},
    "annealing over half the steps": {"anneal_share": 0.5},
    "no noise deletion": {"delete_length": 0.0},
    "guidance 1": {"guidance": 1.0},
    "guidance 25": {"guidance": 25.0},
    "guidance 50": {"guidance": 50.0},
    "guidance 100": {"guidance": 100.0},
    "14 strokes": {"strokes": 14},
    "28 strokes": {"strokes": 28},
    "56 strokes": {"strokes": 56},
    "radius .4": {"radius": 0.4},
    "radius 1.2": {"radius": 1.2},
    "radius 1.5": {"radius": 1.5},
    "and color": {"optimize": ("position", "color")},
    "and alpha": {"optimize": ("position", "alpha")},
    "and color, alpha": {"optimize": ("position", "color", "alpha")},
    "and width": {"optimize": ("position", "width")},
    "sds": {"method": "sds"},
    "1,600 steps": {"steps": 1600, "rate": 0.0025},
}
COLUMNS = ("F5", "F5_worst", "F2", "chamfer_percent", "top1", "views", "strokes", "seconds")
# Of the sheet: azimuth and elevation, pixels of a sketch and of the line of text above it.
VIEW, CELL, TITLE = (35.0, 18.0), 120, 20


def draw(recipe: str, category: str, seed: int, looks: Path) -> dict[str, Any]:
    """One run and its figures."""
    torch.set_num_threads(1)
    ds.set_num_threads(1)
    begun, phrase = time.perf_counter(), CATEGORIES[category].captions()[0]
    with tempfile.TemporaryDirectory() as run:
        spec = with_options(RunSpec(Phrase(phrase)), prior="exemplar", seed=seed, sheet_every=0, redraw=False)
        sketch = run_text(with_options(spec, **RECIPES[recipe]), Path(run) / "run")
    seconds = time.perf_counter() - begun
    known = exemplars_of(phrase, seed)
    judge = sight.load(looks)
    with torch.no_grad():
        single = judge(sight.looks(sketch)).argmax(1)
    return {
        **nearest(sketch, [m for m, fits in zip(known.members, known.fitting, strict=True) if fits]),
        "top1": float(sight.recognised(judge, sketch)[0] == category),
        "views": float((single == judge.kinds.index(category)).float().mean()),
        "strokes": len(sketch),
        "seconds": seconds,
        "sketch": {name: value.tolist() for name, value in sketch.tensors().items()},
    }


def main() -> None:
    """Runs them all and shows the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--classifier", type=Path, required=True)
    parser.add_argument("--only", default="", help="recipes whose name has this in it")
    parser.add_argument("--categories", type=lambda text: text.split(","), default=list(CATEGORIES_SHOWN))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    about, rows = environment(), {}
    recipes = [name for name in RECIPES if chosen.only in name]
    with ProcessPoolExecutor(chosen.jobs) as pool:
        waiting = {}
        for key in [(r, c, s) for r in recipes for c in chosen.categories for s in range(chosen.seeds)]:
            path = chosen.folder / ("-".join(map(str, key)).replace(" ", "_") + ".json")
            if path.exists():
                rows[key] = json.loads(path.read_text())
            else:
                waiting[key] = (path, pool.submit(draw, *key, chosen.classifier))
        for key, (path, job) in waiting.items():
            rows[key] = job.result()
            path.write_text(json.dumps(rows[key]))
            print(key, f"F5 {rows[key]['F5']:.3f} F2 {rows[key]['F2']:.3f}", file=sys.stderr)
    figures = {}
    for recipe in recipes:
        mine = [row for key, row in rows.items() if key[0] == recipe]
        figures[recipe] = {c: sum(r[c] for r in mine) / len(mine) for c in COLUMNS if c != "F5_worst"}
        figures[recipe]["F5_worst"] = min(r["F5"] for r in mine)
    title = f"diff3ds text with the built-in prior: {', '.join(chosen.categories)}, {chosen.seeds} seeds"
    show(title, ("recipe", *COLUMNS), [(name, *(row[c] for c in COLUMNS)) for name, row in figures.items()])
    write_json(chosen.folder / "ablations.json", about, figures)
    sheet(chosen.folder / "ablations.png", {r: [rows[r, c, 0]["sketch"] for c in chosen.categories] for r in recipes})


def sheet(path: Path, made: dict[str, list[dict[str, Any]]]) -> None:
    """The sketches of every recipe under its name, two recipes in a row."""
    camera = ds.orbit(VIEW[0], VIEW[1], 2.0, fov=58, size=CELL)
    across = CELL * max(map(len, made.values()))
    picture = Image.new("L", (2 * across, (CELL + TITLE) * ((len(made) + 1) // 2)), 255)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(13)
    for i, (recipe, held) in enumerate(made.items()):
        left, top = i % 2 * across, i // 2 * (CELL + TITLE)
        pen.line((left, top, left + across, top), 200)
        pen.text((left + 6, top + 3), recipe, 0, font)
        for k, tensors in enumerate(held):
            sketch = ds.Sketch(**{name: torch.tensor(value) for name, value in tensors.items()})
            view = (ds.render(sketch, camera).color[0, ..., 0] * 255).byte().numpy()
            picture.paste(Image.fromarray(view), (left + k * CELL, top + TITLE))
    picture.save(path, optimize=True)


if __name__ == "__main__":
    main()
