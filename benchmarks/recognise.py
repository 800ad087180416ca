"""Pictures of the library's things: whether what they show is recognised, and how near the sketches made of them are.

    python benchmarks/recognise.py recognised [--each 2] [--json FILE]
    python benchmarks/recognise.py sketches [--only chair,mug] [--weights 0,3000] [--keep FOLDER] [--json FILE]
    python benchmarks/recognise.py confidence [--each 3] [--json FILE]

The things are members of seeds that the recogniser has not, plain or with one attribute, seen from random sides
between 0 and 30 degrees of elevation. Pictures have 512 pixels, lines of the default width. Solid things are seen
without their hidden lines too, from at most 75 degrees beside the front, and shapes that are no thing. `sketches
--keep FOLDER` leaves the runs there, and sheet.png: the drawing, the sketch as seen from there, and from beside.
"""

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import torch
from distill import points_on, scores
from other_drawings import SHAPES, SOLIDS, shape_drawing, solid_drawing
from PIL import Image, ImageDraw, ImageFont
from report import environment, show, write_json
from scipy.optimize import minimize
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.formats import save_png
from diff3ds.library import CATEGORIES, member
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.network import trained
from diff3ds.recognition.picture_lines import Lines, lines_of
from diff3ds.recognition.recognise import Guess, recognise
from diff3ds.recognition.side_seen import DISTANCE, LEAST_CONFIDENCE, Match, described, gap_to, seen_from, table
from diff3ds.tasks.text_image.image import run_image
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Picture

# Of the first member; the recogniser's tables and pools have seeds below 100.
FIRST_SEED, SIZE = 1000, 512


@dataclass(frozen=True)
class Condition:
    """How a picture differs from a rendering.

    Attributes:
        jitter: standard deviation of what moves every control point by itself; the things have a radius of .95.
        noise: of what every channel of every pixel is changed by.
        missing: share of the strokes.
        distance: of the camera; the recogniser's tables have 1.9.
        stretch: most by which height differs from width.
    """

    jitter: float = 0.0
    noise: float = 0.0
    missing: float = 0.0
    distance: float = DISTANCE
    stretch: float = 0.0


CONDITIONS = {
    "plain": Condition(),
    "noise": Condition(noise=0.1),
    "jitter": Condition(jitter=0.02),
    "much jitter and noise": Condition(jitter=0.03, noise=0.1),
    "all, other perspective": Condition(jitter=0.03, noise=0.1, missing=0.15, distance=4.0, stretch=0.15),
}
# Solid things without their hidden lines: whether their outline is drawn.
HIDDEN = {"hidden lines removed": False, "the same, outlined": True}
FRONT = 75.0
# A pose is found if it is this near, degrees, or if the thing looks the same from there: many things look alike from
# several sides. Its lines as seen from both are then this near: mean distance both ways, percent of the longer side of
# their box. In the median, lines whose control points are moved by .03 lie .7 from where they were, and those seen from
# 15 degrees beside 1.2.
NEAR, SAME = 15.0, 0.75
# Of the sheet of sketches: how far beside the picture's view the other one is, degrees; pixels.
BESIDE, CELL, HEADING = 70.0, 132, 22


@dataclass(frozen=True, eq=False)
class Shown:
    """One thing in one picture."""

    category: str
    attributes: tuple[str, ...]
    azimuth: float
    elevation: float
    sketch: ds.Sketch
    picture: torch.Tensor


def things(each: int, condition: str, first_seed: int = FIRST_SEED) -> Iterator[Shown]:
    """So many of every kind that is recognised."""
    draw, how = Random(first_seed), CONDITIONS[condition]
    for seed in range(first_seed, first_seed + each):
        for i, name in enumerate(trained().kinds):
            attributes = draw.choice([(), *((a.name,) for a in CATEGORIES[name].attributes)])
            azimuth, elevation = draw.uniform(0, 360), draw.uniform(0, 30)
            sketch = member(name, torch.Generator().manual_seed(seed), attributes).sketch
            tall = 1 + how.stretch * draw.uniform(-1, 1)
            chance = torch.Generator().manual_seed(1000 * seed + i)
            moved = replace(
                sketch, points=sketch.points + how.jitter * torch.randn(sketch.points.shape, generator=chance)
            )
            left = moved[torch.rand(len(moved), generator=chance) >= how.missing]
            camera = ds.orbit(azimuth, elevation, how.distance, size=SIZE)
            higher = torch.tensor([[1.0, 1.0, 1.0], [1.0, tall, 1.0], [1.0, 1.0, 1.0]])
            camera = replace(camera, intrinsics=camera.intrinsics * higher)
            picture = ds.render(left, camera).color[0]
            picture = picture + how.noise * torch.randn(picture.shape, generator=chance)
            yield Shown(name, attributes, azimuth, elevation, sketch, picture.clamp(0, 1))


