"""Drawings by people: how many are recognised, taken, and taken for something else; and drawings of nothing known.

    python benchmarks/drawings_by_people.py FOLDER [--icons ICONS] [--part test] [--sheet FILE] [--json FILE]

FOLDER holds the drawings, KIND.json each, ICONS icons: docs/reference/recognition.md says from where. Those of the test
have had no part in training or choosing; neither have the doodles. All are drawn black on white, 4 pixels wide, on
460 x 460, and read as `diff3ds image` reads a file.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from doodles import DOODLES, FOR_TEST, FOR_VALIDATION
from hand_drawn import Line, moved, read_drawings
from icons import read_icons
from PIL import Image, ImageDraw
from report import environment, show, write_json
from symbols_wishes import is_doodle

import diff3ds as ds
from diff3ds.recognition.network import trained

SIZE, WIDTH, MARGIN = 460, 4, 30
# Drawings of nothing that is known, and the seed that bends them.
NOTHING, SEED = 200, 4000
# Of the sheet: pixels, columns.
CELL, ACROSS = 110, 12


def drawn(lines: list[Line]) -> np.ndarray:
    """A picture of lines, uint8."""
    points = np.concatenate(lines)
    low, high = points.min(0), points.max(0)
    scale = (SIZE - 2 * MARGIN) / max(float((high - low).max()), 1e-6)
    image = Image.new("L", (SIZE, SIZE), 255)
    pen = ImageDraw.Draw(image)
    for line in lines:
        pen.line([tuple(p) for p in (line - (low + high) / 2) * scale + SIZE / 2], 0, WIDTH, joint="curve")
    return np.asarray(image)


def doodles(part: str) -> Iterator[tuple[str, np.ndarray]]:
    """Names and pictures of so many doodles that are none of the recogniser's kinds."""
    chance = np.random.default_rng(SEED)
    known = trained().kinds
    names = [name for name in (FOR_TEST if part == "test" else FOR_VALIDATION) if is_doodle(name, known)]
    for i in range(NOTHING):
        name = names[i % len(names)]
        yield name, drawn(moved(DOODLES[name](chance), chance))


def icons(folder: Path, part: str) -> Iterator[tuple[str, np.ndarray]]:
    """So many icons that are none of the recogniser's kinds."""
    read = read_icons(folder, trained().kinds)[part]
    for i in np.random.default_rng(SEED).choice(len(read), NOTHING, replace=False):
        fine = Image.fromarray(255 - read[i]).resize((SIZE, SIZE), Image.Resampling.BILINEAR)
        yield f"icon {i}", np.asarray(fine)


def answer(picture: np.ndarray) -> dict[str, Any]:
    """What is recognised."""
    try:
        found = ds.recognise(picture)
    except ValueError as error:
        return {"guesses": [], "taken": False, "error": str(error)}
    return {"guesses": [(guess.kind, round(guess.confidence, 3)) for guess in found.guesses], "taken": found.taken}


def shares(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Of drawings of known kinds."""
    first = [bool(row["guesses"]) and row["guesses"][0][0] == row["kind"] for row in rows]
    three = [row["kind"] in [kind for kind, _ in row["guesses"]] for row in rows]
    taken = [row["taken"] for row in rows]
    wrong = sum(t and not f for t, f in zip(taken, first, strict=True))
    return {
        "drawings": len(rows), "first": float(np.mean(first)), "among_three": float(np.mean(three)),
        "taken": float(np.mean(taken)), "wrong_among_taken": wrong / max(sum(taken), 1),
    }  # fmt: skip


def sheet(path: Path, cells: list[tuple[np.ndarray, dict[str, Any]]]) -> None:
    """Every picture with what it is taken for, in brackets where it is not taken."""
    image = Image.new("L", (ACROSS * CELL, -(-len(cells) // ACROSS) * (CELL + 14)), 255)
    pen = ImageDraw.Draw(image)
    for i, (picture, row) in enumerate(cells):
        x, y = i % ACROSS * CELL, i // ACROSS * (CELL + 14)
        image.paste(Image.fromarray(picture).resize((CELL, CELL), Image.Resampling.BOX), (x, y))
        kind, sure = row["guesses"][0] if row["guesses"] else ("?", 0)
        said = f"{kind} {sure:.0%}"
        pen.text((x + 4, y + CELL), said if row["taken"] else f"({said})", 0)
    image.save(path, optimize=True)


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--icons", type=Path, help="folder of icons, which are counted too")
    parser.add_argument("--part", choices=("validation", "test"), default="test")
    parser.add_argument("--sheet", type=Path, help="picture of all drawings with what they are taken for")
    parser.add_argument("--json", type=Path, help="file of figures")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    rows, nothing, cells, begun = [], [], [], time.process_time()
    for drawing in read_drawings(chosen.folder)[chosen.part]:
        picture = drawn(drawing.lines)
        rows.append({"kind": drawing.kind, "understood": drawing.understood, **answer(picture)})
        cells.append((picture, rows[-1]))
        if not (rows[-1]["guesses"] and rows[-1]["guesses"][0][0] == drawing.kind and rows[-1]["taken"]):
            print(rows[-1], file=sys.stderr)
    for name, picture in (*doodles(chosen.part), *(icons(chosen.icons, chosen.part) if chosen.icons else ())):
        nothing.append({"name": name, **answer(picture)})
        cells.append((picture, nothing[-1]))
        if nothing[-1]["taken"]:
            print(nothing[-1], file=sys.stderr)
    seconds = (time.process_time() - begun) / len(cells)
    figures: dict[str, Any] = {
        "all": shares(rows),
        "understood": shares([row for row in rows if row["understood"] is True]),
    }
    show(
        "Drawings by people",
        ("drawings", *next(iter(figures.values()))),
        [(n, *f.values()) for n, f in figures.items()],
    )
    for name, group in (("doodles", nothing[:NOTHING]), ("icons", nothing[NOTHING:])):
        taken = [f"{row['name']}: {row['guesses'][0][0]}" for row in group if row["taken"]]
        figures[name] = {"of": len(group), "taken": len(taken), "which": taken}
        show(name, ("pictures", "taken", "which"), [(len(group), len(taken), ", ".join(taken))])
    if chosen.sheet:
        sheet(chosen.sheet, cells)
    if chosen.json:
        by_kind = {
            kind: shares([row for row in rows if row["kind"] == kind]) for kind in sorted({r["kind"] for r in rows})
        }
        figures = {"part": chosen.part, **figures, "processor_seconds_each": seconds, "by_kind": by_kind}
        before = json.loads(chosen.json.read_text())["figures"] if chosen.json.exists() else {}
        about = environment()
        write_json(chosen.json, about, {**before, "after": {"commit": about["commit"], **figures}})


if __name__ == "__main__":
    main()
