"""How long the edges of a busy object take, stage by stage: some hundred toy bricks with studs, in many pictures.

    python benchmarks/busy.py OUT [--bricks 300] [--views 100] [--seed 0]
    python benchmarks/busy.py OUT --source FOLDER_OR_TRANSFORMS     pictures of your own

Writes OUT/scene (once), runs `diff3ds views --target color-edges` on it in a process of its own, and prints seconds on
the clock and of the processor for every stage, what was capped, the curves, and the largest memory. The pictures have
some 18,000 ridge points each, as those of NeRF's lego (19,750 at 400 x 400). The rasteriser is that of the CAD parts:
pip install 'diff3ds[cad]'.
"""

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
from cad.boundary import Mesh
from cad.raster import rasterise, shade
from cad.views import CENTRE, random_views, transforms
from PIL import Image

# A stud's sides; of the unit cube, the side of a brick with one stud, its height, and a stud's radius and height.
SIDES, PITCH, HEIGHT, RADIUS, STUD = 16, 1 / 16, 1 / 14, 0.3 / 16, 0.02
# So that the pile fills the pictures.
ZOOM = 1.7
COLOURS = np.array([[0.85, 0.7, 0.15], [0.35, 0.35, 0.38], [0.75, 0.2, 0.15], [0.2, 0.35, 0.7], [0.8, 0.8, 0.78]])


def bricks(seed: int, count: int) -> tuple[Mesh, np.ndarray]:
    """Bricks piled up at random on a grid, and a colour for each."""
    rng = np.random.default_rng(seed)
    tops = np.zeros((14, 14), int)
    parts = []
    for number in range(count):
        size = rng.choice([(1, 2), (2, 1), (2, 2), (1, 4), (4, 1), (2, 4), (1, 1)])
        corner = [rng.integers(0, 15 - size[k]) for k in (0, 1)]
        place = tuple(slice(corner[k], corner[k] + size[k]) for k in (0, 1))
        level = int(tops[place].max())
        if level > 11:
            continue
        tops[place] = level + 1
        low = np.array([*corner, 0]) * PITCH + [PITCH, PITCH, level * HEIGHT]
        parts.append(_prism(_square(low[:2], np.array(size) * PITCH), low[2], HEIGHT, number))
        for i, j in np.ndindex(*size):
            center = low[:2] + (np.array([i, j]) + 0.5) * PITCH
            turn = 2 * np.pi * np.arange(SIDES) / SIDES
            round_ = center + RADIUS * np.column_stack([np.cos(turn), np.sin(turn)])
            parts.append(_prism(round_, low[2] + HEIGHT, STUD, number))
    start = np.cumsum([0, *(len(p.vertices) for p in parts)])
    mesh = Mesh(
        CENTRE + ZOOM * (np.concatenate([p.vertices for p in parts]) - CENTRE),
        np.concatenate([p.normals for p in parts]),
        np.concatenate([p.triangles + s for p, s in zip(parts, start, strict=False)]),
        np.concatenate([p.face for p in parts]),
    )
    return mesh, COLOURS[rng.integers(0, len(COLOURS), count)]


def _square(low: np.ndarray, size: np.ndarray) -> np.ndarray:
    return low + size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def _prism(outline: np.ndarray, bottom: float, height: float, number: int) -> Mesh:
    """An upright prism over a convex outline, counter-clockwise from above, with flat faces."""
    count = len(outline)
    onwards = np.roll(outline, -1, 0)
    low, high = (np.column_stack([outline, np.full(count, z)]) for z in (bottom, bottom + height))
    sides = np.stack([low, np.roll(low, -1, 0), np.roll(high, -1, 0), high], 1).reshape(-1, 3)
    out = np.column_stack([onwards[:, 1] - outline[:, 1], outline[:, 0] - onwards[:, 0], np.zeros(count)])
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    quads = (4 * np.arange(count)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    fan = np.column_stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)])
    triangles = np.concatenate([quads, 4 * count + fan, 5 * count + fan[:, ::-1]])
    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    return Mesh(
        np.concatenate([sides, high, low]),
        np.concatenate([np.repeat(out, 4, 0), up, -up]),
        triangles,
        np.full(len(triangles), number),
    )


def generate(folder: Path, seed: int, count: int, views: int) -> None:
    """Writes the pictures and their transforms.json."""
    mesh, colours = bricks(seed, count)
    cameras = random_views(np.random.default_rng([seed, 1000]), views)
    (folder / "color").mkdir(parents=True, exist_ok=True)
    for i, view in enumerate(cameras):
        picture = shade(rasterise(mesh, view), mesh, view, colours)
        Image.fromarray(np.round(255 * picture).astype(np.uint8)).save(folder / "color" / f"{i:03d}.png")
    (folder / "transforms.json").write_text(json.dumps(transforms(cameras, "color")))


def main() -> None:
    """Runs what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--source", type=Path)
    parser.add_argument("--bricks", type=int, default=300)
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", type=int, default=400)
    options = parser.parse_args()
    scene = options.source or options.out / "scene"
    if not options.source and not (scene / "transforms.json").is_file():
        generate(scene, options.seed, options.bricks, options.views)
    out = options.out / "sketch"
    command = ["views", str(scene), "--target", "color-edges", "--size", str(options.size), "-o", str(out)]
    subprocess.run([sys.executable, "-m", "diff3ds.cli", *command, "--overwrite"], check=True)
    about = json.loads((out / "run.json").read_text())
    stages = {"read": {"seconds": about["seconds"]["read"]}, **about["stages"]}
    for stage, spent in stages.items():
        print(f"{stage:32} {spent['seconds']:8.1f} s  {spent.get('processor', float('nan')):8.1f} s of the processor")
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"capped: {about['capped']}")
    print(f"{about['strokes_left']} curves, {usage.ru_utime:.0f} s of the processor, {usage.ru_maxrss >> 10} MiB")


if __name__ == "__main__":
    main()