def solids(each: int, condition: str, first_seed: int = FIRST_SEED) -> Iterator[Shown]:
    """So many of every kind that is solid, without the lines that it hides."""
    draw = Random(first_seed)
    for seed in range(first_seed, first_seed + each):
        for name, attributes in SOLIDS:
            azimuth, elevation = draw.uniform(-FRONT, FRONT) % 360, draw.uniform(0, 30)
            sketch = member(name, torch.Generator().manual_seed(seed), attributes).sketch
            picture = solid_drawing(sketch, ds.orbit(azimuth, elevation, DISTANCE, size=SIZE), HIDDEN[condition])
            yield Shown(name, attributes, azimuth, elevation, sketch, picture)


def pictures_of(condition: str, each: int, first_seed: int = FIRST_SEED) -> Iterator[Shown]:
    """Those of a condition."""
    return (solids if condition in HIDDEN else things)(each, condition, first_seed)


def lines_in(picture: torch.Tensor) -> Lines:
    """As `diff3ds image` reads a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        save_png(path, picture)
        return lines_of(read_reference(path))


def pose_found(shown: Shown, found: Guess) -> tuple[bool, bool]:
    """Whether the pose is near, and whether it is near or the thing looks the same from there."""
    apart = abs((found.azimuth - shown.azimuth + 180) % 360 - 180)
    near = apart <= NEAR and abs(found.elevation - shown.elevation) <= NEAR
    poses = ((shown.azimuth, shown.elevation), (found.azimuth, found.elevation))
    there, here = (seen_points(shown.sketch, ds.orbit(a, e, DISTANCE, size=SIZE)) for a, e in poses)
    both = cKDTree(there).query(here)[0].mean() + cKDTree(here).query(there)[0].mean()
    return near, near or bool(50 * both / np.ptp(there, axis=0).max() <= SAME)


def seen_points(sketch: ds.Sketch, camera: ds.Cameras) -> np.ndarray:
    """Points along the strokes in pixels (N, 2)."""
    points = points_on(sketch)
    seen = np.column_stack([points, np.ones(len(points))]) @ camera.projection[0, :3].numpy().T
    return seen[:, :2] / seen[:, 2:]


def recognised(chosen: argparse.Namespace) -> dict[str, Any]:
    """Shares of category, attributes and pose that are found, and of what the threshold lets through."""
    begun = time.perf_counter()
    for name in trained().kinds:
        table(name)
    figures: dict[str, Any] = {"seconds_of_the_tables": time.perf_counter() - begun, "conditions": {}}
    for condition in (*CONDITIONS, *HIDDEN):
        rows, begun = [], time.perf_counter()
        for shown in pictures_of(condition, chosen.each):
            recognition = recognise(lines_in(shown.picture))
            found, sure = recognition.guesses[0], recognition.taken
            right = found.kind == shown.category
            near, same = pose_found(shown, found)
            if not (right and same and sure):
                print(condition, shown.category, shown.attributes, round(shown.azimuth), "->", found, file=sys.stderr)
            rows.append((right, right and found.attributes == shown.attributes, right and near, right and same,
                         sure, sure and not right))  # fmt: skip
        shares = torch.tensor(rows).float().mean(0).tolist()
        names = ("category", "and_attributes", "and_pose", "and_pose_or_looks_the_same", "taken", "taken_but_wrong")
        figures["conditions"][condition] = {
            **dict(zip(names, shares, strict=True)),
            "pictures": len(rows),
            "seconds_each": (time.perf_counter() - begun) / len(rows),
        }
    columns = tuple(next(iter(figures["conditions"].values())))
    show("Shares of the pictures in which what they show is recognised", ("pictures", *columns),
         [(name, *row.values()) for name, row in figures["conditions"].items()])  # fmt: skip
    return {**figures, "shapes": shapes_taken(2 * chosen.each)}


def shapes_taken(each: int) -> dict[str, Any]:
    """Shapes that are no thing: how many of each are taken for one, and for which."""
    chance, figures = np.random.default_rng(FIRST_SEED), {}
    for name in SHAPES:
        drawn = [shape_drawing(name, how) for how in (None, *[chance] * (each - 1))]
        found = [recognise(lines_in(picture)) for picture in drawn]
        taken = [f"{one.guesses[0].kind} ({one.guesses[0].confidence:.2f})" for one in found if one.taken]
        figures[name] = {"of": each, "taken_for": taken}
    show("Shapes that are no thing", ("shape", "taken for", "of"),
         [(name, ", ".join(row["taken_for"]), each) for name, row in figures.items()])  # fmt: skip
    return figures


def sketches(chosen: argparse.Namespace) -> dict[str, Any]:
    """F-scores of the sketches made of pictures, and their error in the picture's view."""
    figures: dict[str, Any] = {}
    for condition in chosen.conditions:
        for weight in chosen.weights:
            rows = {}
            for shown in things(1, condition):
                if shown.category in chosen.only:
                    keep = chosen.keep and chosen.keep / f"{condition}, weight {weight:g}"
                    rows[shown.category] = sketched(shown, weight, keep)
                    print(condition, weight, shown.category, rows[shown.category], file=sys.stderr)
            made = [row for row in rows.values() if row]
            means = {name: sum(row[name] for row in made) / len(made) for name in made[0]}
            figures[f"{condition}, weight {weight:g}"] = {"refused": len(rows) - len(made), "mean": means, **rows}
    columns = ("F5", "F2", "chamfer_percent", "view_error", "view_F5", "view_chamfer_percent", "seconds", "strokes")
    show("Sketches of pictures", ("pictures", "refused", *columns),
         [(name, row["refused"], *(row["mean"][c] for c in columns)) for name, row in figures.items()])  # fmt: skip
    if chosen.keep:
        sheet(chosen)
    return figures


