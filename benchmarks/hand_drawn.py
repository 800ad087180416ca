"""Things as people draw them: drawings from a folder, members of the library by a shaky hand, and their pictures.

A drawing is a list of polylines (N, 2), y down, of any size.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np
import torch
from drawn_words import kind_of, nothings
from PIL import Image, ImageDraw
from scipy.spatial import ConvexHull, QhullError

from diff3ds.bezier import evaluate
from diff3ds.library import CATEGORIES, member
from diff3ds.recognition.network import LINE, SIZE, THING

Line = np.ndarray
# Of the drawings of a kind, in an order by chance: so many of thirteen are for the test, so many for validation, the
# rest to train; of more drawings more.
OF, FOR_TEST, FOR_VALIDATION = 13, 3, 2
# Points on a stroke of the library; seeds of the members are none of the recogniser's and of the benchmarks'.
POINTS, FIRST_SEED = 17, 10_000
# Pictures are drawn this much finer and averaged.
FINER = 2


@dataclass(frozen=True, eq=False)
class Drawing:
    """A drawing by a person.

    Attributes:
        kind: what was asked for.
        lines: of it.
        understood: whether the game's own network knew it; None if it did not say.
    """

    kind: str
    lines: list[Line]
    understood: bool | None


def read_drawings(folder: Path) -> dict[str, list[Drawing]]:
    """The drawings of kinds in a folder of files WORD.json, in three parts: "train", "validation" and "test"."""
    parts: dict[str, list[Drawing]] = {"train": [], "validation": [], "test": []}
    for path in sorted(folder.glob("*.json")):
        word = path.stem.replace("_", " ")
        kind = kind_of(word)
        if kind is None:
            continue
        drawings = _drawings_in(path, kind)
        Random(word).shuffle(drawings)
        test, validation = (len(drawings) * count // OF for count in (FOR_TEST, FOR_VALIDATION))
        parts["test"] += drawings[:test]
        parts["validation"] += drawings[test : test + validation]
        parts["train"] += drawings[test + validation :]
    return parts


def read_nothings(folder: Path) -> dict[str, list[Drawing]]:
    """The drawings of what is no kind in a folder of files WORD.json, whole words in one of three parts."""
    files = {path.stem.replace("_", " "): path for path in sorted(folder.glob("*.json"))}
    return {
        part: [drawing for word in words for drawing in _drawings_in(files[word], word)]
        for part, words in nothings(list(files)).items()
    }


def _drawings_in(path: Path, kind: str) -> list[Drawing]:
    entries = json.loads(path.read_text(encoding="utf-8"))
    return [Drawing(kind, [np.array(s, float).T for s in entry["strokes"]], entry["recognized"]) for entry in entries]


def moved(lines: Sequence[Line], chance: np.random.Generator, strength: float = 1.0) -> list[Line]:
    """The lines as a shaky hand draws them: turned, stretched, sheared and bent, strokes beside their place."""
    a, (wide, high) = chance.normal(0, 0.13), np.exp(chance.normal(0, 0.2, 2))
    turn = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
    matrix = turn @ np.diag([wide, high]) @ np.array([[1, chance.normal(0, 0.13)], [0, 1]])
    all_points = np.concatenate(lines)
    low, high_end = all_points.min(0), all_points.max(0)
    side = max(float((high_end - low).max()), 1e-6)
    phase, bend = chance.uniform(0, math.tau, 2), 0.05 * strength * chance.random(2)
    result = []
    for line in lines:
        p = (line - (low + high_end) / 2) / side @ matrix.T
        # Points that lie close together move together.
        spacing = np.linalg.norm(np.diff(p, axis=0), axis=1).mean() if len(p) > 1 else 1.0
        shake = 0.008 * strength * min(1.0, spacing / 0.06)
        p = p + chance.normal(0, 0.02 * strength, 2) + chance.normal(0, shake, p.shape)
        p = (p - p.mean(0)) * (1 + chance.normal(0, 0.06 * strength)) + p.mean(0)
        result.append(p + bend * np.sin(4.2 * p[:, ::-1] + phase))
    return result


def worn(lines: list[Line], chance: np.random.Generator) -> list[Line]:
    """Strokes may be missing, have gaps or end early."""
    if len(lines) > 2 and chance.random() < 0.35:
        lengths = np.array([np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines])
        # The longest is what makes the thing.
        gone = int(chance.choice(np.delete(np.arange(len(lines)), lengths.argmax())))
        lines = lines[:gone] + lines[gone + 1 :]
    kept = []
    for line in lines:
        if len(line) > 5 and chance.random() < 0.08:
            cut = int(chance.integers(1, len(line) - 1))
            kept += [line[:cut], line[cut + 1 :]]
        elif len(line) > 4 and chance.random() < 0.1:
            kept.append(line[: -int(chance.integers(1, max(2, len(line) // 6 + 1)))])
        else:
            kept.append(line)
    return [line for line in kept if len(line) > 1]


def cluttered(lines: list[Line], others: Sequence[Line], chance: np.random.Generator) -> list[Line]:
    """Something small beside the thing, or ground under it."""
    p = np.concatenate(lines)
    low, high = p.min(0), p.max(0)
    if chance.random() < 0.4:
        y = high[1] + chance.normal(0, 0.03)
        x = np.linspace(low[0] - chance.random() * 0.3, high[0] + chance.random() * 0.3, 9)
        return [*lines, np.column_stack([x, y + chance.normal(0, 0.01, 9)])]
    other = others[int(chance.integers(len(others)))]
    side = max(float(np.ptp(other, axis=0).max()), 1e-6)
    small = (other - other.mean(0)) / side * chance.uniform(0.08, 0.3)
    at = np.array([chance.choice([low[0] - 0.1, high[0] + 0.1]), chance.uniform(low[1], high[1])])
    return [*lines, small + at]


def picture_of(lines: Sequence[Line], chance: np.random.Generator | None = None) -> np.ndarray:
    """A picture (S, S) of ink in [0, 1], as `recognition.network.picture_of` draws lines that it has found."""
    points = np.concatenate(lines)
    low, high = points.min(0), points.max(0)
    wide = 1.0 if chance is None else chance.uniform(0.8, 1.4)
    scale = (
        SIZE * THING * (1.0 if chance is None else chance.uniform(0.94, 1.03)) / max(float((high - low).max()), 1e-6)
    )
    image = Image.new("L", (SIZE * FINER,) * 2)
    pen = ImageDraw.Draw(image)
    for line in lines:
        at = ((line - (low + high) / 2) * scale + SIZE / 2) * FINER
        # Where points lie close together, joints need no rounding, which takes time.
        width, joint = max(1, round(LINE * SIZE * FINER * wide)), "curve" if len(line) < 8 else None
        pen.line([tuple(p) for p in at], 255, width, joint)
    return np.asarray(image.reduce(FINER), np.float32) / 255


@dataclass(frozen=True, eq=False)
class Seen:
    """A member of the library from somewhere, as a person might draw it."""

    kind: str
    lines: list[Line]
    azimuth: float
    elevation: float


class Pool:
    """Members of kinds, so many of each, as points along their strokes."""

    def __init__(self, each: int, kinds: Sequence[str]) -> None:
        """Draws them."""
        t = torch.linspace(0, 1, POINTS)
        self.members: dict[str, list[np.ndarray]] = {}
        for name in kinds:
            combinations = CATEGORIES[name].combinations()
            self.members[name] = []
            for i in range(each):
                chosen = combinations[0] if i % 3 == 0 else combinations[i % len(combinations)]
                sketch = member(name, torch.Generator().manual_seed(FIRST_SEED + i), chosen).sketch
                self.members[name].append(evaluate(sketch.points, sketch.weights, t).numpy().astype(float))

    def drawn(self, chance: np.random.Generator) -> Seen:
        """One of them; half are seen from where people draw things, some have no hidden lines."""
        kind = str(chance.choice(list(self.members)))
        strokes = self.members[kind][int(chance.integers(len(self.members[kind])))]
        azimuth, elevation = chance.uniform(0, 360), chance.uniform(0, 32)
        if chance.random() < 0.4:
            azimuth = float(chance.choice([0.0, 0.0, 90.0, 90.0, 270.0, 270.0, 40.0, 320.0])) + chance.normal(0, 6)
            elevation = abs(chance.normal(0, 8))
        flat, depth = seen_from(strokes, azimuth, elevation, float(chance.choice([1.9, 1.9, 2.5, 5.0])))
        lines = list(flat)
        if chance.random() < 0.4:
            lines = without_hidden(flat, depth, chance)
        if chance.random() < 0.7:
            lines = worn(moved(lines, chance, chance.uniform(0, 1)), chance) or list(flat)
        return Seen(kind, lines, azimuth % 360, elevation)


def seen_from(strokes: np.ndarray, azimuth: float, elevation: float, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, P, 2) as the library's cameras see them, y down, and their depths (N, P)."""
    a, e = math.radians(azimuth), math.radians(elevation)
    towards = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    down = -np.cross(towards, right)
    depth = distance - strokes @ towards
    return np.stack([strokes @ right, strokes @ down], -1) / depth[..., None], depth


