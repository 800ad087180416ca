"""How well members of the library follow drawings by people: before and after they are bent towards them.

    python benchmarks/follow_drawings.py FOLDER [--part test] [--sheet FILE] [--json FILE]

FOLDER as of drawings_by_people.py; those that were understood count. The kind is told, the pose found. Figures, in
pictures of 256 pixels from the side that was found: F-score at 3 pixels of the strokes against the drawing's lines, and
recall, which hidden lines do not lower: how much of the drawing has a stroke. Medians, means and worst.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import torch
from drawings_by_people import drawn
from hand_drawn import read_drawings
from PIL import Image
from report import environment, show, write_json
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.bezier import evaluate
from diff3ds.library import CATEGORIES
from diff3ds.pictures.reading.array import picture_of_array
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.bend import bend_to, seen_by
from diff3ds.recognition.picture_lines import lines_of
from diff3ds.recognition.recognise import seen_as
from diff3ds.recognition.side_seen import PlacedLines, alike, gap, placed_over
from diff3ds.tasks.exact_prior.exemplars import FITTING

SIZE, NEAR, SAMPLES = 256, 3, 33
# Of the sheet.
CELL, ACROSS = 120, 4


def against(sketch: ds.Sketch, lines: PlacedLines) -> tuple[float, float]:
    """F-score and recall."""
    t = torch.linspace(0, 1, SAMPLES, dtype=torch.float64)
    places = evaluate(sketch.points.double(), sketch.weights.double(), t).flatten(0, 1)
    seen = seen_by(places, lines.camera)[0].numpy()
    recall = float((cKDTree(seen).query(lines.points)[0] < NEAR / SIZE).mean())
    precision = float((cKDTree(lines.points).query(seen)[0] < NEAR / SIZE).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9), recall


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--part", choices=("validation", "test"), default="test")
    parser.add_argument("--sheet", type=Path, help="picture: drawing, member, bent member, and from another side")
    parser.add_argument("--json", type=Path, help="file of figures")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    rows: list[dict[str, Any]] = []
    tiles = []
    for drawing in read_drawings(chosen.folder)[chosen.part]:
        if drawing.understood is not True:
            continue
        picture = drawn(drawing.lines)
        lines = lines_of(read_reference(picture_of_array(picture)))
        found = seen_as(lines, drawing.kind)
        members = [m.sketch for m in alike(lines, found.kind, found.attributes, found.camera, FITTING)]
        placed = placed_over(lines, members[0], found.camera)
        bent = [bend_to(member, placed, CATEGORIES[drawing.kind].mirror == "y").sketch(member) for member in members]
        best = min(bent, key=lambda member: gap(lines, member, found.camera))
        before, after = against(members[0], placed), against(best, placed)
        rows.append(
            {"kind": drawing.kind, "F": before[0], "recall": before[1], "F_bent": after[0], "recall_bent": after[1]}
        )
        other = ds.orbit(found.azimuth + 50, 20.0, 2.0, size=CELL)
        small = np.asarray(Image.fromarray(picture).resize((CELL, CELL), Image.Resampling.BOX))
        views = [(members[0], found.camera.resize(CELL)), (best, found.camera.resize(CELL)), (best, other)]
        cells = [ds.render(s, c).color[0].mean(-1).mul(255).byte().numpy() for s, c in views]
        tiles.append(np.concatenate([small, *cells], 1))
    columns = ("F", "F_bent", "recall", "recall_bent")
    values = {name: np.array([row[name] for row in rows]) for name in columns}
    figures: dict[str, Any] = {"drawings": len(rows)}
    for name, column in values.items():
        figures[name] = {"mean": float(column.mean()), "median": float(np.median(column)), "worst": float(column.min())}
    show(
        "Members that follow drawings",
        ("figure", "mean", "median", "worst"),
        [(n, *figures[n].values()) for n in columns],
    )
    if chosen.sheet:
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % ACROSS)
        sheet = np.concatenate([np.concatenate(tiles[i : i + ACROSS], 1) for i in range(0, len(tiles), ACROSS)])
        Image.fromarray(sheet).save(chosen.sheet, optimize=True)
    if chosen.json:
        write_json(chosen.json, environment(), {**figures, "rows": rows})


if __name__ == "__main__":
    main()
