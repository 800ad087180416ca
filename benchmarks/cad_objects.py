"""CAD-like objects with exactly known sharp edges and 50 pictures each, in the form of the ABC-NEF data.

    python benchmarks/cad_objects.py OUT [--seeds 0-29] [--clean]

Writes OUT/NN/ for every seed: ground_truth.json, transforms_edges.json and edges/, transforms_color.json and color/,
about.json. Some five seconds an object. Seeds 0 to 29 are for tuning, 30 to 59 for judging; both are frozen
(cad_objects.sha256.json). The CAD kernel is needed: pip install 'diff3ds[cad]'.
"""

import argparse
import hashlib
import importlib.metadata
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
from cad.boundary import Edge
from cad.detector import CLEAN, edge_map, random_detector
from cad.lines import SHARP, SMOOTH, Pieces, contours, pieces_of_edges, visible
from cad.part import Part, random_part
from cad.raster import face_colours, rasterise, shade
from cad.views import random_views, transforms
from PIL import Image

VIEWS = 50
FROZEN = Path(__file__).with_suffix(".sha256.json")
SETS = {"tune": range(30), "held out": range(30, 60)}


def ground_truth(part: Part, seen: np.ndarray | None = None) -> dict:
    """The content of ground_truth.json: a curve for each sharp edge; `seen` (edges,) is the share that views show."""
    curves = []
    for i, edge in enumerate(part.sharp):
        curve = {"type": edge.type, "points": _rounded(edge.points)}
        if edge.center is not None:
            curve |= {"center": _rounded(edge.center), "normal": _rounded(edge.normal)}
        if edge.type == "circle":
            curve |= {"radius": _rounded(edge.radius), "angle": _rounded(edge.angle)}
        if seen is not None:
            curve["seen"] = round(float(seen[i]), 3)
        curves.append(curve)
    return {"units": "the longest side of the object's bounding box is 1", "curves": curves}


def _rounded(values) -> list | float:
    # Adding zero turns -0 into 0.
    return (np.round(np.asarray(values, float), 6) + 0.0).tolist()


def generate(seed: int, folder: Path, *, clean: bool = False, views: int = VIEWS) -> dict:
    """Writes the object of that seed, its pictures and its ground truth into the folder; returns about.json's content.

    `clean` leaves out the edge maps' faults and bias; the object, the cameras and the colour pictures stay the same.
    """
    part = random_part(seed)
    # The pictures' random numbers are not those of the part: `clean` and `views` change nothing else.
    rng = np.random.default_rng([seed, 1000])
    cameras = random_views(rng, views)
    colours = face_colours(rng, int(part.mesh.face.max()) + 1)
    detector = CLEAN if clean else random_detector(rng)
    for name in ("edges", "color"):
        (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / f"transforms_{name}.json").write_text(json.dumps(transforms(cameras, name)))
    edges = _merged(pieces_of_edges(part.sharp, SHARP), pieces_of_edges(part.smooth, SMOOTH))
    shown = np.zeros((views, len(edges.edge)), bool)
    for i, view in enumerate(cameras):
        buffer = rasterise(part.mesh, view)
        color = shade(buffer, part.mesh, view, colours)
        shown[i] = visible(edges, buffer, view)
        fold = contours(part.mesh, view)
        pieces = _merged(edges.choose(shown[i]), fold.choose(visible(fold, buffer, view)))
        ink = edge_map(np.random.default_rng([seed, 2000, i]), detector, pieces, view, color)
        _save(folder / "edges" / f"{i:03d}.png", ink)
        _save(folder / "color" / f"{i:03d}.png", color)
    seen = _seen(edges, shown, part.sharp)
    (folder / "ground_truth.json").write_text(json.dumps(ground_truth(part, seen)))
    habits = {name: np.round(value, 4).tolist() for name, value in asdict(detector).items()}
    about = {"seed": seed, "family": part.family, "curves": len(part.sharp), "detector": habits}
    (folder / "about.json").write_text(json.dumps(about, indent=1))
    return about


def _merged(a: Pieces, b: Pieces) -> Pieces:
    """Both, the edges of the second numbered after those of the first; contours keep -1."""
    number = np.where(b.edge < 0, -1, b.edge + a.edge.max(initial=-1) + 1)
    return Pieces(np.concatenate([a.ends, b.ends]), np.concatenate([a.kind, b.kind]), np.concatenate([a.edge, number]))


def _seen(edges: Pieces, shown: np.ndarray, sharp: list[Edge]) -> np.ndarray:
    """Share of each sharp edge that at least three views show: what can be triangulated with some certainty."""
    often = shown.sum(0) >= 3
    return np.array([often[edges.edge == i].mean() for i in range(len(sharp))])


def _save(path: Path, image: np.ndarray) -> None:
    Image.fromarray(np.round(255 * image).astype(np.uint8)).save(path)


def digest(seeds: range) -> str:
    """sha256 of the ground truths of these seeds, as numbers rounded to 1e-6."""
    text = "".join(json.dumps(ground_truth(random_part(seed))) for seed in seeds)
    return hashlib.sha256(text.encode()).hexdigest()


def freeze() -> dict:
    """What the file of hashes holds: one for each set, one for each seed, and the kernel's version."""
    kernel = importlib.metadata.version("cadquery-ocp-novtk")
    sets = {name: digest(seeds) for name, seeds in SETS.items()}
    each = {str(seed): digest(range(seed, seed + 1)) for seeds in SETS.values() for seed in seeds}
    return {"cadquery-ocp-novtk": kernel, "numpy": np.__version__, "sets": sets, "seeds": each}


def main() -> None:
    """Writes the objects that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for one folder a seed, or with --freeze the file of hashes")
    parser.add_argument("--seeds", default="0-29", help="first-last, or one number")
    parser.add_argument("--clean", action="store_true", help="edge maps without gaps, noise and bias")
    parser.add_argument("--freeze", action="store_true", help="write no objects, but the hashes of both sets")
    chosen = parser.parse_args()
    if chosen.freeze:
        chosen.out.write_text(json.dumps(freeze(), indent=1) + "\n")
        return
    first, _, last = chosen.seeds.partition("-")
    for seed in range(int(first), int(last or first) + 1):
        about = generate(seed, chosen.out / f"{seed:02d}", clean=chosen.clean)
        print(f"{seed:02d}  {about['family']}  {about['curves']} curves", flush=True)


if __name__ == "__main__":
    main()
