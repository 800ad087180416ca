"""Drawings by people that had no part in training: they choose the least probability that is taken, and test it.

    python benchmarks/fresh_drawings.py FRESH FOLDER

FOLDER is that of train_recognition.py, FRESH holds other drawings of the same words and of what is no kind, as Quick,
Draw! publishes them, WORD.ndjson each: docs/reference/recognition.md says from where. Every second drawing of a kind
and the words of what is nothing that validation has choose; the others and the words of the test are what is counted.
Drawings whose strokes begin and end where one in FOLDER has them are left out. All are drawn as the studio's canvas is.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from drawn_words import kind_of, nothings
from report import show
from train_recognition import chosen_threshold, thresholds

from diff3ds.recognition.network import trained
from diff3ds.recognition.picture_lines import lines_of
from diff3ds.tasks.studio.drawn import as_reference

# What files in FOLDER are named that are not named as their word; drawings of each word that is nothing.
NAMES = {"wine bottle": "bottle", "floor lamp": "lamp", "couch": "sofa", "eyeglasses": "glasses"}
OF_NOTHING = 8
# Units of the drawings, of 255, by which ends of strokes may differ that are the same.
SAME = 2
Stroke = list[list[float]]


def ends(drawing: list[Stroke]) -> np.ndarray:
    """Where strokes begin and end."""
    return np.array([[x[0], y[0], x[-1], y[-1]] for x, y, *_ in drawing], float)


def is_known(drawing: list[Stroke], known: list[np.ndarray]) -> bool:
    """Whether it is one of these, whose ends are known."""
    own = ends(drawing)
    return any(own.shape == other.shape and bool((np.abs(own - other) <= SAME).all()) for other in known)


def read(path: Path) -> list[list[Stroke]]:
    """The drawings of a file that the game understood."""
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip())
    return [row["drawing"] for row in rows if row["recognized"]]


def opinions(drawings: list[tuple[str, list[Stroke]]]) -> tuple[torch.Tensor, torch.Tensor]:
    """Logarithms of what the network makes of drawings, and which of its kinds they are of."""
    network = trained()
    likely = []
    for _, drawing in drawings:
        strokes = [np.array(stroke[:2], float).T.tolist() for stroke in drawing]
        likely.append(network.opinion(lines_of(as_reference(strokes))).kinds.log())
    kinds = [network.kinds.index(kind) if kind else len(network.kinds) for kind, _ in drawings]
    return torch.stack(likely), torch.tensor(kinds)


def figures(drawings: list[tuple[str, list[Stroke]]], threshold: float) -> tuple[Any, ...]:
    """How many, and the shares that are named first, among three and five, taken, and of these wrong."""
    likely, kinds = opinions(drawings)
    named = likely[:, :-1].topk(5, 1).indices == kinds[:, None]
    taken = likely[:, :-1].max(1).values.exp() >= threshold
    shares = (named[:, :n].any(1).float().mean() for n in (1, 3, 5))
    wrong = (~named[taken, 0]).float().mean()
    return len(drawings), *(round(float(share), 3) for share in (*shares, taken.float().mean(), wrong))


def main() -> None:
    """Chooses and measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fresh", type=Path)
    parser.add_argument("folder", type=Path)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    known = {
        path.stem.replace("_", " "): [ends(entry["strokes"]) for entry in json.loads(path.read_text(encoding="utf-8"))]
        for path in chosen.folder.glob("*.json")
    }
    drawings: list[tuple[str, list[Stroke]]] = []
    nothing = {}
    for path in sorted(chosen.fresh.glob("*.ndjson")):
        kind = NAMES.get(path.stem, path.stem)
        if kind in known:
            drawings += [(kind, drawing) for drawing in read(path) if not is_known(drawing, known[kind])]
        elif kind_of(path.stem) is None:
            nothing[path.stem] = read(path)[:OF_NOTHING]
    words = nothings([*nothing])
    none = {part: [("", drawing) for word in words[part] for drawing in nothing[word]] for part in words}
    likely, kinds = opinions([*drawings[::2], *none["validation"]])
    threshold = chosen_threshold(thresholds(likely, kinds, kinds < len(trained().kinds)))
    print(f"the threshold that is chosen: {threshold:.2f}; that of the network: {trained().threshold:.2f}")
    rows = {"chose": drawings[::2], "test": drawings[1::2], "nothing": none["test"]}
    heads = ("drawings", "of", "first", "among three", "among five", "taken", "wrong among them")
    show("Fresh drawings", heads, [(name, *figures(part, trained().threshold)) for name, part in rows.items()])


if __name__ == "__main__":
    main()