def without_hidden(flat: np.ndarray, depth: np.ndarray, chance: np.random.Generator) -> list[Line]:
    """The strokes without those parts that lie behind the rest and inside its outline: about what a solid hides."""
    try:
        hull = ConvexHull(flat.reshape(-1, 2))
    except QhullError:
        return list(flat)
    back = np.quantile(depth, chance.uniform(0.4, 0.75))
    inside = (flat @ hull.equations[:, :2].T + hull.equations[:, 2]).max(-1) < -0.04 * np.ptp(flat, axis=(0, 1)).max()
    hidden = (depth > back) & inside
    lines = []
    for line, gone in zip(flat, hidden, strict=True):
        ends = np.flatnonzero(np.diff(np.concatenate([[1], gone, [1]])))
        lines += [line[a:b] for a, b in zip(ends[::2], ends[1::2], strict=True) if b - a > 1]
    return lines or list(flat)


def chimera(drawings: Sequence[Drawing], chance: np.random.Generator) -> list[Line]:
    """Strokes of several drawings, thrown on paper: by a person's hand, and nothing."""
    lines = []
    for _ in range(chance.integers(2, 7)):
        one = drawings[int(chance.integers(len(drawings)))].lines
        line = one[int(chance.integers(len(one)))]
        side = max(float(np.ptp(line, axis=0).max()), 1.0)
        a = chance.uniform(0, math.tau)
        turn = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
        lines.append((line - line.mean(0)) / side @ turn.T * chance.uniform(0.2, 1) + chance.normal(0, 0.35, 2))
    return lines
