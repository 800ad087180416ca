"""The gallery: a sketch of every category by a built-in prior, its turntable, and one sheet of them all.

    python benchmarks/gallery.py FOLDER [--prior exemplar|small] [--only chair,mug] [--seed N] [--runs RUNS]

Runs go side by side, one a core. RUNS is the folder of runs that categories.py made, which are then not made again.
Writes NAME.json and NAME.webp for each, sheet.png, and gallery.json with figures:
F-scores at 5 and 2 % of the size against the nearest member that the phrase means, strokes and seconds.
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

import torch
from distill import scores
from PIL import Image
from report import environment, show, write_json

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.formats import save_png, tile_images
from diff3ds.library import CATEGORIES
from diff3ds.tasks.exact_prior.exemplars import exemplars_of
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text

FRAMES, FRAME_SIZE, FRAME_MS, QUALITY = 24, 128, 120, 40
# Of the sheet: two views of each.
VIEWS, CELL = (35.0, 125.0), 160


def sketched(phrase: str, category: str, chosen: argparse.Namespace) -> tuple[ds.Sketch, float]:
    """The sketch of a phrase, and the seconds that it took."""
    if chosen.runs is not None:
        held = json.loads((chosen.runs / f"{category.replace(' ', '_')}-{chosen.seed}.json").read_text())
        points, weights = (torch.tensor(held["sketch"][name]) for name in ("points", "weights"))
        return ds.Sketch(points, weights), held["seconds"]
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as run:
        spec = with_options(RunSpec(Phrase(phrase)), prior=chosen.prior, seed=chosen.seed, sheet_every=0)
        sketch = run_text(spec, Path(run) / "run")
    return sketch, time.perf_counter() - begun


def draw(category: str, chosen: argparse.Namespace) -> dict[str, Any]:
    """One sketch with its files; its figures."""
    torch.set_num_threads(1)
    ds.set_num_threads(1)
    folder, seed, phrase = chosen.folder, chosen.seed, CATEGORIES[category].captions()[0]
    sketch, seconds = sketched(phrase, category, chosen)
    name = category.replace(" ", "_")
    ds.save(folder / f"{name}.json", sketch)
    turntable(sketch, folder / f"{name}.webp")
    known = exemplars_of(phrase, seed)
    fitting = [m for m, fits in zip(known.members, known.fitting, strict=True) if fits]
    best = min((scores(sketch, m) for m in fitting), key=lambda found: found["chamfer_percent"])
    return {"phrase": phrase, **best, "strokes": len(sketch), "seconds": seconds}


def turntable(sketch: ds.Sketch, path: Path) -> None:
    """An animation of the sketch turning."""
    azimuths = [360 * i / FRAMES for i in range(FRAMES)]
    images = ds.render(sketch, ds.orbit(azimuths, 18, 2.0, fov=58, size=FRAME_SIZE)).color
    frames = [Image.fromarray((image * 255).round().to(torch.uint8).numpy()) for image in images]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=QUALITY)


def main() -> None:
    """Draws them all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", type=lambda text: text.split(","), help="kinds, by default all that the prior knows")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--prior", choices=("exemplar", "small"), default="exemplar")
    parser.add_argument("--runs", type=Path)
    chosen = parser.parse_args()
    chosen.only = chosen.only or list(trained().kinds if chosen.prior == "small" else CATEGORIES)
    chosen.folder.mkdir(parents=True, exist_ok=True)
    about, figures = environment(), {}
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        waiting = {name: pool.submit(draw, name, chosen) for name in chosen.only}
        for name, job in waiting.items():
            figures[name] = job.result()
            print(
                name, {k: v if isinstance(v, str) else round(v, 3) for k, v in figures[name].items()}, file=sys.stderr
            )
    cameras = ds.orbit(list(VIEWS), 18, 2.0, fov=58, size=CELL)
    sketches = [ds.load(chosen.folder / f"{name.replace(' ', '_')}.json") for name in chosen.only]
    views = torch.cat([ds.render(sketch, cameras).color for sketch in sketches])
    save_png(chosen.folder / "sheet.png", tile_images(views, columns=10))
    columns = ("F5", "F2", "chamfer_percent", "strokes", "seconds")
    show("Gallery", ("category", *columns), [(n, *(row[c] for c in columns)) for n, row in figures.items()])
    write_json(chosen.folder / "gallery.json", about, figures)


if __name__ == "__main__":
    main()
