"""What an eye minds in sketches of phrases: gaps, stubs, doubled lines and kinks, beside the library's own drawings.

    python benchmarks/clean_strokes.py [--seeds 5] [--kinds chair,bus] [--sheet FILE] [--json FILE]

Every kind by the exact prior, as the descent leaves it (`--no-redraw`) and as the results are, and the members
that the prior was given. In parts of the longest side of the box: a gap is an end that misses another stroke by .002 to
.03; a stub is a stroke shorter than .02; a doubled line is a stroke of which more than half runs within .01 beside
another one, by less than 20 degrees; a kink is a turn of more than 60 degrees within .03 inside a segment. Members have
some of these by right (a hem beside a rim), so what counts is how many more a sketch has than the member most like it.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from report import environment, show, write_json
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.bezier import evaluate
from diff3ds.curves.join import join_smooth
from diff3ds.formats import save_png, tile_images
from diff3ds.library import CATEGORIES
from diff3ds.tasks.exact_prior.exemplars import exemplars_of
from diff3ds.tasks.text_image.redraw import nearest_member
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text

SAMPLES = 129
TOUCHES, GAP, STUB = 0.002, 0.03, 0.02
BESIDE, PARALLEL = 0.01, np.cos(np.radians(20))
KINK, WITHIN = np.radians(60), 0.03
KINDS_OF_DEFECT = ("gaps", "stubs", "doubled", "kinks")
CELL = 180


def defects(sketch: ds.Sketch) -> dict[str, int]:
    """Counts them."""
    points = evaluate(sketch.points.double(), sketch.weights.double(), torch.linspace(0, 1, SAMPLES).double()).numpy()
    points /= np.ptp(points.reshape(-1, 3), axis=0).max()
    chains = sketch.chains or ds.Chains.plain(len(sketch))
    of_segment = chains.stroke.numpy()
    steps = np.diff(points, axis=1)
    lengths = np.linalg.norm(steps, axis=-1)
    of_stroke = np.bincount(of_segment, lengths.sum(1))
    tangents = np.gradient(points, axis=1)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=-1, keepdims=True), 1e-12)
    owner = np.repeat(of_segment, SAMPLES)
    flat, directions = points.reshape(-1, 3), tangents.reshape(-1, 3)
    first, last = chains.first[:-1].numpy(), chains.first[1:].numpy() - 1
    gaps, doubled = 0, 0
    for stroke in range(len(chains)):
        others = owner != stroke
        if not others.any():
            continue
        tree = cKDTree(flat[others])
        if not chains.closed[stroke]:
            away, _ = tree.query(np.stack([points[first[stroke], 0], points[last[stroke], -1]]))
            # To the nearest sample of the other stroke; half a step of it is no gap.
            gaps += int(((away > TOUCHES + 0.5 * lengths.max(initial=0)) & (away < GAP)).sum())
        away, near = tree.query(flat[~others])
        along = np.abs((directions[others][near] * directions[~others]).sum(1))
        doubled += bool(((away < BESIDE) & (along > PARALLEL)).mean() > 0.5)
    turned = np.arccos(np.clip((tangents[:, 1:] * tangents[:, :-1]).sum(-1), -1, 1))
    kinks = 0
    for turn, length in zip(turned, lengths, strict=True):
        window = max(1, int(np.searchsorted(np.cumsum(np.full(SAMPLES, max(length.mean(), 1e-6))), WITHIN)))
        kinks += bool(np.convolve(turn, np.ones(min(window, len(turn))), "valid").max() > KINK)
    return {"gaps": gaps, "stubs": int((of_stroke < STUB).sum()), "doubled": doubled, "kinks": kinks}


def runs(kind: str, seed: int) -> dict[str, ds.Sketch]:
    """The sketch as the descent leaves it, as the results are, and the member most like it."""
    phrase = CATEGORIES[kind].captions()[0]
    found = {}
    for name, redraw in (("descent", False), ("result", True)):
        with tempfile.TemporaryDirectory() as folder:
            spec = with_options(RunSpec(Phrase(phrase)), prior="exemplar", seed=seed, sheet_every=0, redraw=redraw)
            found[name] = run_text(spec, Path(folder) / "run")
    meant = exemplars_of(phrase, seed).meant
    found["member"] = join_smooth(meant[nearest_member(found["descent"], meant)]).sketch
    return found


def above(found: dict[str, int], member: dict[str, int]) -> int:
    """How many more defects a sketch has than the member."""
    return sum(max(0, found[name] - member[name]) for name in KINDS_OF_DEFECT)


def main() -> None:
    """Draws them all and shows the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--kinds", type=lambda text: text.split(","), default=list(CATEGORIES))
    parser.add_argument("--sheet", type=Path, help="picture of every kind as found and as drawn again, seed 0")
    parser.add_argument("--json", type=Path, help="file of figures")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    figures: dict[str, Any] = {}
    cells = []
    camera = ds.orbit(35.0, 18.0, 2.0, size=CELL)
    for kind in chosen.kinds:
        rows: list[dict[str, Any]] = []
        for seed in range(chosen.seeds):
            sketches = runs(kind, seed)
            counted = {name: defects(sketch) for name, sketch in sketches.items()}
            rows.append({f"{name}_{what}": n for name, counts in counted.items() for what, n in counts.items()})
            rows[-1] |= {f"{name}_above": above(counted[name], counted["member"]) for name in ("descent", "result")}
            rows[-1] |= {f"{name}_strokes": len(sketch) for name, sketch in sketches.items()}
            if seed == 0:
                cells += [ds.render(sketches[name], camera).color[0] for name in ("descent", "result")]
        figures[kind] = mean(rows)
        print(kind, figures[kind], flush=True)
    figures["all"] = mean(list(figures.values()))
    columns = ("descent_above", "result_above", "descent_strokes", "result_strokes")
    show(
        "Defects above the member's, a sketch",
        ("kind", *columns),
        [(k, *(f[c] for c in columns)) for k, f in figures.items()],
    )
    if chosen.sheet:
        save_png(chosen.sheet, tile_images(torch.stack(cells), columns=10))
    if chosen.json:
        write_json(chosen.json, environment(), figures)


def mean(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Of every column."""
    return {name: sum(row[name] for row in rows) / len(rows) for name in rows[0]}


if __name__ == "__main__":
    main()