def sheet(chosen: argparse.Namespace) -> None:
    """Of every condition three columns: the drawing, the sketch from its side, and from beside; a row for each thing.

    With the first of the weights.
    """
    titles = ("the drawing", "sketch, same side", f"{BESIDE:.0f}° beside")
    across = len(titles) * CELL
    picture = Image.new("L", (across * len(chosen.conditions), CELL * len(chosen.only) + 2 * HEADING), 255)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(12)
    for i, condition in enumerate(chosen.conditions):
        folder = chosen.keep / f"{condition}, weight {chosen.weights[0]:g}"
        left = i * across
        pen.text((left + across / 2, 4), condition, 0, font, anchor="ma")
        for k, title in enumerate(titles):
            pen.text((left + (k + 0.5) * CELL, HEADING + 4), title, 0, font, anchor="ma")
        things_there = [shown for shown in things(1, condition) if shown.category in chosen.only]
        for j, shown in enumerate(things_there):
            top = 2 * HEADING + j * CELL
            drawing = Image.fromarray((shown.picture * 255).byte().numpy()).convert("L")
            picture.paste(drawing.resize((CELL, CELL), Image.Resampling.BOX), (left, top))
            if (folder / shown.category / "sketch.json").exists():
                sides = [shown.azimuth, shown.azimuth + BESIDE]
                cameras = ds.orbit(sides, shown.elevation, DISTANCE, size=CELL)
                seen = ds.render(ds.load(folder / shown.category / "sketch.json"), cameras).color[..., 0]
                for k, view in enumerate((seen * 255).byte().numpy()):
                    picture.paste(Image.fromarray(view), (left + (k + 1) * CELL, top))
        if i:
            pen.line((left, 0, left, picture.height), 160)
    picture.save(chosen.keep / "sheet.png", optimize=True)


def sketched(shown: Shown, weight: float, keep: Path | None) -> dict[str, float]:
    """Figures of one run; none if the picture is refused."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        path, out = folder / f"{shown.category}.png", folder / shown.category
        save_png(path, shown.picture)
        begun = time.perf_counter()
        try:
            spec = RunSpec(Picture(path, reference_loss=weight))
            sketch = run_image(with_options(spec, prior="exemplar", sheet_every=0, overwrite=True), out)
        except ValueError as error:
            print(error, file=sys.stderr)
            return {}
        seconds = time.perf_counter() - begun
    camera = ds.orbit(shown.azimuth, shown.elevation, DISTANCE, size=SIZE // 4)
    seen = [ds.render(one, camera).color for one in (sketch, shown.sketch)]
    error = float((seen[0] - seen[1]).square().mean().sqrt())
    flat = scores(*(seen_flat(one, camera) for one in (sketch, shown.sketch)))
    return {**scores(sketch, shown.sketch), "view_error": error, "view_F5": flat["F5"],
            "view_chamfer_percent": flat["chamfer_percent"], "seconds": seconds, "strokes": len(sketch)}  # fmt: skip


def seen_flat(sketch: ds.Sketch, camera: ds.Cameras) -> ds.Sketch:
    """What a camera sees, as strokes in a plane: rational curves stay so under projection."""
    weighted = torch.cat([sketch.points * sketch.weights[..., None], sketch.weights[..., None]], -1).double()
    seen = weighted @ camera.projection[0, :3].mT
    points = torch.cat([seen[..., :2] / seen[..., 2:], torch.zeros_like(seen[..., :1])], -1)
    return replace(sketch, points=points.float(), weights=seen[..., 2].float())


def confidence(chosen: argparse.Namespace) -> dict[str, Any]:
    """Fits the logistic function of confidence in a folder of one's own sketches, on members of the library.

    Things count twice, once with their category left out; shapes once.
    Every condition has the same weight, and so have the shapes: there are fewer drawings without hidden lines, but they
    are what people draw.
    """
    rows = []
    for condition in (*CONDITIONS, *HIDDEN):
        for shown in pictures_of(condition, chosen.each, FIRST_SEED * 2):
            lines = lines_in(shown.picture)
            found = matches(lines)
            left = {name: match for name, match in found.items() if name != shown.category}
            name, known = best_of(lines, found)
            rows += [(*known, name == shown.category, "known", condition),
                     (*best_of(lines, left)[1], False, "left_out", condition)]  # fmt: skip
            print(*rows[-2:], sep="\n", file=sys.stderr)
    chance = np.random.default_rng(FIRST_SEED * 2)
    for name in list(SHAPES)[: len(SHAPES) // 2]:
        for how in (None, *[chance] * (2 * chosen.each - 1)):
            lines = lines_in(shape_drawing(name, how))
            rows.append((*best_of(lines, matches(lines))[1], False, "shape", "shape"))
            print(rows[-1], file=sys.stderr)
    return fitted(rows)


def fitted(rows: list[tuple[Any, ...]]) -> dict[str, Any]:
    """The fit to rows of score, lead, gap, whether it is right, group and condition."""
    features, right = np.array([row[:3] for row in rows]), np.array([row[3] for row in rows])
    features[:, 2] **= 2
    pictures = Counter(row[5] for row in rows)
    factors, offset = fitted_logistic(features, right, np.array([1 / pictures[row[5]] for row in rows]))
    sure = 1 / (1 + np.exp(-(features @ factors + offset)))
    bins = [(low / 10, (sure >= low / 10) & (sure < low / 10 + 0.1)) for low in range(10)]
    table = [(f"{low:.1f} to {low + 0.1:.1f}", int(i.sum()), float(right[i].mean())) for low, i in bins if i.any()]
    show("Confidence and what was right", ("confidence", "pictures", "right"), table)
    figures: dict[str, Any] = {
        "of_score": factors[0],
        "of_lead": factors[1],
        "of_squared_gap": factors[2],
        "offset": offset,
    }
    for group in ("known", "left_out", "shape"):
        of_group = np.array([row[4] == group for row in rows])
        taken = (sure >= LEAST_CONFIDENCE)[of_group]
        figures[group] = {"pictures": len(taken), "taken": float(taken.mean()),
                          "taken_and_wrong": float((taken & ~right[of_group]).mean())}  # fmt: skip
    show("Confidence", ("figure", "value"), list(figures.items()))
    return {**figures, "right_by_confidence": table}


def matches(lines: Lines) -> dict[str, Match]:
    """The view of every kind that is most like a picture."""
    wanted = described(lines)
    return {name: seen_from(wanted, name) for name in trained().kinds}


def best_of(lines: Lines, found: dict[str, Match]) -> tuple[str, tuple[float, float, float]]:
    """The best category, and what confidence is a function of: its score, its lead, and how far its lines lie."""
    (name, best), (_, second) = sorted(found.items(), key=lambda pair: -pair[1].score)[:2]
    return name, (best.score, best.score - second.score, gap_to(lines, name, best))


def fitted_logistic(features: np.ndarray, right: np.ndarray, weights: np.ndarray) -> tuple[list[float], float]:
    """The most likely factors of the features and offset."""
    scale = features.std(0)
    basis = np.column_stack([features / scale, np.ones(len(features))])

    def loss(parameters: np.ndarray) -> float:
        along = basis @ parameters
        return float((weights * (np.logaddexp(0, along) - right * along)).sum() / weights.sum())

    found = minimize(loss, np.zeros(features.shape[1] + 1)).x
    return (found[:-1] / scale).tolist(), float(found[-1])


def main() -> None:
    """Runs one of the three."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("recognised", "sketches", "confidence"))
    parser.add_argument("--each", type=int, default=2, help="things of every category")
    parser.add_argument("--only", type=lambda text: text.split(","), default=["chair", "mug", "house", "car", "teapot"])
    parser.add_argument("--weights", type=lambda text: [float(w) for w in text.split(",")], default=[3000.0])
    parser.add_argument("--conditions", type=lambda text: text.split(","), default=["plain", "noise", "jitter"])
    parser.add_argument("--keep", type=Path, help="folder for the runs")
    parser.add_argument("--json", type=Path, help="file of figures, to which these are added")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    about = environment()
    figures = {"recognised": recognised, "sketches": sketches, "confidence": confidence}[chosen.what](chosen)
    if chosen.json:
        before = json.loads(chosen.json.read_text())["figures"] if chosen.json.exists() else {}
        part = {"commit": about["commit"], "command": about["command"], **figures}
        write_json(chosen.json, about, {**before, chosen.what: part})


if __name__ == "__main__":
    main()
